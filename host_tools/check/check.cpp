#include "host_tools/check/check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "host_tools/check/column_words.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

using nlohmann::json;

bool CheckResult::has_error() const {
  return std::any_of(findings.begin(), findings.end(), [](const CheckFinding& finding) { return finding.error; });
}

namespace {

/// Whether each train log alone speaks for the change. What one log shows and another does not, such as a load, is no
/// mistake of columns or URDF.
bool is_in_each_log(const Robot& robot, const std::vector<ProcessedLog>& logs, double lead_s,
                    const ArrangementFinding& finding, const ArrangementOptions& options) {
  return std::all_of(logs.begin(), logs.end(), [&](const ProcessedLog& log) {
    if (log.role != Role::train) return true;
    const ArrangementEvidence evidence(robot, sample_torque({&log, 1}, options.samples, lead_s), options);
    return !evidence.enough() || evidence(finding.move.result).nats < evidence(finding.from).nats;
  });
}

/// Whether a log, its columns changed, is explained together with the train logs.
bool settles(const Robot& robot, const TorqueSamples& train, const TorqueSamples& log, const Arrangement& change,
             const ArrangementOptions& options) {
  const auto rise = [&](const TorqueSamples& samples) {
    const double times = disagreement(robot, train, samples, options);
    return times * times - 1;
  };
  return rise(arranged(log, change)) <= options.settled_rise * rise(log);
}

/// In the order of a project's columns.
std::vector<std::string> signals_in(const std::vector<ProcessedLog>& logs) {
  const ProcessedLog& log = logs.front();
  std::vector<std::string> out{"t", "q"};
  if (log.measured_dq.size() > 0) out.emplace_back("dq");
  if (log.measured_ddq.size() > 0) out.emplace_back("ddq");
  out.emplace_back("tau");
  if (log.qlink.size() > 0) out.emplace_back("qlink");
  return out;
}

std::string of_limit(const std::optional<double>& share) {
  return share ? fmt::format("{:.0f} %", 100 * *share) : std::string("-");
}

/// The lines to paste each on a line of its own.
std::string indented(const std::string& lines) {
  std::string out;
  for (const char c : lines) {
    out += c;
    if (c == '\n') out += "    ";
  }
  return out;
}

std::string joint_table(const std::vector<JointFacts>& joints) {
  std::string out = fmt::format("\n{:<20} {:>19} {:>8} {:>10} {:>8} {:>10} {:>10} {:>10}\n", "joint", "range",
                                "of URDF", "speed /s", "of URDF", "resolution", "torque", "saturated");
  for (const JointFacts& joint : joints) {
    out += fmt::format("{:<20} {:>8.3g} .. {:<5.3g}{:>4} {:>7} {:>10.3g} {:>8} {:>10} {:>10.3g} {:>8.2g} %\n",
                       joint.name, joint.lower, joint.upper, joint.unit, of_limit(joint.range_share), joint.speed,
                       of_limit(joint.speed_share),
                       joint.encoder_step > 0 ? fmt::format("{:.2g}", joint.encoder_step) : std::string("-"),
                       joint.largest_torque, 100 * joint.saturated_share);
  }
  return out;
}

std::string signal_lines(const SignalFacts& signals) {
  const std::string position = signals.position_filtered
                                   ? fmt::format("filtered at {:.3g} Hz", signals.position_cutoff_hz)
                                   : std::string("not filtered");
  std::string out = fmt::format("motion up to {:.3g} Hz; position {}, torque filtered at {:.3g} Hz; ",
                                signals.excited_hz, position, signals.torque_cutoff_hz);
  if (!signals.torque_lead) return out + "the logs don't tell whether the torque is of the motion's time\n";
  const auto [seconds, resolution] = *signals.torque_lead;
  if (std::fabs(seconds) <= resolution)
    return out + fmt::format("the torque is of the motion's time, within {:.1f} ms\n", 1000 * resolution);
  return out + fmt::format("the torque is {:.1f} +- {:.1f} ms {} the motion\n", 1000 * std::fabs(seconds),
                           1000 * resolution, seconds < 0 ? "behind" : "ahead of");
}

json to_json(const JointFacts& joint) {
  json out = {{"joint", joint.name},
              {"q_lower", joint.lower},
              {"q_upper", joint.upper},
              {"speed", joint.speed},
              {"encoder_step", joint.encoder_step},
              {"largest_torque", joint.largest_torque},
              {"saturated_share", joint.saturated_share}};
  if (joint.range_share) out["range_share"] = *joint.range_share;
  if (joint.speed_share) out["speed_share"] = *joint.speed_share;
  return out;
}

json to_json(const SignalFacts& signals) {
  json out = {{"excited_hz", signals.excited_hz},
              {"position_cutoff_hz", signals.position_cutoff_hz},
              {"torque_cutoff_hz", signals.torque_cutoff_hz}};
  if (signals.torque_lead) {
    out["torque_lead_s"] = signals.torque_lead->seconds;
    out["torque_lead_resolution_s"] = signals.torque_lead->resolution;
  }
  return out;
}

}  // namespace

std::vector<CheckFinding> check_columns(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options, const TorqueSamples* others) {
  std::vector<CheckFinding> out;
  if (!project.check.columns) return out;
  const auto lead = find_long_torque_lead(project, logs, options);
  if (lead) out.push_back(in_words(*lead));
  const double lead_s = lead ? lead->seconds : project.signals.torque_lead_s.value_or(0);
  const TorqueSamples samples = sample_torque(logs, options.samples, lead_s);
  const ArrangementEvidence evidence(project.robot, samples, options);
  Arrangement all = as_given(project.robot);
  std::optional<ArrangementEvidence> of_same_robot;
  if (others != nullptr)
    of_same_robot.emplace(project.robot, samples, options,
                          ArrangementEvidence(project.robot, *others, options).bodies(all));
  // Slow motion alone hardly shows the bodies: friction that the model lacks makes other ones of them.
  const auto holds_for_robot = [&](const ArrangementFinding& finding) {
    return !of_same_robot ||
           (*of_same_robot)(finding.move.result).nats < (*of_same_robot)(finding.from).nats - options.gain;
  };
  std::vector<ArrangementFinding> found;
  for (ArrangementFinding& finding : find_mistakes(evidence, options, others != nullptr)) {
    if (!is_in_each_log(project.robot, logs, lead_s, finding, options)) break;
    if (!holds_for_robot(finding)) break;
    all = finding.move.result;
    found.push_back(std::move(finding));
  }
  if (others != nullptr && !settles(project.robot, *others, samples, all, options)) found.clear();
  const std::vector<std::string> signals = signals_in(logs);
  for (const ArrangementFinding& finding : found) out.push_back(in_words(finding, all, project, signals, options));
  return out;
}

namespace {

/// Gains and zeros hardly show in a log alone, whose bodies are only those that a URDF guesses. With those that the
/// train logs teach they do; but so does another load. A change after which the log agrees with the train logs is none.
std::vector<CheckFinding> what_makes_it_agree(const Project& project, const TorqueSamples& train,
                                              const TorqueSamples& samples, const std::vector<std::string>& signals,
                                              const ArrangementOptions& options) {
  const Arrangement given = as_given(project.robot);
  const ArrangementEvidence evidence(project.robot, samples, options,
                                     ArrangementEvidence(project.robot, train, options).bodies(given));
  const std::vector<ArrangementFinding> found = find_mistakes(evidence, options, true);
  std::vector<CheckFinding> out;
  if (found.empty()) return out;
  const Arrangement& after = found.back().move.result;
  if (disagreement(project.robot, train, arranged(samples, after), options) > options.disagree) return out;
  for (const ArrangementFinding& finding : found) out.push_back(in_words(finding, after, project, signals, options));
  return out;
}

}  // namespace

std::vector<CheckFinding> check_one_log(const Project& project, const TorqueSamples& train, Log log,
                                        const FilterFit& filter, const ArrangementOptions& options) {
  check_torque(log, project.robot);
  const std::string name = log.file.filename().string();
  const Role role = log.role;
  Project alone = project;
  for (LogEntry& entry : alone.logs) {
    entry.role = entry.role == log.role ? Role::train : Role::baseline;
    entry.own_format = true;  // what is to be written belongs into its [[log]]
  }
  log.role = Role::train;
  std::vector<ProcessedLog> logs;
  logs.push_back(process(std::move(log), filter));
  const double lead_s = project.signals.torque_lead_s.value_or(0);
  const TorqueSamples samples = sample_torque(logs, options.samples, lead_s);
  std::vector<CheckFinding> out;
  if (disagreement(project.robot, train, samples, options) <= options.disagree) return out;
  std::vector<CheckFinding> found = check_columns(alone, logs, options, &train);
  std::erase_if(found, [](const CheckFinding& finding) { return !finding.error; });
  // What changed since the healthy session, such as a gain or a zero, is for the diagnosis to find.
  if (found.empty() && role != Role::baseline)
    found = what_makes_it_agree(alone, train, samples, signals_in(logs), options);
  for (CheckFinding& finding : found) {
    finding.log = name;
    out.push_back(std::move(finding));
  }
  return out;
}

namespace {

/// What the train and validate logs show against the URDF.
std::vector<CheckFinding> compare_with_urdf(const Project& project, const std::filesystem::path& directory,
                                            const std::vector<ProcessedLog>& logs, const ArrangementOptions& options) {
  if (!project.check.columns) return {};
  // The logs are read once more only where nothing fits.
  if (is_unexplained(project, logs, options) &&
      are_exchanged(project, read_logs(project, Role::train, directory), options)) {
    return {{true,
             "exchanged",
             {},
             "",
             "the columns of q and tau look exchanged: the URDF explains the positions as torques",
             "the columns of tau as those of q, and those of q as tau:\ncolumns = { q = .., tau = .. }"}};
  }
  return check_columns(project, logs, options);
}

void append(std::vector<CheckFinding> more, std::vector<CheckFinding>& to) {
  std::move(more.begin(), more.end(), std::back_inserter(to));
}

/// Facts of all logs, read role by role; findings of those that the fit does not see.
/// @param fitted train and validate logs; empty: there is none to compare with
/// @param of_train known already
std::vector<LogFacts> read_facts(const Project& project, const std::filesystem::path& directory,
                                 const std::vector<ProcessedLog>& fitted, const std::vector<LogFacts>& of_train,
                                 KnownRows& known, const CheckOptions& options, std::vector<CheckFinding>& findings) {
  std::optional<TorqueSamples> train;
  if (project.check.columns && !fitted.empty()) {
    // Of those that train; a copy of them would hold a long log twice.
    train = sample_torque(fitted, options.arrangement.samples, project.signals.torque_lead_s.value_or(0));
  }
  std::vector<LogFacts> out;
  for (const Role role : {Role::baseline, Role::train, Role::validate, Role::test}) {
    if (role == Role::train) {
      out.insert(out.end(), of_train.begin(), of_train.end());
      continue;
    }
    for (Log& log : read_logs(project, role, directory, &known)) {
      out.push_back(facts_of(log, options.facts));
      if (!train) continue;
      append(check_one_log(project, *train, std::move(log), fitted.front().filter, options.arrangement), findings);
    }
  }
  return out;
}

/// What the logs alone show, against the URDF's limits too, where the project wants it.
std::vector<CheckFinding> findings_alone(const Project& project, const std::vector<LogFacts>& facts,
                                         const LogFactOptions& options) {
  std::vector<CheckFinding> out = findings_of(facts, project.robot, options);
  for (CheckFinding& finding : out) finding.error = finding.error && project.check.columns;
  return out;
}

/// The lines to paste, within a sentence.
std::string inline_text(const std::string& lines) {
  std::string out;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool joined = out.ends_with(':') || lines.compare(i, 4, "\nor ") == 0;
    if (lines[i] == '\n') out += joined ? " " : " and ";
    if (lines[i] != '\n') out += lines[i];
  }
  const bool several = std::count(lines.begin(), lines.end(), '\n') > 1;
  return several ? out + " (fxdyn check prints the lines)" : out;
}

}  // namespace

std::vector<LogFacts> facts_of_train_logs(const Project& project, const std::filesystem::path& directory,
                                          const LogFactOptions& options) {
  std::vector<LogFacts> out;
  for (const Log& log : read_logs(project, Role::train, directory)) out.push_back(facts_of(log, options));
  return out;
}

std::vector<std::string> check_before_fit(const Project& project, const std::filesystem::path& directory,
                                          GateData& data, const std::vector<LogFacts>& train,
                                          const CheckOptions& options) {
  std::vector<CheckFinding> findings = compare_with_urdf(project, directory, data.logs, options.arrangement);
  const std::vector<LogFacts> facts = read_facts(project, directory, data.logs, train, data.rows, options, findings);
  append(findings_alone(project, facts, options.facts), findings);
  std::vector<std::string> notes;
  for (const CheckFinding& finding : findings) {
    std::string text = (finding.log.empty() ? "" : finding.log + ": ") + finding.text;
    if (!finding.fix.empty()) text += "; write " + inline_text(finding.fix);
    if (finding.error) throw DataError(text + ", or [check] columns = false if the columns are right");
    // Reading them has told some already.
    for (const auto* known : {&data.notes, &notes}) {
      if (std::find(known->begin(), known->end(), text) != known->end()) text.clear();
    }
    if (!text.empty()) notes.push_back(std::move(text));
  }
  return notes;
}

CheckResult check(const Project& project, const std::filesystem::path& directory, const CheckOptions& options) {
  CheckResult result;
  std::vector<ProcessedLog> train;
  const std::vector<LogFacts> of_train = facts_of_train_logs(project, directory, options.facts);
  KnownRows known;
  if (project.has_role(Role::train)) {
    GateData data = read_gate_data(project, directory);
    append(compare_with_urdf(project, directory, data.logs, options.arrangement), result.findings);
    const double rate_hz = 1 / data.logs.front().step_s;
    result.signals = {data.filter.excited_hz,
                      data.filter.position_cutoff_hz,
                      data.filter.torque_cutoff_hz,
                      data.filter.position_cutoff_hz < 0.475 * rate_hz,
                      {}};
    if (project.check.columns) result.signals->torque_lead = torque_lead(project, data.logs, options.arrangement);
    train = std::move(data.logs);
    known = std::move(data.rows);
  }
  result.logs = read_facts(project, directory, train, of_train, known, options, result.findings);
  result.joints = joints_of(result.logs, project.robot, train);
  append(saturation_of(result.joints, options.facts), result.findings);
  if (!project.has_role(Role::train)) {
    result.findings.push_back(
        {false, "no_train_log", {}, "", "no log has role = \"train\": nothing is compared with the URDF", ""});
  }
  append(findings_alone(project, result.logs, options.facts), result.findings);
  return result;
}

std::string check_table(const CheckResult& result) {
  std::string out = fmt::format("{:<24} {:<9} {:>9} {:>9} {:>8}\n", "log", "role", "seconds", "Hz", "at rest");
  for (const LogFacts& log : result.logs) {
    out += fmt::format("{:<24} {:<9} {:>9.4g} {:>9.4g} {:>6.0f} %{}\n", log.name, to_string(log.role), log.seconds,
                       log.rate_hz, 100 * log.rest_share, log.resampled ? "  irregular stamps" : "");
  }
  out += joint_table(result.joints);
  if (result.signals) out += signal_lines(*result.signals);
  for (const CheckFinding& finding : result.findings) {
    out += fmt::format("{}: {}{}\n", finding.error ? "error" : "warning", finding.log.empty() ? "" : finding.log + ": ",
                       finding.text);
    if (!finding.fix.empty()) out += fmt::format("    write {}\n", indented(finding.fix));
  }
  if (result.findings.empty()) out += "nothing looks wrong in these logs\n";
  return out;
}

json to_json(const CheckResult& result) {
  const auto list = [](const Eigen::VectorXd& values) { return std::vector<double>(values.begin(), values.end()); };
  json logs = json::array(), findings = json::array();
  for (const LogFacts& log : result.logs) {
    logs.push_back({{"log", log.name},
                    {"role", to_string(log.role)},
                    {"begin_s", log.begin_s},
                    {"end_s", log.end_s},
                    {"rate_hz", log.rate_hz},
                    {"irregular", log.resampled},
                    {"rest_share", log.rest_share},
                    {"rest_until_s", log.rest_until_s},
                    {"rest_from_s", log.rest_from_s},
                    {"q_lower", list(log.q_lower)},
                    {"q_upper", list(log.q_upper)},
                    {"speed", list(log.speed)},
                    {"encoder_step", list(log.encoder_step)},
                    {"largest_torque", list(log.largest_torque)}});
  }
  for (const CheckFinding& finding : result.findings) {
    json one = {{"severity", finding.error ? "error" : "warning"}, {"kind", finding.kind}, {"text", finding.text}};
    if (finding.joint) one["joint"] = *finding.joint + 1;
    for (const OtherFinding& other : finding.others) {
      json also = {{"kind", other.kind}};
      if (other.joint) also["joint"] = *other.joint + 1;
      one["or"].push_back(std::move(also));
    }
    if (!finding.log.empty()) one["log"] = finding.log;
    if (!finding.fix.empty()) one["fix"] = finding.fix;
    findings.push_back(one);
  }
  json joints = json::array();
  for (const JointFacts& joint : result.joints) joints.push_back(to_json(joint));
  json out = {{"schema", "fxdyn.check/1"}, {"logs", logs}, {"joints", joints}, {"findings", findings}};
  if (result.signals) out["signals"] = to_json(*result.signals);
  return out;
}

}  // namespace fxdyn

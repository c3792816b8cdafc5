#include "host_tools/check/check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/check/column_words.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/simulate/recordings.hpp"

namespace fxdyn {

using nlohmann::json;

bool CheckResult::has_error() const {
  return std::any_of(findings.begin(), findings.end(), [](const CheckFinding& finding) { return finding.error; });
}

namespace {

/// Whether each train log alone speaks for the change. What one log shows and another does not, such as a load, is no
/// mistake of columns or URDF.
bool is_in_each_log(const Robot& robot, const std::vector<ProcessedLog>& logs, double lead_s, const Arrangement& before,
                    const Arrangement& after, const ArrangementOptions& options) {
  return std::all_of(logs.begin(), logs.end(), [&](const ProcessedLog& log) {
    if (log.role != Role::train) return true;
    const ArrangementEvidence evidence(robot, sample_torque({&log, 1}, options.samples, lead_s), options);
    return !evidence.enough() || evidence(after).nats < evidence(before).nats;
  });
}

}  // namespace

std::vector<CheckFinding> check_columns(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options) {
  std::vector<CheckFinding> out;
  if (!project.check.columns) return out;
  const auto lead = find_long_torque_lead(project, logs, options);
  if (lead) out.push_back(in_words(*lead));
  const double lead_s = lead ? lead->seconds : project.signals.torque_lead_s.value_or(0);
  const TorqueSamples samples = sample_torque(logs, options.samples, lead_s);
  const ArrangementEvidence evidence(project.robot, samples, options);
  Arrangement before = as_given(project.robot);
  for (const ArrangementFinding& finding : find_mistakes(evidence, options)) {
    if (!is_in_each_log(project.robot, logs, lead_s, before, finding.move.result, options)) break;
    before = finding.move.result;
    out.push_back(in_words(finding, project, options));
  }
  return out;
}

CheckResult check(const Project& project, const std::filesystem::path& directory, const CheckOptions& options) {
  CheckResult result;
  KnownRows known;
  for (const Role role : {Role::baseline, Role::train, Role::validate, Role::test}) {
    for (const Log& log : read_logs(project, role, directory, &known))
      result.logs.push_back(facts_of(log, options.facts));
  }
  if (project.has_role(Role::train)) {
    if (project.check.columns &&
        are_exchanged(project, read_logs(project, Role::train, directory), options.arrangement)) {
      result.findings.push_back({true,
                                 "exchanged",
                                 {},
                                 "",
                                 "the columns of q and tau look exchanged: the URDF explains the positions as torques",
                                 "exchange the columns of q and tau in columns = { ... }"});
    } else {
      const GateData data = read_gate_data(project, directory);
      result.findings = check_columns(project, data.logs, options.arrangement);
    }
  }
  for (CheckFinding& finding : findings_of(result.logs, project.robot, options.facts))
    result.findings.push_back(std::move(finding));
  return result;
}

std::string check_table(const CheckResult& result) {
  std::string out = fmt::format("{:<24} {:<9} {:>9} {:>9} {:>8}\n", "log", "role", "seconds", "Hz", "at rest");
  for (const LogFacts& log : result.logs) {
    out += fmt::format("{:<24} {:<9} {:>9.4g} {:>9.4g} {:>6.0f} %{}\n", log.name, to_string(log.role), log.seconds,
                       log.rate_hz, 100 * log.rest_share, log.resampled ? "  irregular stamps" : "");
  }
  for (const CheckFinding& finding : result.findings) {
    out += fmt::format("{}: {}{}\n", finding.error ? "error" : "warning", finding.log.empty() ? "" : finding.log + ": ",
                       finding.text);
    if (!finding.fix.empty()) out += fmt::format("    write: {}\n", finding.fix);
  }
  if (result.findings.empty()) out += "nothing is wrong with these logs\n";
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
    if (!finding.log.empty()) one["log"] = finding.log;
    if (!finding.fix.empty()) one["fix"] = finding.fix;
    findings.push_back(one);
  }
  return {{"schema", "fxdyn.check/1"}, {"logs", logs}, {"findings", findings}};
}

}  // namespace fxdyn

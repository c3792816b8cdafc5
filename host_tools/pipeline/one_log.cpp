#include "host_tools/pipeline/one_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/known_load.hpp"
#include "host_tools/identify/payload.hpp"
#include "host_tools/identify/payload_result.hpp"
#include "host_tools/pipeline/joint_trajectory.hpp"
#include "host_tools/pipeline/log_check.hpp"
#include "host_tools/project/log_entries.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {

namespace fs = std::filesystem;

namespace {

/// Columns and gains of a log, by its name.
LogFormat format_of(const IdentifiedModel& model, const fs::path& file) {
  for (const std::string& name : {file.filename().string(), std::string()}) {
    if (const auto found = model.log_formats.find(name); found != model.log_formats.end()) return found->second;
  }
  if (model.log_formats.empty()) return {};  // of a simulated robot
  throw InputError(fmt::format(
      "{}: the project's logs have different columns or gains, and this one is none of them; name it like one",
      file.string()));
}

}  // namespace

Log read_log_for(const IdentifiedModel& model, const fs::path& file, std::optional<double> from_s,
                 std::optional<double> to_s, bool torque_required) {
  std::vector<bool> revolute;
  for (const Joint& joint : model.robot.joints) revolute.push_back(joint.type == JointType::revolute);
  const LogFormat format = with_joint_names(file, format_of(model, file), model.robot);
  Log log = read_log(file, model.robot.size(), revolute, format, from_s, to_s, torque_required);
  if (!log.time_note.empty()) fmt::print(stderr, "note: {}\n", log.time_note);
  return log;
}

void require_log_of(const IdentifiedModel& model, const fs::path& file, const ProcessedLog& log,
                    const Eigen::MatrixXd& torque) {
  for (const std::string& note : check_log_for(model, file, log, torque)) fmt::print(stderr, "note: {}\n", note);
}

namespace {

/// "0.512 +- 0.003", of digits that the deviation leaves.
std::string with_deviation(double value, double std) {
  if (!(std > 0)) return fmt::format("{:.4g}", value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(std))), 0, 9);
  return fmt::format("{:.{}f} +- {:.{}f}", value, decimals, std, decimals);
}

std::size_t widest_name(const Robot& robot) {
  std::size_t width = 6;
  for (const Joint& joint : robot.joints) width = std::max(width, joint.name.size() + 2);
  return width;
}

std::string payload_table(const PayloadResult& result, const Robot& robot) {
  std::string out = fmt::format("load on {}, in that link's URDF frame (+-: one standard deviation)\n", result.link);
  for (const PayloadResult::Parameter& p : result.parameters) {
    out += fmt::format(
        "  {:<6}{:<28}{}\n", p.name,
        fmt::format("{} {}", p.identifiable ? with_deviation(p.value, p.std) : fmt::format("{:.3g}", p.value), p.unit),
        p.identifiable ? "" : "a guess: this motion does not tell it");
  }
  const std::size_t width = widest_name(robot);
  out += fmt::format("torque that the model misses (RMS), and friction with the load\n  {:<{}}{:>10}{:>10}  {:<5}{}\n",
                     "joint", width, "without", "with it", "", "change of Coulomb friction");
  for (const PayloadResult::Joint& joint : result.joints) {
    out += fmt::format("  {:<{}}{:>10.4g}{:>10.4g}  {:<5}{}\n", joint.name, width, joint.residual_before,
                       joint.residual_with_model, joint.unit,
                       with_deviation(joint.coulomb_change, joint.coulomb_change_std));
  }
  return out;
}

/// "torque_gain = [12.5, 3]"
std::string gain_line(const GainResult& result) {
  std::vector<std::string> gains;
  for (const GainResult::Joint& joint : result.joints) gains.push_back(fmt::format("{:.5g}", joint.torque_gain));
  return fmt::format("torque_gain = [{}]", fmt::join(gains, ", "));
}

/// Names of the joints whose gain stays as it is; empty: none.
std::string unknown_gains(const GainResult& result) {
  std::string out;
  for (const GainResult::Joint& joint : result.joints) {
    if (!joint.felt) out += (out.empty() ? "" : ", ") + joint.name;
  }
  return out;
}

std::string gain_table(const GainResult& result, const Robot& robot) {
  const std::size_t width = widest_name(robot);
  std::string out = fmt::format("known load on {}: {:g} kg at {:g} {:g} {:g} m in its URDF frame\n  {:<{}}{:<42}{}\n",
                                result.link, result.mass, result.com[0], result.com[1], result.com[2], "joint", width,
                                "its torque_gain times", "torque of the load (RMS)");
  for (const GainResult::Joint& joint : result.joints) {
    const std::string factor = joint.felt       ? with_deviation(joint.factor, joint.std)
                               : joint.std == 0 ? "did not feel the load"
                                                : fmt::format("did not feel the load enough (+- {:.2g} %)",
                                                              100 * joint.std / std::fabs(joint.factor));
    out += fmt::format("  {:<{}}{:<42}{:.3g} {}\n", joint.name, width, factor, joint.load_rms, joint.unit);
  }
  const std::string unknown = unknown_gains(result);
  out += fmt::format("for [signals] of the project{}:\n{}\n", unknown.empty() ? "" : ", as before for " + unknown,
                     gain_line(result));
  return out;
}

/// Errors of a prediction: bias and standard deviation make up the RMSE.
std::string prediction_table(const LogErrors& errors, const Robot& robot) {
  const std::size_t width = widest_name(robot);
  std::string out = fmt::format("measured minus predicted torque over {}\n  {:<{}}{:>10}{:>10}{:>12}  {:<5}{}\n",
                                errors.file, "joint", width, "RMSE", "bias", "deviation", "", "RMSE of the RMS torque");
  for (const auto& [name, unit, m] : errors.joints) {
    out += fmt::format("  {:<{}}{:>10.4g}{:>10.2g}{:>12.4g}  {:<5}{:.2f} %\n", name, width, m.rmse, m.bias,
                       std::sqrt(std::max(0.0, m.rmse * m.rmse - m.bias * m.bias)), unit, 100 * m.relative);
  }
  return out;
}

}  // namespace

std::string identify_payload(const fs::path& model_file, const fs::path& log_file, const fs::path& directory) {
  IdentifiedModel model = read_model(model_file);
  std::error_code ignored;
  if (fs::equivalent(directory / "model.json", model_file, ignored)) {
    throw InputError(
        fmt::format("{}: would be overwritten by the model with load; choose another --out", model_file.string()));
  }
  const ProcessedLog log = process(read_log_for(model, log_file, {}, {}), model.filter);
  check_weighable(model, log);
  require_log_of(model, log_file, log, predict(model, log));
  const LoadFit fit = identify_load(model, log);
  model.body.push_back(fit.effect);
  model.drop_tables();  // they are another model's now
  const PayloadResult report = payload_result(fit, model.robot);
  write_file(directory / "model.json", to_json(model).dump(1) + "\n");
  write_file(directory / "payload.json", to_json(report).dump(1) + "\n");
  return payload_table(report, model.robot);
}

std::string identify_torque_gains(const fs::path& model_file, const fs::path& unloaded, const fs::path& loaded,
                                  const Load& load, const fs::path& directory) {
  const IdentifiedModel model = read_model(model_file);
  const std::vector<double> gain = format_of(model, loaded).torque_gain;
  if (format_of(model, unloaded).torque_gain != gain) {
    throw InputError(fmt::format("{} and {} are read with different torque_gain: a load tells one only",
                                 unloaded.string(), loaded.string()));
  }
  const Log without = read_log_for(model, unloaded, {}, {}), with = read_log_for(model, loaded, {}, {});
  ProcessSettings settings;
  const auto seconds = [](const Log& log) { return log.step_s * static_cast<double>(log.samples()); };
  settings.shortest_interval_s = (seconds(without) + seconds(with)) / GateOptions{}.most_rows;
  const ProcessedLog first = process(without, model.filter, settings), second = process(with, model.filter, settings);
  require_log_of(model, unloaded, first, predict(model, first));
  require_log_of(model, loaded, second, predict(model, second));
  const std::vector<JointGain> gains = identify_gains(model, load, first, second);
  const GainResult result = gain_result(gains, load, model.robot, gain);
  const std::string unknown = unknown_gains(result);
  write_file(directory / "payload.json", to_json(result).dump(1) + "\n");
  write_file(directory / "torque_gain.toml",
             fmt::format("# measured with {:g} kg at {:g} {:g} {:g} m on {}{}\n[signals]\n{}\n", load.mass,
                         load.com.x(), load.com.y(), load.com.z(), result.link,
                         unknown.empty() ? "" : "; not measured: " + unknown, gain_line(result)));
  return gain_table(result, model.robot);
}

namespace {

/// As the firmware computes, or in double.
Eigen::MatrixXd torque_of(const IdentifiedModel& model, const ProcessedLog& log, bool fixed) {
  if (!fixed) return predict(model, log);
  // At the drive's ticks, as the firmware computes; then back to the log's samples.
  const TickStates ticks = at_ticks(log, model.tick_s, true);
  return at_other_times(interpolate(predict_fixed(model, *model.formats, ticks, age_of(model, log)), ticks.t, log.t),
                        model.filter.torque_lead_s / log.step_s);
}

/// Feedforward belongs to the motion's own times, however late the log's torque column is.
void write_trajectory(const fs::path& file, IdentifiedModel model, const ProcessedLog& log, const Prediction& how) {
  model.filter.torque_lead_s = 0;
  const Eigen::MatrixXd torque = torque_of(model, log, how.fixed);
  write_file(file, joint_trajectory(model.robot, log.t, log.motion(), how.raw ? torque : log.filter_columns(torque)));
}

}  // namespace

fs::path prediction_name(const fs::path& log_file) {
  if (log_file == "-") return "stdin.csv";
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(log_file, ignored);  // "." has no name
  if (fs::is_directory(whole)) return whole.filename() += ".csv";  // a bag, whose name may have a point
  fs::path name = log_file.filename();
  if (name.extension() == ".gz" || name.extension() == ".zst") name = name.stem();
  return name.replace_extension(".csv");
}

std::string predict_log(const fs::path& model_file, const fs::path& log_file, const Prediction& how,
                        const fs::path& directory) {
  const IdentifiedModel model = read_model(model_file);
  // The run's own metrics.json must survive.
  if (fs::exists(directory / "model.json")) {
    throw InputError(fmt::format("{}: holds a model and its metrics; choose another --out", directory.string()));
  }
  Log log = read_log_for(model, log_file, {}, {}, false);
  log.role = Role::test;
  const bool resampled = log.resampled;
  const Eigen::VectorXd stamps = std::move(log.stamps);
  const ProcessedLog processed = process(std::move(log), model.filter);

  if (how.fixed && !model.formats)
    throw InputError(fmt::format("{}: has no fixed-point formats; run `fxdyn export` first", model_file.string()));
  const Eigen::MatrixXd torque = torque_of(model, processed, how.fixed);
  require_log_of(model, log_file, processed, torque);
  const fs::path out = directory / prediction_name(log_file);
  std::error_code ignored;
  // Beside the log, too, where a file of that name may be another log.
  const bool beside = log_file != "-" && fs::equivalent(directory, fs::absolute(log_file).parent_path(), ignored);
  if (beside && fs::exists(out)) {
    throw InputError(fmt::format("{}: would be overwritten by a prediction; choose another --out", out.string()));
  }
  Log result;
  result.t = resampled ? stamps : processed.t;
  const Eigen::MatrixXd written = how.raw ? torque : processed.filter_columns(torque);
  result.tau = resampled ? interpolate(written, processed.t, stamps) : written;
  write_log(out, result);
  if (how.trajectory) write_trajectory(fs::path(out).replace_extension(".yaml"), model, processed, how);
  std::vector<LogErrors> errors;
  if (processed.tau.size() > 0) errors.push_back(errors_of(processed, model.robot, torque));
  const MetricsResult metrics{.logs = errors, .numbers = how.fixed ? "fixed" : "real"};
  write_file(directory / "metrics.json", to_json(metrics).dump(1) + "\n");
  return errors.empty() ? "no torque in the log: nothing to compare with\n" : prediction_table(errors[0], model.robot);
}

}  // namespace fxdyn

#include "host_tools/pipeline/one_log.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/payload.hpp"
#include "host_tools/identify/payload_result.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {

namespace fs = std::filesystem;

Log read_log_for(const IdentifiedModel& model, const fs::path& file, std::optional<double> from_s,
                 std::optional<double> to_s, bool torque_required) {
  std::vector<bool> revolute;
  for (const Joint& joint : model.robot.joints) revolute.push_back(joint.type == JointType::revolute);
  for (const std::string& name : {file.filename().string(), std::string()}) {
    if (const auto found = model.log_formats.find(name); found != model.log_formats.end())
      return read_log(file, model.robot.size(), revolute, found->second, from_s, to_s, torque_required);
  }
  throw InputError(fmt::format(
      "{}: the project's logs have different columns or gains, and this one is none of them; name it like one",
      file.string()));
}

void identify_payload(const fs::path& model_file, const fs::path& log_file, const fs::path& directory) {
  IdentifiedModel model = read_model(model_file);
  std::error_code ignored;
  if (fs::equivalent(directory / "model.json", model_file, ignored)) {
    throw InputError(
        fmt::format("{}: would be overwritten by the model with load; choose another --out", model_file.string()));
  }
  const Log log = read_log_for(model, log_file, {}, {});
  const LoadFit fit = identify_load(model, process(log, model.filter));
  model.body.push_back(fit.effect);
  model.drop_tables();  // they are another model's now
  const PayloadResult report = payload_result(fit, model.robot);
  write_file(directory / "model.json", to_json(model).dump(1) + "\n");
  write_file(directory / "payload.json", to_json(report).dump(1) + "\n");
}

void predict_log(const fs::path& model_file, const fs::path& log_file, const Prediction& how,
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

  Eigen::MatrixXd torque;
  if (how.fixed) {
    if (!model.formats)
      throw InputError(fmt::format("{}: has no fixed-point formats; run `fxdyn export` first", model_file.string()));
    // At the drive's ticks, as the firmware computes; then back to the log's samples.
    const TickStates ticks = at_ticks(processed, model.tick_s, true);
    torque = at_other_times(
        interpolate(predict_fixed(model, *model.formats, ticks, age_of(model, processed)), ticks.t, processed.t),
        model.filter.torque_lead_s / processed.step_s);
  } else {
    torque = predict(model, processed);
  }
  const fs::path out = directory / log_file.filename();
  std::error_code ignored;
  if (fs::equivalent(out, log_file, ignored)) {
    throw InputError(fmt::format("{}: would be overwritten by its prediction; choose another --out", out.string()));
  }
  Log result;
  result.t = resampled ? stamps : processed.t;
  const Eigen::MatrixXd written = how.raw ? torque : processed.filter_columns(torque);
  result.tau = resampled ? interpolate(written, processed.t, stamps) : written;
  write_log(out, result);
  std::vector<LogErrors> errors;
  if (processed.tau.size() > 0) errors.push_back(errors_of(processed, model.robot, torque));
  const MetricsResult metrics{.logs = errors, .numbers = how.fixed ? "fixed" : "real"};
  write_file(directory / "metrics.json", to_json(metrics).dump(1) + "\n");
}

}  // namespace fxdyn

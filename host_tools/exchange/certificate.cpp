#include "host_tools/exchange/certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/load_friction.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Sums over logs, joint by joint.
struct Totals {
  double samples = 0;
  Eigen::VectorXd cannot_say, file, model, sliding, misread, largest;
  explicit Totals(Eigen::Index n)
      : cannot_say(Eigen::VectorXd::Zero(n)),
        file(cannot_say),
        model(cannot_say),
        sliding(cannot_say),
        misread(cannot_say),
        largest(cannot_say) {}
};

/// At the times at which the log's torque column shows it, as predict() has it.
Eigen::MatrixXd as_recorded(const Eigen::MatrixXd& tau, const IdentifiedModel& model, const ProcessedLog& log) {
  return filter_of(model).torque_lead_s == 0 ? tau : at_other_times(tau, filter_of(model).torque_lead_s / log.step_s);
}

void add_log(Totals& sum, const ExportFormat& format, const std::filesystem::path& file, const SimpleRobot& meant,
             const IdentifiedModel& expected, const IdentifiedModel& model, const ProcessedLog& log) {
  const MotionRows motion = log.motion();
  const ReplayedTorque replayed = format.replay(file, expected, motion, log.step_s);
  const Eigen::MatrixXd said =
      format.whole_model ? settled(model, motion) : torque_of(meant, model, motion, log.step_s);
  const Eigen::MatrixXd full = predict(model, log), written = as_recorded(replayed.tau, model, log);
  const std::vector<JointMetrics> of_file = judge(log, written), of_model = judge(log, full);
  const Eigen::Index count = log.last - log.first;
  const Eigen::MatrixXd lost = log.filter_columns(full - written).middleRows(log.first, count);
  const Eigen::ArrayXXd sliding = replayed.sliding.middleRows(log.first, count).array();
  const Eigen::ArrayXXd off = (replayed.tau - said).middleRows(log.first, count).array().abs() * sliding;
  const auto samples = static_cast<double>(count);
  sum.samples += samples;
  for (Eigen::Index j = 0; j < lost.cols(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    sum.cannot_say[j] += lost.col(j).squaredNorm();
    sum.file[j] += samples * of_file[i].rmse * of_file[i].rmse;
    sum.model[j] += samples * of_model[i].rmse * of_model[i].rmse;
    sum.sliding[j] += sliding.col(j).sum();
    // NaN is no small error
    const double worst = off.col(j).isFinite().all() ? off.col(j).maxCoeff() : HUGE_VAL;
    sum.misread[j] = std::max(sum.misread[j], worst);
    sum.largest[j] = std::max(sum.largest[j], said.middleRows(log.first, count).col(j).cwiseAbs().maxCoeff());
  }
}

}  // namespace

bool Certificate::as_meant() const {
  return std::all_of(joints.begin(), joints.end(), [](const JointCertificate& joint) { return joint.as_meant; });
}

Certificate certify(const ExportFormat& format, const std::filesystem::path& file, const SimpleRobot& meant,
                    const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                    const CertificateOptions& options) {
  Certificate out{format.name, file.filename().string(), format.reader, to_string(logs.at(0).role), {}, {}};
  Totals sum(static_cast<Eigen::Index>(meant.joints.size()));
  const ModelValue simple = format.whole_model ? ModelValue(model) : as_model(meant, model);
  for (const ProcessedLog& log : logs) {
    add_log(sum, format, file, meant, simple, model, log);
    out.logs.push_back(log.name);
  }
  for (std::size_t j = 0; j < meant.joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    JointCertificate joint;
    joint.name = meant.robot.joints[j].name;
    joint.unit = meant.robot.joints[j].torque_unit();
    if (!format.whole_model) joint.written = meant.joints[j];
    joint.left_out = format.whole_model ? settled_effects(model, j)
                                        : left_out(model, j, format.has_armature, format.has_stribeck, format.has_load);
    joint.cannot_say = std::sqrt(sum.cannot_say[k] / sum.samples);
    joint.file_rmse = std::sqrt(sum.file[k] / sum.samples);
    joint.model_rmse = std::sqrt(sum.model[k] / sum.samples);
    joint.misread = sum.misread[k];
    joint.largest = sum.largest[k];
    joint.sliding_share = sum.sliding[k] / sum.samples;
    joint.as_meant = joint.misread <= (format.whole_model ? options.as_meant_fixed : options.as_meant) * joint.largest;
    out.joints.push_back(joint);
  }
  return out;
}

nlohmann::json to_json(const Certificate& certificate) {
  nlohmann::json joints = nlohmann::json::array();
  for (const JointCertificate& joint : certificate.joints) {
    nlohmann::json entry = {
        {"joint", joint.name},
        {"unit", joint.unit},
        {"left_out", joint.left_out},
        {"cannot_say", joint.cannot_say},
        {"file_rmse", joint.file_rmse},
        {"model_rmse", joint.model_rmse},
        {"misread", std::isfinite(joint.misread) ? nlohmann::json(joint.misread) : nlohmann::json()},
        {"sliding_share", joint.sliding_share},
        {"as_meant", joint.as_meant}};
    if (joint.written) {
      entry.update({{"damping", joint.written->damping},
                    {"friction", joint.written->friction},
                    {"armature", joint.written->armature}});
    }
    joints.push_back(std::move(entry));
  }
  return {{"schema", "fxdyn.certificate/1"},    {"format", certificate.format},
          {"file", certificate.file},           {"read_back_by", certificate.reader},
          {"role", certificate.role},           {"logs", certificate.logs},
          {"as_meant", certificate.as_meant()}, {"joints", joints}};
}

std::string certificate_table(const Certificate& certificate) {
  std::size_t width = 5;
  for (const JointCertificate& joint : certificate.joints) width = std::max(width, joint.name.size());
  std::string out = fmt::format(
      "{}, read back by {}, over the {} logs: RMS of what it can't say, RMSE of the file and of the model\n",
      certificate.file, certificate.reader, certificate.role);
  out += fmt::format("  {:<{}}{:>12}{:>10}{:>10}  {:<5}{}\n", "joint", width, "can't say", "file", "model", "",
                     "effects left out");
  for (const JointCertificate& joint : certificate.joints) {
    out += fmt::format("  {:<{}}{:>12.4g}{:>10.4g}{:>10.4g}  {:<5}{}\n", joint.name, width, joint.cannot_say,
                       joint.file_rmse, joint.model_rmse, joint.unit,
                       joint.left_out.empty() ? "none" : fmt::format("{}", fmt::join(joint.left_out, ", ")));
  }
  return out;
}

void require_as_meant(const Certificate& certificate) {
  for (const JointCertificate& joint : certificate.joints) {
    if (joint.as_meant) continue;
    throw DataError(fmt::format(
        "{}: {} reads joint {} up to {:.3g} {} otherwise than it was meant: don't use it, and please report "
        "this",
        certificate.file, certificate.reader, joint.name, joint.misread, joint.unit));
  }
}

}  // namespace fxdyn

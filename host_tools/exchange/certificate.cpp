#include "host_tools/exchange/certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
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
  Eigen::VectorXd cannot_say, in_motion, without_load, file, model, sliding, misread, largest;
  explicit Totals(Eigen::Index n)
      : cannot_say(Eigen::VectorXd::Zero(n)),
        in_motion(cannot_say),
        without_load(cannot_say),
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

/// What the file would lose if it had the model's own load friction: the rest of the model minus the rest of the file.
Eigen::MatrixXd lost_without_load_friction(const SimpleRobot& meant, const IdentifiedModel& model,
                                           const ProcessedLog& log) {
  SimpleRobot rest = meant;
  rest.joints = meant.beside_load;
  const ModelValue plain = without_load_friction(model);
  return predict(plain, log) - as_recorded(torque_of(rest, plain, log.motion(), log.step_s), model, log);
}

/// The same, but nothing where the joint turns round or stands: there, every simulator has its own rule.
Eigen::MatrixXd where_sliding(Eigen::MatrixXd lost, const IdentifiedModel& model, const ProcessedLog& log) {
  for (Eigen::Index j = 0; j < lost.cols(); ++j) {
    const double least = ProjectionOptions{}.sliding_widths * joints_of(model)[static_cast<std::size_t>(j)].sign_width;
    lost.col(j).array() *= (log.joint_velocity(j).array().abs() > least).cast<double>();
  }
  return lost;
}

/// Per column, over the samples that the log is judged by, below the torque's cut-off.
Eigen::VectorXd squares(const Eigen::MatrixXd& torque, const ProcessedLog& log) {
  return log.filter_columns(torque).middleRows(log.first, log.last - log.first).colwise().squaredNorm();
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
  const Eigen::ArrayXXd sliding = replayed.sliding.middleRows(log.first, count).array();
  const Eigen::ArrayXXd off = (replayed.tau - said).middleRows(log.first, count).array().abs() * sliding;
  const auto samples = static_cast<double>(count);
  sum.samples += samples;
  sum.cannot_say += squares(full - written, log);
  sum.in_motion += squares(where_sliding(full - written, model, log), log);
  if (!meant.beside_load.empty())
    sum.without_load += squares(where_sliding(lost_without_load_friction(meant, model, log), model, log), log);
  for (Eigen::Index j = 0; j < full.cols(); ++j) {
    const auto i = static_cast<std::size_t>(j);
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
                                        : left_out(model, j, format.has_armature, format.has_stribeck, format.has_load,
                                                   format.has_dry_friction);
    if (format.friction_model != nullptr) joint.friction_model = format.friction_model(meant.joints[j]);
    if (meant.joints[j].load.model > 0)
      joint.cannot_say_without_load_friction = std::sqrt(sum.without_load[k] / sum.samples);
    joint.cannot_say_in_motion = std::sqrt(sum.in_motion[k] / sum.samples);
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
        {"cannot_say_in_motion", joint.cannot_say_in_motion},
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
    if (!joint.friction_model.empty()) entry["friction_model"] = joint.friction_model;
    if (joint.cannot_say_without_load_friction)
      entry["cannot_say_without_load_friction"] = *joint.cannot_say_without_load_friction;
    joints.push_back(std::move(entry));
  }
  return {{"schema", "fxdyn.certificate/1"},    {"format", certificate.format},
          {"file", certificate.file},           {"read_back_by", certificate.reader},
          {"role", certificate.role},           {"logs", certificate.logs},
          {"as_meant", certificate.as_meant()}, {"joints", joints}};
}

std::string certificate_table(const Certificate& certificate) {
  std::size_t width = 5;
  bool with_load = false, with_model = false;  // columns that only some formats and robots need
  for (const JointCertificate& joint : certificate.joints) {
    width = std::max(width, joint.name.size());
    with_load |= joint.cannot_say_without_load_friction.has_value();
    with_model |= !joint.friction_model.empty();
  }
  std::string out = fmt::format(
      "{}, read back by {}, over the {} logs: RMS of what it can't say, RMSE of the file and of the model\n",
      certificate.file, certificate.reader, certificate.role);
  const auto line = [&](const std::string& name, const std::array<std::string, 5>& numbers, const std::string& unit,
                        const std::string& friction, const std::string& effects) {
    const auto& [lost, in_motion, without_load, file, of_model] = numbers;
    out += fmt::format("  {:<{}}{:>12}{:>11}", name, width, lost, in_motion);
    if (with_load) out += fmt::format("{:>23}", without_load);
    out += fmt::format("{:>10}{:>10}  {:<5}", file, of_model, unit);
    if (with_model) out += fmt::format("{:<10}", friction);
    out += effects + "\n";
  };
  const auto number = [](double value) { return fmt::format("{:.4g}", value); };
  line("joint", {"can't say", "in motion", "without load friction", "file", "model"}, "", "friction",
       "effects left out");
  for (const JointCertificate& joint : certificate.joints) {
    line(joint.name,
         {number(joint.cannot_say), number(joint.cannot_say_in_motion),
          joint.cannot_say_without_load_friction ? number(*joint.cannot_say_without_load_friction) : "-",
          number(joint.file_rmse), number(joint.model_rmse)},
         joint.unit, joint.friction_model,
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

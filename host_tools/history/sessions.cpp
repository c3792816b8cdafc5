#include "host_tools/history/sessions.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::history {
namespace {

namespace fs = std::filesystem;
constexpr double seconds_a_day = 86400;
/// Time stamps above it count from 1970: a robot's own clock does not run for 30 years [s].
constexpr double since_1970_s = 1e9;

nlohmann::json parsed(const fs::path& file) {
  try {
    return nlohmann::json::parse(read_file(file));
  } catch (const nlohmann::json::exception&) {
    throw InputError(file.string() + ": is no whole JSON file: run the stage again");
  }
}

/// "ripple", and "ripple 2" for the second one at a joint.
std::string numbered(const std::string& effect, int count) {
  return count > 1 ? fmt::format("{} {}", effect, count) : effect;
}

void add_effects(Session& session, const Joint& joint, const JointFit& fit) {
  std::map<std::string, int> count;
  for (const EffectFit& effect : fit.effects) {
    const EffectInfo* info = find_effect(effect.effect);
    if (info == nullptr) continue;  // of a library that this program does not have
    const std::string name = numbered(effect.effect, ++count[effect.effect]);
    const auto add = [&](const auto& infos, const std::vector<double>& values, const std::vector<double>& stds) {
      for (std::size_t i = 0; i < values.size() && i < infos.size(); ++i) {
        const std::string unit(joint.type == JointType::revolute ? infos[i].unit : infos[i].unit_prismatic);
        session.values[{joint.name, fmt::format("{} {}", name, infos[i].name), unit}] = {0, values[i],
                                                                                         i < stds.size() ? stds[i] : 0};
      }
    };
    add(info->linear, effect.linear, effect.linear_std);
    if (effect.named) add(info->shape, effect.shape, effect.shape_std);
  }
}

void add_errors(Session& session, const IdentifiedModel& model, const MetricsResult& metrics) {
  Role judge = Role::train;
  for (const Role role : {Role::validate, Role::test}) {
    for (const LogErrors& log : metrics.logs) judge = log.role == role ? role : judge;
  }
  session.judged_on = to_string(judge);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const PooledError error = pooled_error(metrics.logs, judge, j);
    const Joint& joint = model.robot.joints[j];
    if (error.rms > 0) session.values[{joint.name, error_name, joint.torque_unit()}] = {0, error.rmse, 0};
  }
}

void add_found(Session& session, const DiagnosisResult& diagnosis) {
  for (const JointDiagnosis& joint : diagnosis.joints) {
    for (const NamedEffect& effect : joint.effects) {
      if (effect.established) session.effects.push_back(joint.joint + ": " + effect.effect);
    }
  }
  for (const NamedEffect& effect : diagnosis.robot_effects) {
    if (effect.established) session.effects.push_back("robot: " + effect.effect);
  }
}

std::optional<double> day_of(const fs::path& folder, const IdentifiedModel& model) {
  if (model.session && model.session->start_s > since_1970_s) return model.session->start_s / seconds_a_day;
  for (const LogReference& log : model.logs) {
    if (log.from_s > since_1970_s) return log.from_s / seconds_a_day;
  }
  if (const auto day = day_in(folder.filename().string())) return day;
  for (const LogReference& log : model.logs) {
    if (const auto day = day_in(fs::path(log.file).filename().string())) return day;
  }
  return {};
}

}  // namespace

std::optional<double> day_in(const std::string& text) {
  static const std::regex form(
      R"((^|[^0-9])((?:19|20)[0-9]{2})([-_]?)(0[1-9]|1[0-2])\3(0[1-9]|[12][0-9]|3[01])([^0-9]|$))");
  std::smatch found;
  if (!std::regex_search(text, found, form)) return {};
  const std::chrono::year_month_day date{std::chrono::year(std::stoi(found[2])),
                                         std::chrono::month(static_cast<unsigned>(std::stoi(found[4]))),
                                         std::chrono::day(static_cast<unsigned>(std::stoi(found[5])))};
  if (!date.ok()) return {};
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
}

std::string date_of(double day) {
  const std::chrono::sys_days days{std::chrono::days(static_cast<int>(std::floor(day)))};
  const std::chrono::year_month_day date(days);
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()));
}

Session read_session(const fs::path& folder, double good_enough) {
  for (const char* file : {"model.json", "metrics.json"}) {
    if (!fs::is_regular_file(folder / file))
      throw InputError(
          fmt::format("{}: there is no {} in it: name the folder of `fxdyn diagnose .. --out`", folder.string(), file));
  }
  const IdentifiedModel model = read_model(folder / "model.json");
  Session session;
  session.name = (folder.has_filename() ? folder : folder.parent_path()).filename().string();
  session.robot = model.robot.name;
  session.day = day_of(folder, model);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Joint& joint = model.robot.joints[j];
    session.joints.push_back(joint.name);
    session.good_error[joint.name] = good_enough * model.joints[j].rated_torque;
    add_effects(session, joint, model.joints[j]);
  }
  add_errors(session, model, metrics_of(parsed(folder / "metrics.json")));
  if (fs::exists(folder / "diagnosis.json")) add_found(session, diagnosis_of(parsed(folder / "diagnosis.json")));
  return session;
}

}  // namespace fxdyn::history

#include <algorithm>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/filter.hpp"
#include "tests/campaign/score.hpp"
#include "tests/campaign/truth.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::MatrixXd;

constexpr double smallest_gap = 5e-4;  ///< share of rated torque

/// The model's torque over a log that begins `age_s` after the session did: drift has run on until then.
MatrixXd torque_of(const IdentifiedModel& model, const Log& log, double age_s) {
  const MatrixXd torque = predict(model, log.q, log.dq, log.ddq, log.step_s, nullptr, age_s);
  if (model.filter.torque_lead_s == 0) return torque;
  return at_other_times(torque, model.filter.torque_lead_s / log.step_s);
}

}  // namespace

std::optional<double> true_closure(const nlohmann::json& truth, const fs::path& truth_folder,
                                   const fs::path& diagnosis_folder) {
  const fs::path exact = truth_folder / "exact";
  if (truth.at("effects").empty() || !fs::exists(exact)) return {};
  const auto is_large = [](const auto& effect) { return effect.at("share").template get<double>() >= smallest_gap; };
  if (std::none_of(truth.at("effects").begin(), truth.at("effects").end(), is_large)) return {};
  const IdentifiedModel before = read_model(diagnosis_folder / "nominal.json");
  const IdentifiedModel after = read_model(diagnosis_folder / "model.json");
  const auto rated = truth.at("rated_torque").get<std::vector<double>>();
  double power_before = 0, power_after = 0;
  for (const auto& entry : fs::directory_iterator(exact)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with(".truth.csv")) continue;
    const Log log = read_exact(exact / (name.substr(0, name.size() - 10) + ".csv"), before.robot);
    const MatrixXd torque = read_truth(entry.path(), before.robot.size());
    const double since_start = log.t[0] - truth.at("clock_s").get<double>();
    const MatrixXd error_before = torque_of(before, log, since_start) - torque;
    const MatrixXd error_after = torque_of(after, log, since_start) - torque;
    for (std::size_t joint = 0; joint < rated.size(); ++joint) {
      const auto j = static_cast<Index>(joint);
      power_before += error_before.col(j).squaredNorm() / std::pow(rated[joint], 2);
      power_after += error_after.col(j).squaredNorm() / std::pow(rated[joint], 2);
    }
  }
  if (power_before == 0) return {};  // nothing was missing
  return 1 - power_after / power_before;
}

}  // namespace fxdyn::campaign

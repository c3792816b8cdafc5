#include "host_tools/signals/planned_series.hpp"

#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

std::vector<double> list(const Eigen::VectorXd& values) { return {values.begin(), values.end()}; }

Eigen::VectorXd vector(const json& values) {
  const auto list = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
}

}  // namespace

json series_json(const FourierJoint& series) {
  return {{"centre", series.centre}, {"a", list(series.a)}, {"b", list(series.b)}};
}

std::vector<PlannedSeries> read_planned_series(const std::filesystem::path& file) {
  std::vector<PlannedSeries> out;
  try {
    const json plan = json::parse(read_file(file));
    for (const json& trajectory : plan.at("trajectories")) {
      PlannedSeries one{trajectory.at("name"), 0, {}};
      if (trajectory.contains("series")) one.period_s = trajectory.at("period_s");
      for (const json& joint : trajectory.value("series", json::array())) {
        one.joints.push_back({joint.at("centre"), vector(joint.at("a")), vector(joint.at("b"))});
        const FourierJoint& series = one.joints.back();
        if (series.a.size() == 0 || series.a.size() != series.b.size())
          throw InputError(file.string() + ": a and b of a series differ in length");
      }
      if (!one.joints.empty() && !(one.period_s > 0)) throw InputError(file.string() + ": a period_s is not above 0");
      out.push_back(std::move(one));
    }
  } catch (const json::exception&) {
    throw InputError(file.string() + " is no excite.json: make one by fxdyn excite");
  }
  return out;
}

}  // namespace fxdyn

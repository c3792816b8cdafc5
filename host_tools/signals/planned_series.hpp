#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/signals/fourier.hpp"

namespace fxdyn {

/// What excite.json says of the motion of one trajectory: the Fourier series of every joint.
struct PlannedSeries {
  std::string name;
  double period_s = 0;
  std::vector<FourierJoint> joints;  ///< none: the trajectory is a walk through poses
};

/// The keys "centre", "a" and "b" of one joint [rad | m].
nlohmann::json series_json(const FourierJoint& series);

/// All trajectories of an excite.json.
/// @throws InputError the file is no excite.json, or a and b of a series differ in length
std::vector<PlannedSeries> read_planned_series(const std::filesystem::path& file);

}  // namespace fxdyn

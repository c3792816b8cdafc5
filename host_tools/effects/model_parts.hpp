#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/effects/base_parameter.hpp"
#include "host_tools/effects/filter_fit.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/robot/robot.hpp"

// Parts of a model for those who need no more of it: another field of IdentifiedModel does not compile them again.

namespace fxdyn {

const Robot& robot_of(const IdentifiedModel& model);
const std::vector<JointFit>& joints_of(const IdentifiedModel& model);
const std::vector<EffectFit>& body_of(const IdentifiedModel& model);
const std::vector<BaseParameter>& base_of(const IdentifiedModel& model);
const std::vector<LinkInertia<Real>>& inertia_of(const IdentifiedModel& model);  ///< representative, DH frames
const FilterFit& filter_of(const IdentifiedModel& model);
const Formats& formats_of(const IdentifiedModel& model);      ///< of its exported tables, which it has to have
const std::string& project_of(const IdentifiedModel& model);  ///< its name
double tick_of(const IdentifiedModel& model);                 ///< [s]

// The same to be changed.
std::vector<JointFit>& joints_of(IdentifiedModel& model);
std::vector<EffectFit>& body_of(IdentifiedModel& model);
std::vector<BaseParameter>& base_of(IdentifiedModel& model);
FilterFit& filter_of(IdentifiedModel& model);
std::vector<LinkInertia<Real>>& inertia_of(IdentifiedModel& model);

/// The content of model.json.
nlohmann::json to_json(const IdentifiedModel& model);

}  // namespace fxdyn

#include "host_tools/diagnose/vanished.hpp"

#include <cmath>

#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {

bool is_at_nothing(const Linearised& problem, const Group& group, const EffectFit& fit) {
  constexpr double none = 1e-6;  // share of the rated torque
  const JointRows& rows = problem.solver().rows(group.candidate.joint);
  const Eigen::Index place = rows.place(group.first), count = std::max<Eigen::Index>(rows.x.rows(), 1);
  const auto linear = Eigen::Map<const Eigen::VectorXd>(fit.linear.data(), group.count);
  const double torque = (rows.x.middleCols(place, group.count) * linear).norm() / std::sqrt(static_cast<double>(count));
  return torque <= none * joints_of(problem.models().current)[group.candidate.joint].rated_torque;
}

std::optional<EffectId> vanished_finding(const Outcome& outcome, const IdentifiedModel& written) {
  for (const Finding& finding : outcome.found) {
    const EffectId& id = finding.id;
    if (id.body) continue;
    for (const Group& group : outcome.problem->groups()) {
      if (group.in_model && group.id == id &&
          is_at_nothing(*outcome.problem, group, joints_of(written)[id.joint].effects[id.effect]))
        return id;
    }
  }
  return {};
}

}  // namespace fxdyn::diagnosis

#include "host_tools/effects/parameter_values.hpp"

#include "host_tools/effects/effects.hpp"

namespace fxdyn {
namespace {

void add(std::span<const ParameterInfo> infos, const std::vector<double>& values, const std::vector<double>& stds,
         bool prismatic, std::vector<ParameterValue>& out) {
  for (std::size_t i = 0; i < infos.size(); ++i) {
    const ParameterInfo& info = infos[i];
    out.push_back({info.name, prismatic ? info.unit_prismatic : info.unit, values[i], {}});
    if (i < stds.size() && stds[i] > 0) out.back().std = stds[i];
  }
}

}  // namespace

std::vector<ParameterValue> parameter_values(const EffectFit& fit, const JointFit& joint, bool prismatic) {
  const EffectInfo* info = find_effect(fit.effect);
  std::vector<ParameterValue> out;
  add(info->shape, fit.shape, fit.shape_std, prismatic, out);
  add(info->linear, fit.linear, fit.linear_std, prismatic, out);
  if (info->has_sign_width) {
    out.push_back({"width", prismatic ? "m/s" : "rad/s", joint.sign_width, {}});
    if (joint.sign_width_std > 0) out.back().std = joint.sign_width_std;
  }
  return out;
}

}  // namespace fxdyn

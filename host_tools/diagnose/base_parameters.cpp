#include "host_tools/diagnose/base_parameters.hpp"

#include <algorithm>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

BaseSet base_set_of(const IdentifiedModel& model) {
  BaseSet base;
  for (const BaseParameter& parameter : base_of(model)) base.columns.push_back(static_cast<Index>(parameter.column));
  return base;
}

bool separates_rotor(std::string_view effect) { return find_effect(effect)->separates_rotor(); }

VectorXd hidden_rotor(const IdentifiedModel& model, std::size_t joint) {
  if (rotor_of(joints_of(model)[joint]) != nullptr) return {};
  return rotor_in_base(to_dh(robot_of(model)), base_set_of(model), static_cast<Index>(joint));
}

double least_inertia(const IdentifiedModel& model, std::size_t joint, const std::vector<const MatrixXd*>& logs) {
  constexpr Index poses = 200;
  const auto n = static_cast<Index>(joints_of(model).size());
  const auto j = static_cast<Index>(joint);
  Regressor regressor(to_dh(robot_of(model)));
  VectorXd values = VectorXd::Zero(n * static_cast<Index>(parameters_per_link));
  for (const BaseParameter& parameter : base_of(model)) values[static_cast<Index>(parameter.column)] = parameter.value;
  const VectorXd still = VectorXd::Zero(n), unit = VectorXd::Unit(n, j);
  double least = 1e300;
  for (const MatrixXd* q : logs) {
    for (Index k = 0; k < q->rows(); k += std::max<Index>(1, q->rows() / poses)) {
      const double with = regressor(q->row(k), still, unit).row(j) * values;
      least = std::min(least, with - regressor(q->row(k), still, still).row(j) * values);
    }
  }
  return least < 1e300 ? std::max(0.0, least) : 0;
}

void add_to_base(IdentifiedModel& model, std::size_t parameter, double step) {
  BaseParameter& base = base_of(model)[parameter];
  base.value += step;
  LinkInertia<Real>& link = inertia_of(model)[base.column / parameters_per_link];
  auto values = to_array(link);
  values[base.column % parameters_per_link] += step;
  link = to_inertia(values);
}

void take_from_base(IdentifiedModel& model, const VectorXd& rotor_in_base, double inertia) {
  for (std::size_t k = 0; k < base_of(model).size(); ++k)
    add_to_base(model, k, -inertia * rotor_in_base[static_cast<Index>(k)]);
}

}  // namespace fxdyn::diagnosis

#pragma once

#include <fmt/format.h>

#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/support/error.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {

/// Calls visit.operator()<Inputs, Activation>() with the types that a fit names: every set of inputs and every
/// activation of model/broad_learning.hpp stands here once.
/// @throws InputError: no such inputs or activation
template <class Visit>
void with_bls_types(const BroadLearningFit& fit, Visit&& visit) {
  bool found = false;
  const auto inputs = [&]<class Inputs>() {
    if (Inputs::name != fit.inputs) return;
    const auto activation = [&]<class Activation>() {
      if (Activation::name != fit.activation) return;
      found = true;
      visit.template operator()<Inputs, Activation>();
    };
    activation.template operator()<TanhNodes>();
    activation.template operator()<RampNodes>();
  };
  inputs.template operator()<PhysicalInputs>();
  inputs.template operator()<BristlesInputs>();
  inputs.template operator()<ExtendedInputs>();
  inputs.template operator()<StateInputs>();
  if (!found)
    throw InputError(fmt::format("a BLS with inputs \"{}\" and activation \"{}\": made by another version?", fit.inputs,
                                 fit.activation));
}

/// Number of inputs of the set that a fit names.
inline Eigen::Index bls_inputs(const BroadLearningFit& fit) {
  std::size_t count = 0;
  with_bls_types(fit, [&]<class Inputs, class>() { count = Inputs::size; });
  return static_cast<Eigen::Index>(count);
}

/// Of one evaluation; biases are added.
inline Eigen::Index multiplications(const BroadLearningFit& fit) {
  return fit.nodes() * (fit.input_count() + 1) + fit.input_count();
}

}  // namespace fxdyn

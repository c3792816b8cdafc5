#pragma once

#include <Eigen/Dense>
#include <string_view>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/regressor.hpp"

namespace fxdyn::diagnosis {

/// Rotor inertia hidden in the base parameters; effects of the link's load (load friction, a gear that bends) make it
/// observable. See name().
struct Rotor {
  std::size_t joint = 0;
  Eigen::VectorXd in_base;      ///< base parameters of a rotor of 1 kg m^2 (kg)
  double inertia = 0, std = 0;  ///< known beforehand, from a link encoder; std 0: it is not
  double most = 1e300;          ///< what it can be, of least_inertia() [kg m^2 | kg]
};

/// The base parameters of a model as a set of columns, without their grouping.
BaseSet base_set_of(const IdentifiedModel& model);

/// Whether an effect depends on the link's torque, in which the rotor has no part: it separates the two.
bool separates_rotor(std::string_view effect);

/// Base parameters of a rotor of 1 kg m^2 (kg) at a joint whose inertia contains one that no effect carries; else
/// empty.
Eigen::VectorXd hidden_rotor(const IdentifiedModel& model, std::size_t joint);

/// What of a joint's own inertia is the same in every pose, at most: the smallest element M_jj of the mass matrix along
/// positions (samples x joints each). A rotor has no more.
double least_inertia(const IdentifiedModel& model, std::size_t joint, const std::vector<const Eigen::MatrixXd*>& q);

/// Adds to a base parameter of a model and to the inertia that stands for it.
void add_to_base(IdentifiedModel& model, std::size_t parameter, double step);
/// Takes a rotor's inertia from the base parameters.
void take_from_base(IdentifiedModel& model, const Eigen::VectorXd& rotor_in_base, double inertia);

}  // namespace fxdyn::diagnosis

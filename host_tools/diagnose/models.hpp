#pragma once

#include <Eigen/Dense>
#include <string_view>
#include <utility>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/regression/regressor.hpp"

namespace fxdyn::diagnosis {

/// Rotor inertia hidden in the base parameters; effects of the link's load (load friction, a gear that bends) make it
/// observable. See name().
struct Rotor {
  std::size_t joint = 0;
  Eigen::VectorXd in_base;      ///< base parameters of a rotor of 1 kg m^2 (kg)
  double inertia = 0, std = 0;  ///< known beforehand, from a link encoder; std 0: it is not
};

/// Of a payload [kg], whose centre is first moment over mass.
inline constexpr double least_mass = 1e-6;

/// Two states of one robot: before (the baseline, a session known to be healthy) and now. Base parameters are the same;
/// friction may differ a little, named effects are in `current` only. Without a baseline `healthy` is not used.
struct Models {
  IdentifiedModel healthy, current;
  bool has_baseline = false;
  std::vector<EffectCandidate> fixed;   ///< from a link encoder: the torque does not change it
  std::vector<std::size_t> background;  ///< joints whose healthy session has structure that no effect explains
  std::vector<EffectCandidate> held;    ///< unnamed effects that stay what the healthy session's fit gave
  std::vector<Rotor> rotors;
  double smallest_step_s = 1;  ///< of all logs and of the drive's tick: what bounds a delay
  Options options;             ///< thresholds of all that is done with these models

  const IdentifiedModel& of(bool of_healthy) const { return of_healthy ? healthy : current; }
};

/// An effect of Models::current: of joints[joint].effects, or of body.
struct EffectId {
  bool body = false;
  std::size_t joint = 0, effect = 0;
  bool operator==(const EffectId&) const = default;
};

/// Bounds of a shape parameter, as far as these logs can show it: a delay is so many steps of the finest log, and what
/// happens within a step of the encoder does not show.
std::pair<double, double> shape_limits(const Models& models, std::size_t joint, const EffectInfo& info,
                                       const ParameterInfo& shape);

/// The base parameters of a model as a set of columns, without their grouping.
BaseSet base_of(const IdentifiedModel& model);

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

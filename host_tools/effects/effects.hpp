#pragma once

#include <Eigen/Dense>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "model/effect_traits.hpp"

namespace fxdyn {

/// What the host knows of an effect without its type: its entry in the catalogue, and what it declares of itself.
struct EffectInfo : EffectTraits {
  std::string_view name, equation;
  std::span<const ParameterInfo> shape, linear;
  ActsOn acts_on;
  bool needs_structural, needs_total, needs_peers;
  bool uses_sign;     ///< its phi depends on the joint's sign width
  bool has_constant;  ///< one of its phi is 1
  bool remembers;     ///< it has a state: its phi depend on the motion before
  /// Bends under the load: acts on the position and needs the rigid-body torque.
  bool bends() const { return acts_on == ActsOn::position && needs_structural; }
  /// Separates a rotor from the base parameters: it follows the load without the rotor's own inertia.
  bool separates_rotor() const { return needs_structural; }
  /// Its wavenumber comes from a spectrum.
  bool of_spectrum() const { return !shape.empty() && shape[0].values.search == ShapeSearch::spectrum; }
  /// The shape parameters that are refined continuously, and the first of them; -1: none.
  std::vector<std::size_t> refined_shapes() const;
  int refined_shape() const;
};

/// All effects, those on the body last.
const std::vector<EffectInfo>& effect_infos();
/// nullptr where there is no such effect.
const EffectInfo* find_effect(std::string_view name);
/// Names of all effects, and of those of the Catalogue only (all but those on the body).
std::vector<std::string_view> effect_names();
std::vector<std::string_view> joint_effect_names();

/// Names of those that every joint has, and of those that `identify` adds by itself, in its order.
const std::vector<std::string>& nominal_effects();
std::vector<std::string_view> identified_effects();
/// The nominal effects and then these.
std::vector<std::string> nominal_effects_and(std::initializer_list<std::string_view> others);

/// The motion that separates two effects: the first that both name, empty if there is none.
std::string_view telling_experiment(const EffectTraits& a, const EffectTraits& b);

/// What effects are confused with beside each other.
inline constexpr std::string_view base_parameters_name = "base parameters";

/// Which experiment would separate two effects, or an effect from `base_parameters_name`: from their traits alone.
std::string cure(std::string_view e, std::string_view f);

/// Whether base parameters may hold this effect of the joint, or it drifts.
bool in_base(std::string_view effect);
bool drifts(std::string_view effect);

/// The joint's rotor where the model has one beside the base parameters, else null.
const EffectFit* rotor_of(const JointFit& joint);

/// The largest value of a shape parameter where the effect steps every `step_s`.
double upper_bound(const EffectInfo& info, const ParameterInfo& shape, double step_s);

/// All combinations of the values of each shape parameter, the first parameter's changing fastest; {{}} without any.
std::vector<std::vector<double>> combinations(const std::vector<std::vector<double>>& values);

/// Why identify can't fit the effect yet; empty if it can.
std::string why_not_identified(const EffectInfo& info);

/// One joint's inputs over a log, as columns. What is empty is not known; effects that need it are refused.
struct JointSeries {
  Eigen::VectorXd q, dq, ddq, structural;
  double step_s = 0;
  Eigen::VectorXd total{};
  Eigen::MatrixXd peers_dq{}, peers_sign{}, peers_ddq{}, peers_q{};  ///< samples x joints of the robot
  Eigen::VectorXd sign{};  ///< tanh(dq / sign_width) where it is known; empty: it is computed
};

/// phi of a catalogue effect over a log: samples x linear parameters. States start at rest with the log.
/// @throws InputError: no such effect, or the series lacks what it needs.
Eigen::MatrixXd effect_columns(std::string_view effect, std::span<const double> shape, double sign_width,
                               const JointSeries& series);

}  // namespace fxdyn

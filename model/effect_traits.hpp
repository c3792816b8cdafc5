#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>

#include "model/quantity.hpp"

// What an effect declares of itself beside its formula. Only the host reads it: no image of a firmware holds any of it.

namespace fxdyn {

/// How a joint moves: what decides which shapes are worth a try. SI, [rad | m] by the joint's type.
struct MotionScales {
  double speed = 0;            ///< largest |dq| [rad/s | m/s]
  double range = 0;            ///< of q [rad | m]
  double torque = 0;           ///< largest of the model [N*m | N]
  double structural = 0;       ///< largest rigid-body torque [N*m | N]
  double seconds = 0;          ///< the session's length [s]
  double sign_width = 0;       ///< of s = tanh(dq / width) [rad/s | m/s]
  bool turns = true;           ///< revolute, else prismatic
  unsigned joint = 0;          ///< index from 0
  unsigned joints = 1;         ///< of the robot
  bool like_previous = false;  ///< the joint before is of the same type: the two may share a gear
  bool like_next = false;      ///< likewise the joint after
  double upper = 0;            ///< largest value that the parameter may have here
  double lowest = 0;           ///< q [rad | m]
};

/// A few values of one parameter.
class ValueList {
 public:
  constexpr ValueList() = default;
  constexpr ValueList(std::initializer_list<double> values) {
    for (const double value : values) add(value);
  }
  constexpr void add(double value) { values_[size_++] = value; }
  constexpr const double* begin() const { return values_.data(); }
  constexpr const double* end() const { return values_.data() + size_; }
  constexpr std::size_t size() const { return size_; }
  constexpr double operator[](std::size_t i) const { return values_[i]; }

 private:
  std::array<double, 32> values_{};  // as many as a robot may have joints
  std::size_t size_ = 0;
};

/// An interval of one parameter.
struct ShapeRange {
  double from = 0, to = 0;
};

/// How the best value of a shape parameter is found.
enum class ShapeSearch : std::uint8_t {
  refine,    ///< from the best of the values tried, continuously
  list,      ///< one of the values tried
  spectrum,  ///< a wavenumber n whose phi are cos(n q) and sin(n q): from the residual's spectrum over the position
};

/// A function of the scales, or none. Whether there is one is known at compile time: comparing its address with null is
/// not, where sanitizers look at addresses.
template <class Result>
class OfScales {
 public:
  constexpr OfScales() = default;
  template <class F>
  requires std::convertible_to<F, Result (*)(const MotionScales&)>
  constexpr OfScales(F function) : call_(function), given_(true) {}
  constexpr bool given() const { return given_; }
  Result operator()(const MotionScales& scales) const { return call_(scales); }

 private:
  Result (*call_)(const MotionScales&) = nullptr;
  bool given_ = false;
};

/// Which values of a shape parameter to try. model/shapes.hpp has the usual ones.
struct ShapeValues {
  OfScales<ValueList> tried{};    ///< by `diagnose`; not for ShapeSearch::spectrum
  OfScales<ValueList> judged{};   ///< by `excite`, the typical one first
  OfScales<ShapeRange> fitted{};  ///< where `identify` begins its search; none: it can't fit the effect
  ShapeSearch search = ShapeSearch::refine;
  bool seen_by_encoder = false;  ///< a path: what is shorter than the encoder's step does not show
  double least_of_sign = 0;      ///< a velocity: at least so many widths of the joint's sign; 0: any
  double most_of_load = 0;       ///< a load: at most this share of the joint's largest structural torque; 0: any
  /// For deflections that a link encoder shows: where the fit begins, then what it tries.
  OfScales<ValueList> of_link{};

  constexpr bool declared() const { return judged.given() && (tried.given() || search == ShapeSearch::spectrum); }
};

/// One parameter of an effect, as the user sees it (SI, joint side of the gearbox).
struct ParameterInfo {
  std::string_view name;
  std::string_view unit;            ///< revolute joint
  std::string_view unit_prismatic;  ///< prismatic joint
  double lower, upper;              ///< bounds that scenarios and all fits keep, the last ones too
  /// Linear parameter: the quantity of its phi. Shape: the quantity that the tables store (see stored_shape()).
  Quantity quantity;
  std::string_view source;
  ShapeValues values{};  ///< of a shape parameter; has to be declared
};

inline constexpr double unbounded = 1e30;

/// What sum(theta phi) of an effect is.
enum class ActsOn : std::uint8_t {
  torque,    ///< added to the joint's torque
  position,  ///< deflection delta between motor and link: the rigid body moves at q - delta
  body,      ///< no sum: changes the parameters of the rigid body (BodyEffects in catalogue.hpp)
};

/// What an effect with `needs_total` does with the total, so that it can be taken back.
enum class OfTotal : std::uint8_t {
  nothing,
  scales,  ///< total * (1 + theta)
  delays,  ///< total(t - shape): at most `most_ticks` ticks
  clips,   ///< total within +-shape
};

/// How friction turns with the velocity's sign: what an uncertain velocity near standstill makes of it.
enum class TurnsWithSign : std::uint8_t {
  no,
  amplitude,  ///< theta s: by 2 theta
  load,       ///< theta |load| s: by 2 theta |load|
};

/// When an effect of friction brakes, as friction has to: some parameters would make it drive the joint.
struct Braking {
  unsigned coefficient = 0;  ///< of its linear parameters: the one that may be too large
  /// Speed at which it is asked [rad/s | m/s]: of the shape parameters and the joint's limit (0: not known).
  double (*speed)(const double* shape, double limit) = nullptr;
  /// Largest value of the coefficient that still brakes at that speed: of the shape parameters, the first linear
  /// parameter and the joint's viscous friction [N*m*s/rad | N*s/m].
  double (*most)(const double* shape, double speed, double first, double viscous) = nullptr;
  bool given = false;
};

/// A motion that shows effects and tells those apart that name it. Of several in common the one of lowest order counts.
struct NamedExperiment {
  unsigned order = 0;
  std::string_view text{};
};

namespace experiments {
inline constexpr NamedExperiment hopeless{1, "nothing: base parameters hold the rotor, and the torque is the same"};
inline constexpr NamedExperiment slow_reversals{2, "slow motion through zero velocity, both ways"};
inline constexpr NamedExperiment wide_range{3, "a wider range of positions"};
inline constexpr NamedExperiment wide_range_or_baseline{4, "a wider range of positions, or a baseline"};
inline constexpr NamedExperiment loaded_poses{
    5, "poses in which the joint carries load, moved slowly with and against gravity"};
inline constexpr NamedExperiment constant_speeds{6, "constant speeds from slow to the limit"};
inline constexpr NamedExperiment warm_robot{7, "the first motion once more at the end, after the robot warmed up"};
inline constexpr NamedExperiment load_reversals{8, "motion in which the load reverses; an encoder on the link"};
inline constexpr NamedExperiment small_reversals{9, "slow reversals of a few milliradians, and of a few degrees"};
inline constexpr NamedExperiment fast_motion{10, "faster motion beside the slow one; an encoder on the link"};
inline constexpr NamedExperiment one_at_a_time{11, "joints moved one at a time"};
inline constexpr NamedExperiment all_poses{12, "other positions, speeds and loads in other combinations"};
}  // namespace experiments

/// What every effect declares as `static constexpr EffectTraits traits`. `words` and `experiments` have to be there;
/// the rest where it differs from the usual: a torque that diagnosis may find once at a joint.
struct EffectTraits {
  std::string_view words;  ///< what it is, in a few plain words
  /// What shows it, the best first. Effects that name the same one are confused with each other until it is done.
  std::array<NamedExperiment, 6> experiments{};

  bool nominal = false;         ///< every joint has it: diagnosis starts with it
  bool friction = false;        ///< differs from day to day as friction does
  bool several = false;         ///< a joint may have more than one
  bool needs_revolute = false;  ///< a function of an angle
  /// A change since the baseline is one more of it.
  bool changes_by_one_more = false;
  /// Of inertia that base parameters may hold: then it can't be told from them.
  bool in_base = false;
  bool has_sign_width = false;  ///< the joint's sign width is reported with it
  /// Like masses about the joint's axis: a turned gravity shows those of an upright first joint, where no name is due.
  bool as_masses_about_axis = false;
  bool share = false;       ///< its only coefficient is 1 by definition
  bool curve = false;       ///< of what has no name: fitted where all names are done, not one of them
  unsigned identified = 0;  ///< place among the effects that `identify` adds by itself; 0: it does not
  double shortest_session_s = 0;
  std::uint32_t most_ticks = 0;  ///< a time shape is at most so many ticks; 0: any
  OfTotal of_total = OfTotal::nothing;
  TurnsWithSign turns_with_sign = TurnsWithSign::no;
  Braking brakes{};
  /// Takes the place of this effect: its first coefficient is about as large.
  std::string_view replaces{};
  /// One law for these effects together: it is tried where one of them was found, and takes their place if it explains
  /// more. Shape parameters of the same name begin where theirs are.
  std::array<std::string_view, 2> unites{};
  /// It grows with time alone, from nothing to these effects together, by the share warmth(seconds, shape).
  std::array<std::string_view, 2> warms_into{};

  constexpr bool drifts() const { return !warms_into[0].empty(); }
  /// A name that diagnosis tries by itself.
  constexpr bool sought() const { return !nominal && !unites_others() && !curve; }
  constexpr bool unites_others() const { return !unites[0].empty(); }
  constexpr bool named_experiment(const NamedExperiment& experiment) const {
    for (const NamedExperiment& own : experiments) {
      if (own.order == experiment.order && own.text == experiment.text) return !own.text.empty();
    }
    return false;
  }
};

}  // namespace fxdyn

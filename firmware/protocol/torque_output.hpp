#pragma once

#include <cstdint>

namespace fxdyn {

/// How far a torque may move in one tick, in raw units.
struct TorqueSteps {
  std::int32_t ramp = 0;       ///< to zero, and from there back to the model's torque
  std::int32_t following = 0;  ///< while it is the model's torque
};

/// One joint's torque as it goes out: the model's, or on its way to zero or back. No step is larger than TorqueSteps
/// say.
class TorqueOutput {
 public:
  std::int32_t value() const { return value_; }
  bool is_following() const { return following_; }

  /// One tick towards the model's torque; true where the step was cut.
  bool follow(std::int32_t model, const TorqueSteps& steps) {
    const bool cut = !move(model, following_ ? steps.following : smaller(steps));
    if (!cut) following_ = true;
    return cut && following_;
  }
  /// One tick towards zero.
  void release(const TorqueSteps& steps) {
    following_ = false;
    static_cast<void>(move(0, smaller(steps)));
  }

 private:
  static std::int32_t smaller(const TorqueSteps& steps) {
    return steps.ramp < steps.following ? steps.ramp : steps.following;
  }
  /// True where the target is reached.
  bool move(std::int32_t target, std::int32_t most) {
    const std::int64_t difference = std::int64_t{target} - value_;
    const bool up = difference > most, down = difference < -std::int64_t{most};
    value_ = up ? value_ + most : (down ? value_ - most : target);
    return !up && !down;
  }

  std::int32_t value_ = 0;
  bool following_ = false;
};

}  // namespace fxdyn

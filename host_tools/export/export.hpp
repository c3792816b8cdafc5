#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// States of a log at the drive's ticks (linear interpolation of the filtered motion).
struct TickStates : MotionRows {
  std::string name;
  Eigen::VectorXd t;  ///< [s]

  TickStates() = default;
  TickStates(std::string named, Eigen::VectorXd times, Eigen::MatrixXd position, Eigen::MatrixXd velocity,
             Eigen::MatrixXd acceleration)
      : MotionRows{std::move(position), std::move(velocity), std::move(acceleration)},
        name(std::move(named)),
        t(std::move(times)) {}
};
/// `whole`: with the edges that the filters disturb, which figures leave out.
TickStates at_ticks(const ProcessedLog& log, double tick_s, bool whole = false);

/// Seeded disturbance of every state: noise of 1 % of the limits, and now and then a value far beyond them.
TickStates perturbed(const TickStates& states, const IdentifiedModel& model, std::uint64_t seed);

/// Seeded states within the joint limits: random positions, velocities and accelerations at their limits every other
/// time, now and then one joint that creeps.
TickStates within_limits(const IdentifiedModel& model, Eigen::Index count, std::uint64_t seed);

/// What bounds of effect states are about (creeping_ticks in numbers/bounded.hpp): a reversal at half speed, then every
/// joint creeps at the smallest velocity of its format.
TickStates creeping(const IdentifiedModel& model, const Formats& formats);

/// The same states as raw words of the wire: q1 dq1 ddq1 q2 .. per tick.
std::vector<std::int32_t> raw_states(const TickStates& states, Eigen::Index tick, const Formats& formats);

/// The model in the fixed point of the firmware.
class FixedModel {
 public:
  /// @param outputs bit i: the drive puts out the torque of joint i+1
  FixedModel(const IdentifiedModel& model, const Formats& formats, std::uint32_t outputs);
  FixedModel(const IdentifiedModel& model, const Formats& formats) : FixedModel(model, formats, all_joints(model)) {}
  const Formats& formats() const { return formats_; }
  /// Indices of the joints whose torques tick() gives.
  const std::vector<std::size_t>& outputs() const { return output_joints_; }
  void reset() { evaluator_.reset(); }
  /// Evaluator::warm_up(); call it before the first tick.
  void warm_up(double seconds);
  /// One tick: raw states in (see raw_states), raw torques out.
  std::vector<std::int32_t> tick(const std::vector<std::int32_t>& states, Saturations& saturations);
  /// The parameter words of the tables, and the layout that they have.
  std::vector<std::int32_t> words() const;
  std::uint32_t layout_hash() const;
  std::uint32_t crc() const;

 private:
  Formats formats_;
  std::shared_ptr<const IdentifiedModel> model_;
  std::uint32_t outputs_;
  std::vector<std::size_t> output_joints_;
  Evaluator<RunTimeNumbers> evaluator_;
};

/// Chooses the formats from ranges that interval arithmetic proves over the joint limits (proof.hpp), so that no
/// narrowing overflows; 64-bit sums are bounded by the sum of the magnitudes of their terms.
/// @throws DataError where the joints' parameters are too far apart in size for common sums.
Formats choose_formats(const IdentifiedModel& model);

/// Whether these formats hold every number of the model, by the same rules.
bool formats_hold(const IdentifiedModel& model, const Formats& formats);

/// The layout of the model's tables: its own where it has one, else as the values say.
TableLayout layout_of(const IdentifiedModel& model, const Formats& formats);

/// Why the model's values do not fit tables of these formats and the model's layout; empty: firmware that was built for
/// them takes these values.
std::string why_not_in_layout(const IdentifiedModel& model, const Formats& formats);

/// |fixed - double| of each joint over the states [N*m | N], both fed with the same quantised states.
struct QuantisationError {
  Eigen::VectorXd largest, rms;
  /// The largest while no saturation is counted, nor in the two ticks before: what Proof::error bounds.
  Eigen::VectorXd uncounted;
  std::uint32_t saturations = 0;
};
QuantisationError quantisation_error(const IdentifiedModel& model, const Formats& formats,
                                     const std::vector<TickStates>& states);

/// Torques of the fixed-point model over a log at its own states, samples x joints [N*m | N].
/// @param age_s how long the robot has run when they begin, see age_of() [s]
Eigen::MatrixXd predict_fixed(const IdentifiedModel& model, const Formats& formats, const TickStates& states,
                              double age_s = 0);

/// Writes tables.hpp and tables.bin for a drive that puts out the torques of the joints in `outputs` (bit i: joint
/// i+1); returns the CRC-32 of the parameters. `proven`: bound of |fixed - double| of each joint.
std::uint32_t write_tables(const IdentifiedModel& model, const Formats& formats, const QuantisationError& error,
                           const Eigen::VectorXd& proven, std::uint32_t outputs,
                           const std::filesystem::path& directory);

}  // namespace fxdyn

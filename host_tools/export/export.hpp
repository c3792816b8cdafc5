#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "host_tools/identify/dataset.hpp"
#include "host_tools/model/evaluator.hpp"

namespace fxdyn {

/// States of a log at the drive's ticks (linear interpolation of the filtered motion), samples x joints.
struct TickStates {
  std::string name;
  Eigen::VectorXd t;
  Eigen::MatrixXd q, dq, ddq;
};
/// `whole`: with the edges that the filters disturb, which figures leave out.
TickStates at_ticks(const ProcessedLog& log, double tick_s, bool whole = false);

/// Seeded disturbance of every state: noise of 1 % of the limits, and now and then a value far beyond them.
TickStates perturbed(const TickStates& states, const IdentifiedModel& model, std::uint64_t seed);

/// The same states as raw words of the wire: q1 dq1 ddq1 q2 .. per tick.
std::vector<std::int32_t> raw_states(const TickStates& states, Eigen::Index tick, const Formats& formats);

/// The model in the fixed point of the firmware.
class FixedModel {
 public:
  FixedModel(const IdentifiedModel& model, const Formats& formats);
  const Formats& formats() const { return formats_; }
  void reset() { evaluator_.reset(); }
  /// One tick: raw states in (see raw_states), raw torques out.
  std::vector<std::int32_t> tick(const std::vector<std::int32_t>& states, Saturations& saturations);
  /// The parameter words of the tables, and the layout that they have.
  std::vector<std::int32_t> words() const;
  std::uint32_t layout_hash() const;

 private:
  Formats formats_;
  const IdentifiedModel model_;
  Evaluator<RunTimeNumbers> evaluator_;
};

/// Chooses the formats: ranges observed when the model runs over the given states and over 4000 random states within
/// the joint limits, with a factor of two in reserve; 64-bit sums bounded by the sum of the magnitudes of their terms.
/// Not a proof: whatever exceeds a number's format saturates and is counted.
/// @throws DataError where the joints' parameters are too far apart in size for common sums.
Formats choose_formats(const IdentifiedModel& model, const std::vector<TickStates>& states);

/// |fixed - double| of each joint over the states [N*m | N], both fed with the same quantised states.
struct QuantisationError {
  Eigen::VectorXd largest, rms;
  std::uint32_t saturations = 0;
};
QuantisationError quantisation_error(const IdentifiedModel& model, const Formats& formats,
                                     const std::vector<TickStates>& states);

/// Torques of the fixed-point model over a log at its own states, samples x joints [N*m | N].
Eigen::MatrixXd predict_fixed(const IdentifiedModel& model, const Formats& formats, const TickStates& states);

/// Writes tables.hpp and tables.bin; returns the CRC-32 of the parameters.
std::uint32_t write_tables(const IdentifiedModel& model, const Formats& formats, const QuantisationError& error,
                           const std::filesystem::path& directory);

}  // namespace fxdyn

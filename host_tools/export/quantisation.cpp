#include <algorithm>
#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/export/export.hpp"

namespace fxdyn {
namespace {

/// Ticks that a deflection's second difference reaches back.
constexpr int differences = 2;

}  // namespace

QuantisationError quantisation_error(const IdentifiedModel& model, const Formats& formats,
                                     const std::vector<TickStates>& states) {
  FixedModel fixed(model, formats);
  Evaluator<Real> exact(with_stored_limits(model, formats), tick_of(model));
  const auto n = static_cast<Eigen::Index>(robot_of(model).size());
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(n);
  QuantisationError out{none, none, none};
  std::vector<JointState<Real>> state(robot_of(model).size());
  Eigen::Index count = 0;
  Saturations saturations, ignored;
  for (const TickStates& log : states) {
    fixed.reset();
    exact.reset();
    int spoilt = 0;  // ticks whose differences still hold what was saturated
    for (Eigen::Index k = 0; k < log.t.size(); ++k, ++count) {
      const std::vector<std::int32_t> raw = raw_states(log, k, formats);
      for (std::size_t j = 0; j < state.size(); ++j) {
        state[j] = {from_raw(raw[3 * j], formats[Quantity::position]),
                    from_raw(raw[3 * j + 1], formats[Quantity::velocity]),
                    from_raw(raw[3 * j + 2], formats[Quantity::acceleration])};
      }
      const std::uint32_t before = saturations.count;
      const std::vector<std::int32_t> torques = fixed.tick(raw, saturations);
      spoilt = saturations.count != before ? differences + 1 : std::max(0, spoilt - 1);
      const auto reference = exact.tick(state, ignored);
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto i = static_cast<std::size_t>(j);
        const double error = std::fabs(from_raw(torques[i], formats[Quantity::torque]) - reference[i]);
        out.largest[j] = std::max(out.largest[j], error);
        if (spoilt == 0) out.uncounted[j] = std::max(out.uncounted[j], error);
        out.rms[j] += error * error;
      }
    }
  }
  out.rms = (out.rms / static_cast<double>(std::max<Eigen::Index>(1, count))).cwiseSqrt();
  out.saturations = saturations.count;
  return out;
}

Eigen::MatrixXd predict_fixed(const IdentifiedModel& model, const Formats& formats, const TickStates& states,
                              double age_s) {
  FixedModel fixed(model, formats);
  if (age_s > 0) fixed.warm_up(age_s);
  Eigen::MatrixXd out(states.q.rows(), states.q.cols());
  Saturations ignored;
  for (Eigen::Index k = 0; k < out.rows(); ++k) {
    const std::vector<std::int32_t> torques = fixed.tick(raw_states(states, k, formats), ignored);
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out(k, j) = from_raw(torques[static_cast<std::size_t>(j)], formats[Quantity::torque]);
  }
  return out;
}

}  // namespace fxdyn

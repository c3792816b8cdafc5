#include "host_tools/identify/flexible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/sandwich.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

constexpr double most_relaxation_s = 0.1;  ///< a bound of the fit, beyond what any gear has

/// Least squares with the covariance of a residual that is correlated within blocks ("sandwich").
struct LeastSquares {
  Eigen::MatrixXd x;
  Eigen::VectorXd theta, residual;
  Eigen::MatrixXd covariance;
  double power = 0;  ///< of the residual, mean square
};

LeastSquares least_squares(Eigen::MatrixXd x, const Eigen::VectorXd& y, const std::vector<Eigen::Index>& ends) {
  const Eigen::VectorXd scale = x.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd unit = x * scale.asDiagonal();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(unit);
  LeastSquares out;
  out.theta = scale.cwiseProduct(qr.solve(y));
  out.residual = y - x * out.theta;
  out.power = out.residual.squaredNorm() / static_cast<double>(y.size());
  const Eigen::MatrixXd inverse = (unit.transpose() * unit).completeOrthogonalDecomposition().pseudoInverse();
  out.covariance =
      scale.asDiagonal() * sandwich(inverse, middle_of_blocks(unit, out.residual, ends)) * scale.asDiagonal();
  out.x = std::move(x);
  return out;
}

/// One joint's data over all logs that have its link encoder: columns at the rows of the fit. What is linear is
/// filtered once; the gear's low-pass commutes with the filter.
class JointData {
 public:
  JointData(const FlexibleInput& input, const std::vector<MotionRows>& motions,
            const std::vector<Eigen::MatrixXd>& loads, Eigen::Index joint, double block_s)
      : joint_(joint), sign_width_(joints_of(input.model)[static_cast<std::size_t>(joint)].sign_width) {
    std::vector<Eigen::VectorXd> deltas;
    for (std::size_t l = 0; l < input.logs.size(); ++l) {
      const ProcessedLog& log = input.logs[l];
      if (!log.has_link[static_cast<std::size_t>(joint)]) continue;
      logs_.push_back(&log);
      motions_.push_back(&motions[l]);
      MotionRows motor = log.joint_motion(joint);
      series_.push_back(
          {std::move(motor.q), std::move(motor.dq), std::move(motor.ddq), loads[l].col(joint), log.step_s});
      filtered_load_.emplace_back(log.filter_columns(loads[l].col(joint)));
      filtered_ddq_.emplace_back(log.filter_columns(motions[l].ddq.col(joint)));
      deltas.emplace_back(log.filter_columns(log.q.col(joint) - log.qlink.col(joint)));
      const double rows_a_second = 1 / (log.step_s * static_cast<double>(log.decimation));
      const auto block = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(block_s * rows_a_second));
      for (Eigen::Index row = 0; row < log.rows(); row += block)
        block_ends_.push_back(rows_ + std::min(row + block, log.rows()));
      rows_ += log.rows();
    }
    if (rows_ > 0) deflection_ = stack([&](std::size_t l) { return deltas[l]; });
  }
  bool empty() const { return rows_ == 0; }
  double step_s() const { return logs_[0]->step_s; }
  const std::vector<Eigen::Index>& block_ends() const { return block_ends_; }
  const Eigen::VectorXd& deflection() const { return deflection_; }

  /// The rigid body's torque behind the gear's low-pass.
  Eigen::MatrixXd load(double relaxation) const { return low_pass(filtered_load_, relaxation); }
  /// The same of the link's acceleration: what a rotor weighs that was counted as link.
  Eigen::MatrixXd acceleration(double relaxation) const { return low_pass(filtered_ddq_, relaxation); }
  /// phi of an effect on the position.
  Eigen::MatrixXd effect(std::string_view name, const std::vector<double>& shape) const {
    return stack(
        [&](std::size_t l) { return logs_[l]->filter_columns(effect_columns(name, shape, sign_width_, series_[l])); });
  }
  /// What the base parameters' standard deviations make of the coefficients, as a covariance: each of them moves the
  /// load, and so the fit. Their correlations are not known here.
  Eigen::MatrixXd from_load(const LeastSquares& fit, const IdentifiedModel& model, Regressor regressor) const {
    const auto count = static_cast<Eigen::Index>(base_of(model).size());
    // A model that was not identified (a simulated plant) has no deviations.
    if (count == 0) return Eigen::MatrixXd::Zero(fit.x.cols(), fit.x.cols());
    Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(fit.x.cols(), count);
    Eigen::RowVectorXd load(count);
    Eigen::Index row = 0;
    for (std::size_t l = 0; l < logs_.size(); ++l) {
      const ProcessedLog& log = *logs_[l];
      const MotionRows& m = *motions_[l];
      for (Eigen::Index i = 0; i < log.rows(); ++i, ++row) {
        const Eigen::Index k = log.first + i * log.decimation;
        const Eigen::MatrixXd& y = regressor(m.q.row(k), m.dq.row(k), m.ddq.row(k));
        for (Eigen::Index b = 0; b < count; ++b) {
          const BaseParameter& parameter = base_of(model)[static_cast<std::size_t>(b)];
          load[b] = parameter.std * y(joint_, static_cast<Eigen::Index>(parameter.column));
        }
        moved += fit.x.row(row).transpose() * load;
      }
    }
    const Eigen::VectorXd scale = fit.x.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    const Eigen::MatrixXd gram = scale.asDiagonal() * (fit.x.transpose() * fit.x) * scale.asDiagonal();
    const Eigen::MatrixXd change =
        fit.theta[0] * (scale.asDiagonal() * gram.completeOrthogonalDecomposition().solve(scale.asDiagonal() * moved));
    return change * change.transpose();
  }
  double largest_load() const {
    double most = 0;
    for (const JointSeries& series : series_) most = std::max(most, series.structural.cwiseAbs().maxCoeff());
    return most;
  }

 private:
  template <class Make>
  Eigen::MatrixXd stack(Make&& make) const {
    Eigen::MatrixXd out;
    Eigen::Index at = 0;
    for (std::size_t l = 0; l < logs_.size(); ++l) {
      const Eigen::MatrixXd part = logs_[l]->decimate(make(l));
      if (l == 0) out.resize(rows_, part.cols());
      out.middleRows(at, part.rows()) = part;
      at += part.rows();
    }
    return out;
  }
  Eigen::MatrixXd low_pass(const std::vector<Eigen::VectorXd>& columns, double relaxation) const {
    return stack([&](std::size_t l) {
      JointSeries series = series_[l];
      series.structural = columns[l];
      return effect_columns(compliance_effect().name, std::array{relaxation}, sign_width_, series);
    });
  }

  Eigen::Index joint_;
  double sign_width_;
  std::vector<const ProcessedLog*> logs_;
  std::vector<const MotionRows*> motions_;
  std::vector<JointSeries> series_;
  std::vector<Eigen::VectorXd> filtered_load_, filtered_ddq_;
  std::vector<Eigen::Index> block_ends_;
  Eigen::Index rows_ = 0;
  Eigen::VectorXd deflection_;
};

/// delta = compliance (load - rotor acceleration), both behind the low-pass, + constant + other causes.
struct GearFit {
  double compliance = 0, relaxation = 0, rotor = 0;
  LeastSquares least_squares;  ///< columns: load, d(model)/d(relaxation) / compliance, acceleration?, constant, others
};

/// Gauss and Newton in the relaxation, everything else linear; from a fit that is near, one round will do.
GearFit fit_gear(const JointData& data, bool with_rotor, const Eigen::MatrixXd& others, GearFit fit = {},
                 int rounds = 15) {
  // A load that lags by less than nothing is noise; a little of it is let through, so that the mean is right.
  const double step = data.step_s(), lowest = -0.4 * step, probe = 0.05 * step;
  const Eigen::Index rows = data.deflection().size();
  const auto step_of = [&](const Eigen::VectorXd& relaxation, int) -> std::optional<Eigen::VectorXd> {
    const double r = relaxation[0];
    Eigen::MatrixXd slope = (data.load(r + probe) - data.load(r - probe)) / (2 * probe);
    Eigen::MatrixXd x(rows, 2 + (with_rotor ? 1 : 0) + 1 + others.cols());
    x.col(0) = data.load(r);
    if (with_rotor) {
      slope -= fit.rotor * (data.acceleration(r + probe) - data.acceleration(r - probe)) / (2 * probe);
      x.col(2) = data.acceleration(r);
    }
    x.col(1) = slope;
    x.rightCols(1 + others.cols()) << Eigen::VectorXd::Ones(rows), others;
    fit.least_squares = least_squares(x, data.deflection(), data.block_ends());
    const Eigen::VectorXd& theta = fit.least_squares.theta;
    fit.compliance = theta[0];
    if (fit.compliance == 0) return {};  // no load at all
    if (with_rotor) fit.rotor = -theta[2] / theta[0];
    return Eigen::VectorXd::Constant(1, theta[1] / theta[0]);
  };
  const GaussNewton rules{.most_rounds = rounds,
                          .tolerance = 1e-6 * step,
                          .lower = Eigen::VectorXd::Constant(1, lowest),
                          .upper = Eigen::VectorXd::Constant(1, most_relaxation_s)};
  fit.relaxation = gauss_newton(Eigen::VectorXd::Constant(1, fit.relaxation), rules, step_of,
                                [](const Eigen::VectorXd&, int) { return true; })[0];
  return fit;
}

void add(std::string& note, const std::string& text) { note += (note.empty() ? "" : "; ") + text; }

/// Std of g(theta) from its gradient.
double spread(const LeastSquares& fit, const Eigen::VectorXd& gradient) {
  return std::sqrt(std::max(0.0, gradient.dot(fit.covariance * gradient)));
}

/// Another cause of deflection than load.
struct Cause {
  std::string_view effect;
  std::vector<double> shape;
  std::string_view what;  ///< for people
};

/// Takes out of the deflection what other causes explain, the worst first, each at most once; says so in `note`.
GearFit without_other_causes(const JointData& data, const IdentifiedModel& model, const Regressor& regressor,
                             bool with_rotor, bool revolute, double all, std::string& note, Eigen::MatrixXd& others,
                             const FlexibleOptions& options) {
  std::vector<Cause> list;
  if (revolute) list.push_back({once_a_turn_effect().name, {}, "an eccentric gear or encoder disc"});
  for (const double share : {0.01, 0.03, 0.1})
    list.push_back({play_effect().name, {share * std::max(1e-3, data.largest_load())}, "play"});
  GearFit fit = fit_gear(data, with_rotor, others);
  for (int round = 0; round < 2; ++round) {
    const Cause* best = nullptr;
    GearFit better = fit;
    Eigen::MatrixXd columns_of_best;
    for (const Cause& cause : list) {
      const Eigen::MatrixXd columns = data.effect(cause.effect, cause.shape);
      Eigen::MatrixXd both(columns.rows(), others.cols() + columns.cols());
      both << others, columns;
      const GearFit candidate = fit_gear(data, with_rotor, both, fit, 1);
      const double gain = fit.least_squares.power - candidate.least_squares.power;
      if (candidate.least_squares.power >= better.least_squares.power) continue;
      if (gain < options.cause * fit.least_squares.power || gain < options.cause_of_all * all) continue;
      best = &cause;
      better = candidate;
      columns_of_best = columns;
    }
    if (best == nullptr) break;
    Eigen::MatrixXd both(columns_of_best.rows(), others.cols() + columns_of_best.cols());
    both << others, columns_of_best;
    better = fit_gear(data, with_rotor, both, fit);
    // Wald's test, the load's own errors counted: they leave something that looks like another cause.
    const Eigen::Index own = columns_of_best.cols();
    const Eigen::MatrixXd covariance =
        better.least_squares.covariance + data.from_load(better.least_squares, model, regressor);
    const Eigen::VectorXd tail = better.least_squares.theta.tail(own);
    const double wald = tail.dot(covariance.bottomRightCorner(own, own).ldlt().solve(tail));
    if (wald < options.significant * options.significant * static_cast<double>(own)) break;
    fit = better;
    others = both;
    add(note, fmt::format("{} of {:.2g} {} taken out", best->what, 1e3 * tail.norm(), revolute ? "mrad" : "mm"));
    std::erase_if(list, [effect = best->effect](const Cause& cause) { return cause.effect == effect; });
  }
  return fit;
}

FlexibleJoint identify_joint(const JointData& data, const IdentifiedModel& model, const Regressor& regressor,
                             std::size_t j, bool rotor_in_load, const FlexibleOptions& options) {
  const bool revolute = robot_of(model).joints[j].type == JointType::revolute;
  const std::string_view stiffness_unit = revolute ? "N*m/rad" : "N/m", length_unit = revolute ? "mrad" : "mm";
  const Eigen::VectorXd& delta = data.deflection();
  FlexibleJoint out;
  out.joint = j;
  const double all = (delta.array() - delta.mean()).square().mean();
  out.deflection_rms = std::sqrt(all);

  if (!(all > 0)) {
    out.note = "no elasticity to be seen: both encoders say the same";
    return out;
  }
  Eigen::MatrixXd others(delta.size(), 0);
  GearFit fit = without_other_causes(data, model, regressor, rotor_in_load, revolute, all, out.note, others, options);
  LeastSquares& ls = fit.least_squares;
  ls.covariance += data.from_load(ls, model, regressor);
  out.explained = 1 - ls.power / all;

  const double c = fit.compliance, c_std = std::sqrt(ls.covariance(0, 0));
  Eigen::MatrixXd rest(delta.size(), 1 + others.cols());
  rest << Eigen::VectorXd::Ones(delta.size()), others;
  const double share = 1 - ls.power / least_squares(rest, delta, data.block_ends()).power;  // of the load
  if (c < -options.significant * c_std && share > options.most) {
    add(out.note, "the link goes before the load: link encoder counted the wrong way, or swapped with the motor's");
    return out;
  }
  if (!(c > options.significant * c_std) || share < options.least_share) {
    const GearFit whole = rotor_in_load ? fit_gear(data, false, others) : fit;
    const double left = std::sqrt(whole.least_squares.power), k = 1 / (std::max(0.0, whole.compliance) + 3 * c_std);
    if (share < options.most) {
      add(out.note, fmt::format("no elasticity to be seen: stiffer than {:.2g} {}, and {:.2g} {} remain unexplained", k,
                                stiffness_unit, 1e3 * left, length_unit));
    } else if (rotor_in_load && whole.least_squares.power < options.most * all) {
      add(out.note,
          "the gear bends, but its load cannot be distinguished from the rotor's inertia: move the joints behind it "
          "too, arm "
          "stretched and folded, or carry a load");
    } else {
      add(out.note, fmt::format("the gear bends with its load, but that load is too small to be known: stiffer than "
                                "{:.2g} {}; carry a load, or move faster",
                                k, stiffness_unit));
    }
    return out;
  }

  out.found = true;
  out.stiffness = 1 / c;
  out.stiffness_std = c_std / (c * c);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(ls.theta.size());
  out.damping = fit.relaxation / c;
  gradient[0] = -fit.relaxation / (c * c);
  gradient[1] = 1 / (c * c);
  out.damping_std = spread(ls, gradient);
  if (rotor_in_load) {
    gradient.setZero();
    out.effective_inertia = fit.rotor;
    gradient[0] = -fit.rotor / c;
    gradient[2] = -1 / c;
    out.inertia_std = spread(ls, gradient);
  } else if (const EffectFit* rotor = rotor_of(joints_of(model)[j])) {
    out.effective_inertia = rotor->linear[0];
    out.inertia_std = rotor->linear_std.empty() ? 0 : rotor->linear_std[0];
  }
  if (out.damping < options.damped * out.damping_std)
    add(out.note, "damping cannot be distinguished from none: move faster");
  if (out.explained < options.most)
    add(out.note, "most of the deflection does not follow the load: mounting of the encoders, or error of the gear");
  return out;
}

}  // namespace

std::vector<FlexibleJoint> identify_flexible(const FlexibleInput& input, const FlexibleOptions& options) {
  const bool any = std::any_of(input.logs.begin(), input.logs.end(), [](const ProcessedLog& log) {
    return std::find(log.has_link.begin(), log.has_link.end(), true) != log.has_link.end();
  });
  if (!any) return {};
  ModelValue rigid = input.model;
  for (JointFit& joint : joints_of(rigid)) {
    joint.effects.clear();
    joint.bls.reset();
  }
  std::vector<MotionRows> motions;
  std::vector<Eigen::MatrixXd> loads;
  for (const ProcessedLog& log : input.logs) {
    motions.push_back(log.link_motion(0, log.samples()));
    loads.emplace_back(log.samples(), log.q.cols());
    const MotionRows& m = motions.back();
    Predictor(with_load_of(log, rigid), log.step_s)(m.q, m.dq, m.ddq, loads.back());
  }
  const DhChain chain = to_dh(robot_of(input.model));
  const BaseSet base = find_base(chain);
  std::vector<std::optional<FlexibleJoint>> all(robot_of(input.model).size());
  parallel_for(all.size(), [&](std::size_t j) {
    const auto joint = static_cast<Eigen::Index>(j);
    const JointData data(input, motions, loads, joint, options.block_s);
    if (data.empty()) return;
    const bool rotor_in_load =
        rotor_of(joints_of(input.model)[j]) == nullptr && rotor_inertia_is_absorbed(chain, base, joint);
    all[j] = identify_joint(data, input.model, Regressor(chain), j, rotor_in_load, options);
  });
  std::vector<FlexibleJoint> found;
  for (std::optional<FlexibleJoint>& joint : all) {
    if (joint) found.push_back(std::move(*joint));
  }
  return found;
}

EffectFit elasticity_effect(const FlexibleJoint& joint, const FlexibleOptions& options) {
  const bool damped = joint.damping > options.damped * joint.damping_std;
  const double k = joint.stiffness;
  EffectFit fit;
  fit.effect = compliance_effect().name;
  fit.shape = {damped ? std::min(1.0, joint.damping / k) : 0.0};
  fit.shape_std = {joint.damping_std / k};
  fit.linear = {1 / k};
  fit.linear_std = {joint.stiffness_std / (k * k)};
  return fit;
}

}  // namespace fxdyn

// Shapes as unknowns of the fit, beside the coefficients.

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/regression/tie.hpp"
#include "host_tools/regression/unknown_shapes.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Where in unknown_shapes() a shape of an effect is.
Index place_of(JointFit& design, std::size_t effect, std::size_t shape) {
  const double* wanted = &design.effects[effect].shape[shape];
  const auto shapes = unknown_shapes(design);
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    if (shapes[s].value == wanted) return static_cast<Index>(s);
  }
  return -1;
}

}  // namespace

MatrixXd Fitter::shape_rows(std::size_t joint, const VectorXd& theta) const {
  constexpr double step = 1e-3;
  std::vector<JointFit> designs = design_;
  JointFit& design = designs[joint];
  if (design.bls) return MatrixXd(torque_rows_[joint].size(), 0);
  const auto shapes = unknown_shapes(design);
  MatrixXd out(torque_rows_[joint].size(), static_cast<Index>(shapes.size()));
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    double& shape = *shapes[s].value;
    const double value = shape;
    shape = value * (1 + step);
    const VectorXd more = own_rows(joint, designs) * theta;
    shape = value * (1 - step);
    out.col(static_cast<Index>(s)) = (more - own_rows(joint, designs) * theta) / (2 * step);
    shape = value;
  }
  return out;
}

NormalEquations Fitter::with_shapes(const Solution& solution, std::vector<MatrixXd>& shapes) const {
  shapes.resize(joints());
  parallel_for(joints(), [&](std::size_t j) { shapes[j] = shape_rows(j, solution.theta[j]); });
  NormalEquations linear = normal_equations(), out;
  const Index p = linear.offset.back();
  out.offset = {p};
  for (const MatrixXd& rows : shapes) out.offset.push_back(out.offset.back() + rows.cols());
  out.information = MatrixXd::Zero(out.offset.back(), out.offset.back());
  out.information.topLeftCorner(p, p) = linear.information;
  out.projection = VectorXd::Zero(out.offset.back());
  for (std::size_t j = 0; j < joints(); ++j) {
    const double w = weights_[static_cast<Index>(j)];
    const VectorXd e = residual(j, solution);
    const Index at = out.offset[j], count = shapes[j].cols(), first = data_->first_base[j];
    const Index own = linear.offset[j], own_count = linear.offset[j + 1] - own;
    for (const std::size_t b : train_blocks()) {
      const LogBlock& block = data_->blocks[b];
      const auto cut = [&](const auto& m) { return m.middleRows(block.from, block.to - block.from); };
      const MatrixXd ws = (w * cut(row_weights_[j])).asDiagonal() * cut(shapes[j]);
      const auto x = cut(data_->base_rows[j]);
      out.information.block(first, at, x.cols(), count) += x.transpose() * ws;
      out.information.block(own, at, own_count, count) += cut(own_rows_[j]).transpose() * ws;
      out.information.block(at, at, count, count) += cut(shapes[j]).transpose() * ws;
      out.projection.segment(first, x.cols()) += w * x.transpose() * cut(row_weights_[j]).cwiseProduct(cut(e));
      out.projection.segment(own, own_count) +=
          w * cut(own_rows_[j]).transpose() * cut(row_weights_[j]).cwiseProduct(cut(e));
      out.projection.segment(at, count) += ws.transpose() * cut(e);
    }
    JointFit design = design_[j];
    const auto tie = tie_of(design);
    if (!tie || count == 0) continue;
    // part - share whole, of which `linear` has the part that does not change the share
    const double weight = rows_of_tie * w * train_rows(j), whole = solution.theta[j][tie->whole];
    const double step = -tie->share * whole, off = solution.theta[j][tie->part] + step;
    const Index share = at + place_of(design, tie->effect, tie->shape);
    out.information(share, share) += weight * step * step;
    out.information(own + tie->part, share) += weight * step;
    out.information(own + tie->whole, share) -= weight * tie->share * step;
    out.projection[own + tie->part] -= weight * off;
    out.projection[own + tie->whole] += weight * tie->share * off;
    out.projection[share] -= weight * step * off;
  }
  if (!prior_.empty()) out.projection.head(prior_.mean.size()) += prior_.information * (prior_.mean - solution.beta);
  out.information.triangularView<Eigen::StrictlyLower>() = out.information.transpose();
  return out;
}

VectorXd Fitter::shape_step(const Solution& solution, double square, std::vector<Index>& offset) const {
  constexpr double longest = 0.4;  // in the logarithm of a shape
  // A shape that the rows determine worse than to a decade stays where it is (Levenberg 1944): the width of a sign
  // whose amplitude is zero would walk at random.
  const double decade = std::log(10.0);
  std::vector<MatrixXd> rows;
  NormalEquations all = with_shapes(solution, rows);
  offset = all.offset;
  const Index shapes = offset.back() - offset.front();
  all.information.diagonal().tail(shapes).array() += square / train_rows() / (decade * decade);
  VectorXd step = SymmetricSolver(all.information).solve(all.projection).tail(shapes);
  for (double& s : step) s = std::isfinite(s) ? std::clamp(s, -longest, longest) : 0;
  for (Index& o : offset) o -= all.offset.front();
  return step;
}

void Fitter::polish() {
  constexpr int most_tried = 30;
  constexpr double least_reach = 1.0 / 64, least_gain = 1e-5;
  using Designs = std::vector<JointFit>;
  Solution solution = solve(normal_equations());
  double square = weighted_square(solution);
  // The share of a step that each joint takes, from step to step: one that becomes worse goes less far the next time.
  std::vector<double> reach(joints(), 1.0);
  std::vector<Index> offset;
  std::vector<double> squares;
  int tried = 0;
  const auto step_of = [&](const Designs&, int) -> std::optional<VectorXd> {
    if (tried == most_tried) return {};
    VectorXd step = shape_step(solution, square, offset);
    if (step.size() == 0) return {};
    squares = weighted_squares(solution);
    return step;
  };
  const auto move = [&](const Designs& from, const VectorXd& step, double) {
    Designs there = from;
    for (std::size_t j = 0; j < joints(); ++j) {
      if (there[j].bls) continue;
      const auto shapes = unknown_shapes(there[j]);
      for (std::size_t s = 0; s < shapes.size(); ++s)
        shapes[s].set(*shapes[s].value * std::exp(reach[j] * step[offset[j] + static_cast<Index>(s)]));
    }
    return there;
  };
  const auto accept = [&](const Designs& from, Designs& there, int) {
    ++tried;
    set_designs(there);
    const std::vector<double> now = weighted_squares(solve(normal_equations()));
    bool all = true;
    for (std::size_t j = 0; j < joints(); ++j) {
      const bool worse = now[j] > squares[j];
      reach[j] = worse ? reach[j] / 4 : std::min(1.0, 2 * reach[j]);
      if (worse) there[j] = from[j];
      all = all && !worse;
    }
    if (!all) set_designs(there);
    Solution after = solve(normal_equations());
    const double left = weighted_square(after), gain = 1 - left / square;
    const bool going = *std::max_element(reach.begin(), reach.end()) > least_reach;
    if (!(left < square)) {
      set_designs(from);
      for (double& r : reach) r /= 4;
      return going && tried < most_tried ? Trial::rejected : Trial::given_up;
    }
    solution = std::move(after);
    square = left;
    return gain < least_gain && (all || !going) ? Trial::converged : Trial::accepted;
  };
  gauss_newton(design_, {.most_rounds = most_tried, .most_tries = most_tried}, step_of, move, accept);
}

}  // namespace fxdyn

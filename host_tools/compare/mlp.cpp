#include "host_tools/compare/mlp.hpp"

#include <cmath>
#include <deque>
#include <vector>

#include "host_tools/support/random.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double decay = 1e-6;
constexpr int memory = 12;
constexpr int patience = 60;  // iterations without a better judgement

/// The two-loop recursion (Nocedal, Wright 2006, algorithm 7.4).
class History {
 public:
  VectorXd direction(const VectorXd& gradient) const {
    VectorXd q = gradient;
    std::vector<double> alpha(pairs_.size());
    for (std::size_t i = pairs_.size(); i-- > 0;) {
      const auto& [s, y] = pairs_[i];
      alpha[i] = s.dot(q) / y.dot(s);
      q -= alpha[i] * y;
    }
    if (!pairs_.empty()) q *= pairs_.back().first.dot(pairs_.back().second) / pairs_.back().second.squaredNorm();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const auto& [s, y] = pairs_[i];
      q += s * (alpha[i] - y.dot(q) / y.dot(s));
    }
    return -q;
  }
  void add(const VectorXd& step, const VectorXd& change) {
    if (!(step.dot(change) > 1e-12 * step.norm() * change.norm())) return;
    pairs_.emplace_back(step, change);
    if (pairs_.size() > memory) pairs_.pop_front();
  }
  void clear() { pairs_.clear(); }
  bool empty() const { return pairs_.empty(); }

 private:
  std::deque<std::pair<VectorXd, VectorXd>> pairs_;
};

}  // namespace

Mlp::Mlp(const Examples& train, const Examples& judge, Index hidden, std::uint64_t seed, int starts, int iterations)
    : hidden_(hidden) {
  const Index d = train.x.cols();
  mean_ = train.x.colwise().mean();
  inverse_std_ = ((train.x.rowwise() - mean_).colwise().squaredNorm() / static_cast<double>(train.x.rows()))
                     .array()
                     .sqrt()
                     .max(1e-12)
                     .inverse();
  y_mean_ = train.y.mean();
  y_std_ = std::max(1e-12, std::sqrt((train.y.array() - y_mean_).square().mean()));
  const MatrixXd x = scaled(train.x), judge_x = scaled(judge.x);
  const VectorXd y = (train.y.array() - y_mean_) / y_std_, judge_y = (judge.y.array() - y_mean_) / y_std_;
  double least = 1e300;
  for (int start = 0; start < starts; ++start) {
    Random random(seed * 1000 + static_cast<std::uint64_t>(start));
    VectorXd w(hidden_ * (d + 2) + 1);
    for (Index i = 0; i < w.size(); ++i) w[i] = random.normal();
    w.head(hidden_ * d) /= std::sqrt(static_cast<double>(d));
    w.segment(hidden_ * (d + 1), hidden_) /= std::sqrt(static_cast<double>(hidden_));
    w[w.size() - 1] = 0;
    VectorXd gradient, fresh;
    double value = loss(w, x, y, gradient);
    History history;
    int since = 0;
    for (int iteration = 0; iteration < iterations && since < patience; ++iteration, ++since) {
      VectorXd direction = history.direction(gradient);
      double slope = direction.dot(gradient);
      if (!(slope < 0)) {
        history.clear();
        direction = -gradient;
        slope = -gradient.squaredNorm();
      }
      // Armijo's rule; the first step has no scale yet.
      double length = history.empty() ? std::min(1.0, 1 / std::max(1e-12, gradient.norm())) : 1.0, next = value;
      VectorXd there;
      bool lower = false;
      for (int halving = 0; halving < 25 && !lower; ++halving, length *= 0.5) {
        there = w + length * direction;
        next = loss(there, x, y, fresh);
        lower = next <= value + 1e-4 * length * slope;
      }
      if (!lower) break;
      history.add(there - w, fresh - gradient);
      w = there;
      gradient = fresh;
      value = next;
      const double error = (evaluate(w, judge_x) - judge_y).squaredNorm() / static_cast<double>(judge_y.size());
      if (error >= least) continue;
      least = error;
      w_ = w;
      since = 0;
    }
  }
  judged_ = least * y_std_ * y_std_;
}

MatrixXd Mlp::scaled(const MatrixXd& x) const { return (x.rowwise() - mean_).array().rowwise() * inverse_std_.array(); }

MatrixXd Mlp::hidden(const VectorXd& w, const MatrixXd& x) const {
  const Index d = x.cols();
  const Map<const MatrixXd> weights(w.data(), d, hidden_);
  const auto bias = w.segment(hidden_ * d, hidden_).transpose();
  return ((x * weights).rowwise() + bias).array().tanh();
}

VectorXd Mlp::evaluate(const VectorXd& w, const MatrixXd& x) const {
  const Index d = x.cols();
  return (hidden(w, x) * w.segment(hidden_ * (d + 1), hidden_)).array() + w[w.size() - 1];
}

double Mlp::loss(const VectorXd& w, const MatrixXd& x, const VectorXd& y, VectorXd& gradient) const {
  const Index d = x.cols();
  const auto n = static_cast<double>(x.rows());
  const MatrixXd h = hidden(w, x);
  const auto c = w.segment(hidden_ * (d + 1), hidden_);
  const VectorXd e = (h * c).array() + w[w.size() - 1] - y.array();
  gradient.resize(w.size());
  // d/dW = x^T (e c^T (1 - h^2))
  const MatrixXd back = (e * c.transpose()).array() * (1 - h.array().square());
  Map<MatrixXd>(gradient.data(), d, hidden_).noalias() = 2 / n * x.transpose() * back;
  gradient.segment(hidden_ * d, hidden_) = 2 / n * back.colwise().sum().transpose();
  gradient.segment(hidden_ * (d + 1), hidden_) = 2 / n * h.transpose() * e;
  gradient[w.size() - 1] = 2 / n * e.sum();
  gradient += 2 * decay * w;
  return e.squaredNorm() / n + decay * w.squaredNorm();
}

VectorXd Mlp::operator()(const MatrixXd& x) const { return evaluate(w_, scaled(x)).array() * y_std_ + y_mean_; }

}  // namespace fxdyn

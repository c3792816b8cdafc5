#include "host_tools/train/swarm.hpp"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

constexpr double never = std::numeric_limits<double>::max();

/// Paper Eq. 33, put right.
double constriction(double phi) { return 2 / std::fabs(2 - phi - std::sqrt(phi * phi - 4 * phi)); }

/// Of one particle in one generation.
Random stream(std::uint64_t seed, int generation, Index particle) {
  Random mix(seed);
  const std::uint64_t a = mix.next() ^ static_cast<std::uint64_t>(generation) * 0x9E3779B97F4A7C15ULL;
  Random more(a);
  return Random(more.next() ^ static_cast<std::uint64_t>(particle) * 0xC2B2AE3D27D4EB4FULL);
}

json columns(const MatrixXd& m) {
  json out = json::array();
  for (Index c = 0; c < m.cols(); ++c) out.push_back(std::vector<double>(m.col(c).begin(), m.col(c).end()));
  return out;
}

MatrixXd to_columns(const json& j, Index rows, Index cols) {
  if (static_cast<Index>(j.size()) != cols) throw InputError("another number of particles");
  MatrixXd out(rows, cols);
  for (Index c = 0; c < cols; ++c) {
    const auto column = j.at(static_cast<std::size_t>(c)).get<std::vector<double>>();
    if (static_cast<Index>(column.size()) != rows) throw InputError("another number of dimensions");
    out.col(c) = Eigen::Map<const VectorXd>(column.data(), rows);
  }
  return out;
}

}  // namespace

Swarm::Swarm(VectorXd lower, VectorXd upper, const SwarmSettings& settings)
    : lower_(std::move(lower)), upper_(std::move(upper)), settings_(settings), best_value_(never), milestone_(never) {
  const Index d = lower_.size(), n = settings_.particles;
  x_.resize(d, n);
  v_.resize(d, n);
  // Eq. 35: uniform over the box and over the velocities.
  for (Index p = 0; p < n; ++p) {
    Random random = stream(settings_.seed, 0, p);
    for (Index i = 0; i < d; ++i) {
      const double width = upper_[i] - lower_[i];
      x_(i, p) = lower_[i] + width * random.uniform();
      v_(i, p) = settings_.largest_step * width * random.uniform(-1, 1);
    }
  }
  own_best_ = x_;
  own_value_ = VectorXd::Constant(n, never);
  best_ = x_.col(0);
}

bool Swarm::finished() const { return generation_ > settings_.iterations || stalled_ >= settings_.stall; }

void Swarm::tell(const VectorXd& values) {
  for (Index p = 0; p < x_.cols(); ++p) {
    const double value = std::isfinite(values[p]) ? values[p] : never;
    if (value < own_value_[p]) {
      own_value_[p] = value;
      own_best_.col(p) = x_.col(p);
    }
    if (value < best_value_) {
      best_value_ = value;
      best_ = x_.col(p);
    }
  }
  // Against the last progress, not the last generation: many steps too small to count one by one add up.
  const bool progress = best_value_ < milestone_ - settings_.tolerance * std::fabs(milestone_);
  if (progress) milestone_ = best_value_;
  stalled_ = progress ? 0 : stalled_ + 1;
  ++generation_;
  if (!finished()) move();
}

VectorXd Swarm::best_near(Index particle) const {
  const Index n = x_.cols();
  Index best = particle;
  for (Index k = -settings_.neighbours; k <= settings_.neighbours; ++k) {
    const Index other = ((particle + k) % n + n) % n;
    if (own_value_[other] < own_value_[best]) best = other;
  }
  return own_best_.col(best);
}

void Swarm::move() {
  const double chi = constriction(settings_.cognitive + settings_.social);
  const double done = static_cast<double>(generation_ - 1) / std::max(1, settings_.iterations - 1);
  const double inertia = settings_.first_inertia + done * (settings_.last_inertia - settings_.first_inertia);
  const bool near = generation_ <= settings_.neighbourly * settings_.iterations;
  for (Index p = 0; p < x_.cols(); ++p) {
    Random random = stream(settings_.seed, generation_, p);
    const VectorXd followed = near ? best_near(p) : best_;
    for (Index i = 0; i < x_.rows(); ++i) {
      const double own = settings_.cognitive * random.uniform() * (own_best_(i, p) - x_(i, p));
      const double common = settings_.social * random.uniform() * (followed[i] - x_(i, p));
      const double most = settings_.largest_step * (upper_[i] - lower_[i]);
      v_(i, p) = std::clamp(inertia * v_(i, p) + chi * (own + common), -most, most);
      x_(i, p) += v_(i, p);
      if (x_(i, p) >= lower_[i] && x_(i, p) <= upper_[i]) continue;
      x_(i, p) = std::clamp(x_(i, p), lower_[i], upper_[i]);
      v_(i, p) = 0;
    }
  }
}

json Swarm::to_json() const {
  return {{"generation", generation_},      {"stalled", stalled_},
          {"positions", columns(x_)},       {"velocities", columns(v_)},
          {"own_best", columns(own_best_)}, {"own_value", columns(own_value_)},
          {"best", columns(best_)},         {"best_value", best_value_},
          {"milestone", milestone_}};
}

void Swarm::from_json(const json& state) {
  const Index d = x_.rows(), n = x_.cols();
  const MatrixXd x = to_columns(state.at("positions"), d, n), v = to_columns(state.at("velocities"), d, n),
                 own = to_columns(state.at("own_best"), d, n), value = to_columns(state.at("own_value"), n, 1),
                 best = to_columns(state.at("best"), d, 1);
  const double least = state.at("best_value"), milestone = state.at("milestone");
  const int generation = state.at("generation"), stalled = state.at("stalled");
  const auto in_box = [&](const MatrixXd& positions) {
    return positions.allFinite() && ((positions.colwise() - lower_).array() >= 0).all() &&
           ((positions.colwise() - upper_).array() <= 0).all();
  };
  if (generation < 0 || stalled < 0 || !in_box(x) || !in_box(own) || !in_box(best) || !v.allFinite())
    throw InputError("not a state that a search can be in");
  x_ = x;
  v_ = v;
  own_best_ = own;
  own_value_ = value;
  best_ = best;
  best_value_ = least;
  milestone_ = milestone;
  generation_ = generation;
  stalled_ = stalled;
}

}  // namespace fxdyn

#include "host_tools/diagnose/load_places.hpp"

#include <array>
#include <cmath>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr Index ten = moments_of_load;
/// A small mass [kg]: the torque is linear in it.
constexpr double small_mass = 1e-3;
/// What gripper and flange allow [m]; a mass further out is none.
constexpr double furthest = 10;

const std::array<Vector3d, ten>& places() {
  static const std::array<Vector3d, ten> all{Vector3d{0, 0, 0}, {1, 0, 0},  {-1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                                             Vector3d{0, 0, 1}, {0, 0, -1}, {1, 1, 0},  {1, 0, 1}, {0, 1, 1}};
  return all;
}

/// Of a point mass as it is: m, c.
struct PointMass {
  double mass = 0;
  Vector3d centre = Vector3d::Zero();
  MomentsOfLoad moments() const { return mass * moments_at(centre); }
};

double gain_of(const MatrixXd& gram, const VectorXd& projection, const PointMass& load) {
  const MomentsOfLoad theta = load.moments();
  return 2 * projection.dot(theta) - theta.dot(gram * theta);
}

/// By mass and first moment, which torques are nearly linear in.
PointMass improved(const MatrixXd& gram, const VectorXd& projection, PointMass load) {
  constexpr int most_rounds = 30;
  double damping = 1e-6, best = gain_of(gram, projection, load);
  for (int round = 0; round < most_rounds; ++round) {
    const Eigen::Matrix<double, ten, 4> j = moments_around(load.centre);
    Eigen::Matrix4d normal = j.transpose() * gram * j;
    normal.diagonal() *= 1 + damping;
    const Eigen::Vector4d step = normal.ldlt().solve(j.transpose() * (projection - gram * load.moments()));
    PointMass next{load.mass + step[0], load.mass * load.centre + step.tail<3>()};
    if (next.mass > least_mass) next.centre /= next.mass;
    const bool possible = next.mass > least_mass && next.centre.norm() < furthest;
    const double gain = possible ? gain_of(gram, projection, next) : best;
    if (!(gain > best)) {
      damping = 10 * std::max(damping, 1e-6);
      if (damping > 1e6) break;
      continue;
    }
    const bool settled = gain - best < 1e-6 * std::fabs(best);
    load = next;
    best = gain;
    damping /= 10;
    if (settled) break;
  }
  return load;
}

}  // namespace

MomentsOfLoad moments_at(const Vector3d& c) {
  MomentsOfLoad out;
  out << 1, c.x(), c.y(), c.z(), c.x() * c.x(), c.y() * c.y(), c.z() * c.z(), c.x() * c.y(), c.x() * c.z(),
      c.y() * c.z();
  return out;
}

Eigen::Matrix<double, ten, 4> moments_around(const Vector3d& c) {
  Eigen::Matrix<double, ten, 4> out = Eigen::Matrix<double, ten, 4>::Zero();
  out.col(0).tail<6>() = -moments_at(c).tail<6>();  // h h^T / m falls with the mass
  out(0, 0) = 1;
  constexpr std::array<std::array<Index, 3>, 3> second{{{4, 7, 8}, {7, 5, 9}, {8, 9, 6}}};
  for (Index k = 0; k < 3; ++k) {
    out(1 + k, 1 + k) = 1;
    for (Index i = 0; i < 3; ++i)
      out(second[static_cast<std::size_t>(k)][static_cast<std::size_t>(i)], 1 + k) += (i == k ? 2 : 1) * c[i];
  }
  return out;
}

PointLoads::PointLoads(const LogColumns& columns, std::size_t log)
    : columns_(columns), log_(log), without_(columns.torque_of(log, columns.model(log))) {}

MatrixXd PointLoads::torque(Index place) const {
  const Vector3d& c = places()[static_cast<std::size_t>(place)];
  ModelValue model = columns_.model(log_);
  EffectFit load;
  load.effect = load_effect().name;
  load.linear = {small_mass, c.x(), c.y(), c.z()};
  body_of(model).push_back(std::move(load));
  return (columns_.torque_of(log_, std::move(model)) - without_) / small_mass;
}

const Eigen::Matrix<double, ten, ten>& moments_from_places() {
  static const Eigen::Matrix<double, ten, ten> inverse = [] {
    Eigen::Matrix<double, ten, ten> of_places;  // torque of a place = torques by moment * its moments
    for (Index i = 0; i < ten; ++i) of_places.col(i) = moments_at(places()[static_cast<std::size_t>(i)]);
    return Eigen::Matrix<double, ten, ten>(of_places.inverse());
  }();
  return inverse;
}

std::optional<Vector3d> best_place(const MatrixXd& gram, const VectorXd& projection) {
  const VectorXd any = SymmetricSolver(gram).inverse() * projection;
  const double at_origin = gram(0, 0) > 0 ? projection[0] / gram(0, 0) : 0;
  std::vector<PointMass> starts{{std::max(at_origin, 2 * least_mass), Vector3d::Zero()}};
  if (any[0] > least_mass) starts.push_back({any[0], any.segment<3>(1) / any[0]});
  std::optional<Vector3d> best;
  double most = 0;
  for (const PointMass& start : starts) {
    if (start.centre.norm() >= furthest) continue;
    const PointMass found = improved(gram, projection, start);
    const double gain = gain_of(gram, projection, found);
    if (!(gain > most)) continue;
    most = gain;
    best = found.centre;
  }
  return best;
}

}  // namespace fxdyn::diagnosis

#include "host_tools/excite/feasible.hpp"

#include <fmt/format.h>

#include <limits>

#include "host_tools/excite/evolution.hpp"
#include "host_tools/excite/motions.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr std::size_t wanted_poses = 150;  ///< to start from and to dwell at
constexpr int population = 16;             ///< of the search for a first pose
constexpr int most_shrinks = 100;          ///< each by 2 %

}  // namespace

FeasibleMotions::FeasibleMotions(const Project& project, const std::filesystem::path& directory,
                                 std::vector<std::string>& notes)
    : project_(project), check_(limit_check(project, directory, notes)) {
  find_poses();
}

void FeasibleMotions::find_poses() {
  Random random(project_.excite.seed * 1000003 + 17);
  const auto draw = [&] {
    VectorXd q(check_.lower().size());
    for (Index j = 0; j < q.size(); ++j) q[j] = random.uniform(check_.lower()[j], check_.upper()[j]);
    return q;
  };
  VectorXd best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t tries = 0; tries < 50 * wanted_poses && poses_.size() < wanted_poses; ++tries) {
    const VectorXd q = draw();
    const double beyond = violation(one_pose(q));
    if (beyond < least) {
      least = beyond;
      best = q;
    }
    if (beyond == 0) poses_.push_back(q);
  }
  if (!poses_.empty()) return;
  const VectorXd middle = 0.5 * (check_.lower() + check_.upper()), half = 0.5 * (check_.upper() - check_.lower());
  const auto pose = [&](const VectorXd& x) { return VectorXd(middle + half.cwiseProduct(x.cwiseMax(-1).cwiseMin(1))); };
  const VectorXd x = minimise([&](const VectorXd& at) { return violation(one_pose(pose(at))); },
                              (best - middle).cwiseQuotient(half), {200, population, 0.2, project_.excite.seed}, [] {});
  best = pose(x);
  if (violation(one_pose(best)) > 0) refuse("no pose at rest", one_pose(best));
  poses_.push_back(best);
}

void FeasibleMotions::refuse(std::string_view what, const Motion& nearest) const {
  throw InputError(
      fmt::format("{}: {} keeps the limits and their margins; the best one found violates {}; widen that "
                  "limit or lower [excite] margin ({})",
                  project_.file.string(), what, check_.worst(nearest, between_samples), project_.excite.margin));
}

bool FeasibleMotions::make_feasible(const SeriesCoordinates& coordinates, VectorXd& x) const {
  for (int i = 0; violation(coordinates.decode(x).motion) > 0; ++i) {
    if (i == 40) return false;
    coordinates.shrink(x, 0.85);
  }
  return true;
}

VectorXd FeasibleMotions::random(const SeriesCoordinates& coordinates, std::uint64_t seed) const {
  Random random(seed);
  VectorXd x;
  for (int tries = 0; tries < 20; ++tries) {
    const auto pick = static_cast<std::size_t>(random.uniform() * static_cast<double>(poses_.size()));
    x = coordinates.random(random.next(), poses_[pick]);
    if (make_feasible(coordinates, x)) return x;
  }
  refuse("no motion", coordinates.decode(x).motion);
}

FeasibleMotions::Sampled FeasibleMotions::sample(const SeriesCoordinates& coordinates, VectorXd x) const {
  Sampled out;
  for (int shrunk = 0;; ++shrunk) {
    out.series = coordinates.decode(x).series;
    out.motion = play(out.series, coordinates.period_s(), coordinates.kind().periods, project_.excite.step_s);
    if (check_.violation(out.motion) == 0 || shrunk == most_shrinks) return out;  // the caller checks what remains
    coordinates.shrink(x, 0.98);
  }
}

}  // namespace fxdyn

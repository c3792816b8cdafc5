#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/excite/limits.hpp"
#include "host_tools/excite/series_coordinates.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// Motions within a project's limits, their margins taken off.
class FeasibleMotions {
 public:
  /// Kept while searching, beside the margin: what falls between the samples of the search.
  static constexpr double between_samples = 0.02;

  /// Looks for poses at rest. @param directory where model.json may be, see torque_model()
  /// @param notes what was assumed is appended
  /// @throws InputError: limits that no pose meets, naming limit and joint
  FeasibleMotions(const Project& project, const std::filesystem::path& directory, std::vector<std::string>& notes);

  const LimitCheck& check() const { return check_; }
  const std::vector<Eigen::VectorXd>& poses() const { return poses_; }  ///< at rest, at least one

  double violation(const Motion& motion) const { return check_.violation(motion, between_samples); }
  /// Shrinks the motion until it is feasible; whether it got there.
  bool make_feasible(const SeriesCoordinates& coordinates, Eigen::VectorXd& x) const;
  /// A random series about a random pose. @throws InputError: none was found
  Eigen::VectorXd random(const SeriesCoordinates& coordinates, std::uint64_t seed) const;
  /// A series at the step of what is written; what the coarse samples of the search missed shrinks it.
  struct Sampled {
    std::vector<FourierJoint> series;
    Motion motion;
  };
  Sampled sample(const SeriesCoordinates& coordinates, Eigen::VectorXd x) const;

 private:
  [[noreturn]] void refuse(std::string_view what, const Motion& nearest) const;
  void find_poses();

  const Project& project_;
  LimitCheck check_;
  std::vector<Eigen::VectorXd> poses_;
};

}  // namespace fxdyn

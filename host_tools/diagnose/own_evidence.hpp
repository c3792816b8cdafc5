#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/finding.hpp"
#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// What speaks for one effect at its joint on data that fitted none of it, whatever else is missing there.
struct OwnEvidence {
  /// What it brings beside free curves of all variables but its own: the difference of -2 ln p without and with it,
  /// which is chi^2 where it is small. What is missing in another variable does not speak for it.
  double gain = 0;
  /// Of what a free curve of its own variable closes in its place or beside it, the share that it closes, together with
  /// the others of that variable: the form holds.
  double form = 1;
  /// What that curve is more likely by than those names, as a difference of -2 ln p less the price of the curves tried:
  /// less than 0 where they suffice.
  double curve_gain = 0;
  /// Several of the own position: the same of a free curve of the position (B-spline) in the place of all of them.
  double spline_gain = 0;
  bool of_position = false;  ///< its variable is the own position
  std::size_t alike = 1;     ///< effects of that variable at the joint
  bool of_time = false;      ///< its variable is time, whose curve says nothing of other times

  /// Whether one free curve in the place of several names is likelier than they are, by 1000 to 1.
  bool is_stack(const GateOptions& options) const { return spline_gain >= options.established * variances_per_decade; }
};

/// An effect's own variable is another joint's velocity, time, the own position, or else the own motion and load; its
/// curve is the family of features() of that name. Coefficients of the functions have a normal prior of the size that
/// suits what judges best.
/// @param groups of the problem, named in its model; those on the body get no answer
/// @param features by joint, of the same problem
std::vector<OwnEvidence> own_evidence(const Linearised& problem, const std::vector<std::size_t>& groups,
                                      const std::vector<Eigen::MatrixXd>& features);

/// Of what an effect on the robot would close on data that did not fit it if each joint had coefficients of its own for
/// it, the share that it closes with those that all joints have in common: its form holds. What is missing at one
/// joint, and is not the effect, such coefficients take and the common ones don't. Whatever else is missing does not
/// count. The joint that gains most has chosen the common coefficients, so it is left out: the others judge them. 0
/// where they gain less than `GateOptions::sure_gain`.
/// @param problem gets columns, which are in no model
/// @param groups of the problem, named in its model; @param effect one of them, on the body
double form_on_robot(Linearised& problem, const std::vector<std::size_t>& groups, std::size_t effect);

}  // namespace fxdyn::diagnosis

#pragma once

#include <Eigen/Dense>

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// When two logs show one motion.
struct CourseOptions {
  /// s; grid of the positions that are compared, and of their shifts; hand: 1 % of the range at 1 Hz
  double step_s = 0.01;
  /// of these steps one is compared; hand: ten samples a second
  Eigen::Index stride = 10;
  /// share of the joint's range, RMS; repetitions differ by less; hand: three grid steps at 1 Hz
  double alike = 0.03;
  /// rad | m; likewise, of a joint that is parked; hand
  double parked = 1e-3;
};

/// The way the joints went: positions on an even grid, samples x joints [rad | m].
struct Course {
  Eigen::MatrixXd q;
};
/// From `from_s` to `to_s` of the log's own time: without standstill.
Course course_of(const Log& log, double from_s, double to_s, const CourseOptions& options = {});

/// Whether two logs repeat one motion: shifted against each other, they agree over at least half of the shorter one.
/// That the joints' ranges agree does not suffice, another motion may fill the same ones; nor is it needed, a log may
/// have been cut.
bool same_course(const Course& a, const Course& b, const CourseOptions& options = {});

}  // namespace fxdyn

#include "host_tools/check/course.hpp"

#include <algorithm>

namespace fxdyn {

using Eigen::Index;
using Eigen::VectorXd;

Course course_of(const Log& log, double from_s, double to_s, const CourseOptions& options) {
  const auto count = std::max<Index>(2, static_cast<Index>((to_s - from_s) / options.step_s));
  return {interpolate(log.q, log.t, VectorXd::LinSpaced(count, from_s, to_s))};
}

bool same_course(const Course& a, const Course& b, const CourseOptions& options) {
  const Eigen::MatrixXd& longer = a.q.rows() < b.q.rows() ? b.q : a.q;
  const Eigen::MatrixXd& shorter = a.q.rows() < b.q.rows() ? a.q : b.q;
  const Index half = shorter.rows() / 2;
  const VectorXd range = (shorter.colwise().maxCoeff() - shorter.colwise().minCoeff()).transpose();
  const VectorXd allowed = (options.alike * range).cwiseMax(options.parked).cwiseAbs2();
  // Sample k of the shorter one is sample k + shift of the longer one.
  for (Index shift = half - shorter.rows(); shift <= longer.rows() - half; ++shift) {
    const Index first = std::max<Index>(0, -shift), last = std::min(shorter.rows(), longer.rows() - shift);
    const double count = static_cast<double>((last - first + options.stride - 1) / options.stride);
    VectorXd square = VectorXd::Zero(range.size());
    bool alike = true;
    for (Index k = first; k < last && alike; k += options.stride) {
      square += (shorter.row(k) - longer.row(k + shift)).transpose().cwiseAbs2();
      alike = (square.array() <= count * allowed.array()).all();
    }
    if (alike) return true;
  }
  return false;
}

}  // namespace fxdyn

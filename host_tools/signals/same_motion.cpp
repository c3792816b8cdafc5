#include "host_tools/signals/same_motion.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn {
namespace {

/// Steps of what is compared [rad | m], [N*m | N]: coarser than the rounding of an interpolation, finer than an
/// encoder.
constexpr double position_step = 1e-7, torque_step = 1e-5;

class Mixer {
 public:
  void add(double value, double step) {
    const auto word = static_cast<std::uint64_t>(std::llround(value / step));
    mixed_ = (mixed_ ^ word) * 0x9E3779B97F4A7C15ULL;
    mixed_ ^= mixed_ >> 29;
  }
  std::uint64_t word() const { return mixed_; }

 private:
  std::uint64_t mixed_ = 0xCBF29CE484222325ULL;
};

}  // namespace

std::vector<std::uint64_t> row_prints(const Log& log) {
  std::vector<std::uint64_t> prints;
  if (log.tau.size() == 0) return prints;
  for (Eigen::Index k = 1; k < log.samples(); ++k) {
    if (((log.q.row(k) - log.q.row(k - 1)).array().abs() <= position_step).all()) continue;
    Mixer mixer;
    for (Eigen::Index j = 0; j < log.joints(); ++j) {
      mixer.add(log.q(k, j), position_step);
      mixer.add(log.tau(k, j), torque_step);
    }
    prints.push_back(mixer.word());
  }
  std::sort(prints.begin(), prints.end());
  prints.erase(std::unique(prints.begin(), prints.end()), prints.end());
  return prints;
}

std::size_t rows_in_common(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  std::size_t common = 0;
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end();) {
    if (*i == *j) {
      ++common;
      ++i;
      ++j;
    } else if (*i < *j) {
      ++i;
    } else {
      ++j;
    }
  }
  return common;
}

}  // namespace fxdyn

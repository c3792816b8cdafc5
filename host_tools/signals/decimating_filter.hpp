#pragma once

#include <Eigen/Dense>
#include <array>

namespace fxdyn {

/// ZeroPhaseFilter of order 4 where only every so many samples are wanted: of a search's columns, which are made anew
/// for every candidate. Written as a sum over its poles p, filter and mirror image are
///   y_k = c x_k + sum_p r_p sum_{n >= 1} p^n (x_{k-n} + x_{k+n})
/// and the inner sums go from one wanted sample to the next in one step. Away from the ends by edge_samples() the
/// outcome is ZeroPhaseFilter's but for rounding.
class DecimatingFilter {
 public:
  /// Columns that stand side by side: lanes x samples.
  static constexpr Eigen::Index lanes = 8;

  /// Of `samples`, those numbered first, first + step, .., `kept` of them, are wanted.
  DecimatingFilter(double cutoff_hz, double step_s, Eigen::Index samples, Eigen::Index first, Eigen::Index step,
                   Eigen::Index kept);
  /// Room in the tile before the samples and in all: the columns are continued there, reflected as ZeroPhaseFilter
  /// does.
  Eigen::Index before() const { return front_ * step_ - first_; }
  Eigen::Index tile_samples() const { return (front_ + kept_ + back_) * step_; }
  /// @param tile lanes x tile_samples(), samples from before() on; its margins are written here
  /// @param out lanes x kept
  void operator()(Eigen::MatrixXd& tile, Eigen::MatrixXd& out) const;

 private:
  static constexpr Eigen::Index pairs = 2;        ///< of complex poles
  using Weights = std::array<double, 2 * pairs>;  ///< real and imaginary part of each pair

  void continue_beyond(Eigen::MatrixXd& tile) const;

  bool identity_ = false;
  Eigen::Index samples_, first_, step_, kept_;
  Eigen::Index front_ = 0, back_ = 0;       ///< steps before the first wanted sample and from the last one on
  double middle_ = 1;                       ///< c
  Weights leap_{}, at_rest_{}, residue_{};  ///< p^step, p / (1 - p), 2 r
  std::vector<Weights> powers_;             ///< p^1 .. p^step
};

}  // namespace fxdyn

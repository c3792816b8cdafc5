#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn {

/// Columns at `steps` (any number, a fraction too) samples later, by cubic interpolation; the ends stand still.
Eigen::MatrixXd at_other_times(const Eigen::Ref<const Eigen::MatrixXd>& columns, double steps);

/// Zero-phase low-pass Butterworth filter: forward and backward over each column, with odd reflection at both ends and
/// steady-state initial conditions. `order` is the order of one pass (the baseline of shared data: 4).
class ZeroPhaseFilter {
 public:
  /// A cut-off at or above 0.95 of the Nyquist frequency, or <= 0, makes it the identity.
  ZeroPhaseFilter(double cutoff_hz, double step_s, int order = 4);
  Eigen::MatrixXd apply(const Eigen::Ref<const Eigen::MatrixXd>& columns) const;
  /// Samples at either end that the transient of the filter can reach.
  Eigen::Index edge_samples() const;
  double cutoff_hz() const { return cutoff_hz_; }
  /// (b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2), one after another; none: the identity.
  struct Section {
    double b0, b1, b2, a1, a2;
  };
  const std::vector<Section>& sections() const { return sections_; }

 private:
  template <int columns>
  void apply_to(double* side_by_side, Eigen::Index samples) const;

  double cutoff_hz_;
  std::vector<Section> sections_;
};

/// d/dt of each column by central differences of sixth order (one-sided towards the ends), error O(h^6).
Eigen::MatrixXd differentiate(const Eigen::Ref<const Eigen::MatrixXd>& columns, double step_s);
/// d^2/dt^2, likewise.
Eigen::MatrixXd differentiate_twice(const Eigen::Ref<const Eigen::MatrixXd>& columns, double step_s);

}  // namespace fxdyn

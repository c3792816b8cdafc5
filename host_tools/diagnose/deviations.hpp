#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

struct Outcome;

/// Standard deviations of the current model's parameters from the information of a fit around the models as they are.
/// @throws std::out_of_range: the problem has effects that the model lacks, so it is another model's
void add_deviations(Models& models, const Linearised& problem);

/// Standard deviations by which the coefficients of each group together are off nothing,
///   sqrt(theta^T C^-1 theta), C their covariance with the group's shapes held.
/// What the shapes leave open is which curve it is, not whether it is there. A share is 1 by definition: for such an
/// effect, those by which the least known of its shapes is off 0.
std::vector<double> deviations_off_nothing(const Linearised& problem, const std::vector<std::size_t>& groups);

/// How many rows of a residual say what one says,
///   variance of a mean / that of white noise = S(0) / r(0) (Bartlett's window over two seconds).
class Dilution {
 public:
  /// @param e neighbouring rows @param row_s from one to the next [s]
  void add(const Eigen::VectorXd& e, double row_s);
  double value() const { return square_ > 0 ? std::max(1.0, 1 + lagged_ / square_) : 1; }

 private:
  double square_ = 0, lagged_ = 0;
};

/// One over the variances of the joints' residuals, less where these have structure: neighbouring rows then say the
/// same, and a column counts as the residual's slowest part does (Dilution).
Eigen::VectorXd diluted_weights(const Linearised& problem);

/// For a search of which no name is left: the models that it began with, with their standard deviations. What the
/// search left otherwise (a rotor given up, an effect that stayed without a name) is dropped with its problem: the
/// problem's unknowns have to be those of the model that the deviations are written into.
void back_to_start(Outcome& outcome, const Models& start, const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis

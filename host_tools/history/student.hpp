#pragma once

namespace fxdyn::history {

/// P(|T| > t) of Student's t with n degrees of freedom: the finite sums of Abramowitz and Stegun 1964, 26.7.3
/// and 26.7.4. Right to about 1e-15, so small ones are at least that.
double two_sided_p(double t, int degrees);

/// The t with P(|T| > t) = p, by bisection. @param p between 1e-12 and 1
double two_sided_quantile(double p, int degrees);

}  // namespace fxdyn::history

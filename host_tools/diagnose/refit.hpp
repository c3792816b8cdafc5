#pragma once

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Least squares over everything that is not fixed (base parameters, friction, widths, named effects with their shapes)
/// by Gauss and Newton, the model linearised again at every step: large delays, gaps, tilts and loads come out right.
/// Only logs that fit are looked at.
void refit(Models& models, const std::vector<SessionLog>& logs, const std::vector<Eigen::VectorXd>& whitening,
           int rounds);

/// Puts an effect into the current model as one that was named. Payload is given in mass and first moment.
void name(Models& models, const Group& group, const Eigen::VectorXd& theta);

}  // namespace fxdyn::diagnosis

#pragma once

#include <algorithm>
#include <cstddef>

#include "host_tools/check/arrangement.hpp"

namespace fxdyn::test {

/// How well an arrangement explains the samples, with no spring or with one at the joint where it explains most: minus
/// the log of the evidence.
inline double nats_with_a_spring(const ArrangementEvidence& evidence, Arrangement arrangement) {
  const ArrangementEvidence::Design design = evidence.design(arrangement);
  double best = evidence.score(design, arrangement).nats;
  for (std::size_t j = 0; j < evidence.robot().size(); ++j) {
    arrangement.sprung.assign(evidence.robot().size(), false);
    arrangement.sprung[j] = true;
    best = std::min(best, evidence.score(design, arrangement).nats);
  }
  return best;
}

/// What the right arrangement gains over the columns as given. Less than ArrangementOptions::gain: no method of this
/// kind can tell.
inline double gained_by(const ArrangementEvidence& evidence, const Arrangement& right) {
  return nats_with_a_spring(evidence, as_given(evidence.robot())) - nats_with_a_spring(evidence, right);
}

}  // namespace fxdyn::test

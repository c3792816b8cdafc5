#include "host_tools/diagnose/joint_state.hpp"

#include <algorithm>

namespace fxdyn::diagnosis {

Verdict verdict_of(const JointState& state) {
  const bool explained = state.established || state.there || state.reached;
  const bool without_a_name = state.structured || state.impacts || state.curved || state.nameless;
  const bool left = state.remains || (!explained && without_a_name) || state.bends || state.wanders;
  if (left) return explained ? Verdict::partly_explained : Verdict::unexplained;
  return explained ? Verdict::explained : Verdict::nothing_missing;
}

Verdict worst(const std::vector<Verdict>& verdicts) {
  for (const Verdict verdict :
       {Verdict::unexplained, Verdict::partly_explained, Verdict::explained, Verdict::not_excited}) {
    if (std::find(verdicts.begin(), verdicts.end(), verdict) != verdicts.end()) return verdict;
  }
  return Verdict::nothing_missing;
}

}  // namespace fxdyn::diagnosis

#pragma once

// For headers that only name a model: its content is in effects/identified_model.hpp, and changes there should not
// compile them again.

namespace fxdyn {

struct BroadLearningFit;
struct EffectFit;
struct Formats;
struct IdentifiedModel;
struct JointFit;
struct Session;
struct TableLayout;

}  // namespace fxdyn

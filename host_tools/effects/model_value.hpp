#pragma once

#include <memory>

#include "host_tools/effects/forward.hpp"

namespace fxdyn {

/// A model of one's own, copied as a whole, for those who need no more of it than effects/model_parts.hpp: another
/// field of IdentifiedModel does not compile them again.
class ModelValue {
 public:
  ModelValue();
  ModelValue(const IdentifiedModel& model);  // not explicit: it is that model
  ModelValue(IdentifiedModel&& model);
  ModelValue(const ModelValue& other);
  ModelValue(ModelValue&& other) noexcept;
  ModelValue& operator=(const ModelValue& other);
  ModelValue& operator=(ModelValue&& other) noexcept;
  ~ModelValue();

  operator IdentifiedModel&() { return *model_; }
  operator const IdentifiedModel&() const { return *model_; }
  IdentifiedModel* operator->() { return model_.get(); }
  const IdentifiedModel* operator->() const { return model_.get(); }

 private:
  std::unique_ptr<IdentifiedModel> model_;  ///< nullptr: moved from
};

}  // namespace fxdyn

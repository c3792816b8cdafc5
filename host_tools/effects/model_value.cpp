#include "host_tools/effects/model_value.hpp"

#include <utility>

#include "host_tools/effects/identified_model.hpp"

namespace fxdyn {

ModelValue::ModelValue() : model_(std::make_unique<IdentifiedModel>()) {}
ModelValue::ModelValue(const IdentifiedModel& model) : model_(std::make_unique<IdentifiedModel>(model)) {}
ModelValue::ModelValue(IdentifiedModel&& model) : model_(std::make_unique<IdentifiedModel>(std::move(model))) {}
ModelValue::ModelValue(const ModelValue& other)
    : model_(other.model_ == nullptr ? nullptr : std::make_unique<IdentifiedModel>(*other.model_)) {}
ModelValue::ModelValue(ModelValue&& other) noexcept = default;
ModelValue& ModelValue::operator=(const ModelValue& other) {
  if (this != &other) *this = ModelValue(other);
  return *this;
}
ModelValue& ModelValue::operator=(ModelValue&& other) noexcept {
  // Into the model that is there: references to it stay, as they do with any struct.
  if (model_ != nullptr && other.model_ != nullptr)
    *model_ = std::move(*other.model_);
  else
    model_ = std::move(other.model_);
  return *this;
}
ModelValue::~ModelValue() = default;

}  // namespace fxdyn

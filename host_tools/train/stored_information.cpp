#include "host_tools/train/stored_information.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

constexpr const char* schema = "fxdyn.information/2";

/// Of all that the model says but its tables, which an export makes anew without touching a coefficient.
std::string hash_without_tables(const IdentifiedModel& model) {
  IdentifiedModel bare = model;
  bare.drop_tables();
  return hash_of(to_json(bare).dump());
}

bool fits_drift(const Fitter& fitter) {
  for (std::size_t j = 0; j < fitter.joints(); ++j) {
    for (const EffectFit& fit : fitter.design(j).effects) {
      if (drifts(fit.effect)) return true;
    }
  }
  return false;
}

}  // namespace

StoredInformation stored_information(const Fitter& fitter) {
  const ProcessedLog& log = fitter.logs().front();
  return {.unknowns = fitter.unknowns(),
          .weights = fitter.weights(),
          .row_interval_s = log.step_s * static_cast<double>(log.decimation),
          .fits_drift = fits_drift(fitter),
          .information = fitter.information()};
}

Eigen::VectorXd coefficients_of(const IdentifiedModel& model, const std::vector<JointFit>& design) {
  std::vector<double> all;
  for (const BaseParameter& parameter : model.base) all.push_back(parameter.value);
  for (const JointFit& joint : design) {
    for (const EffectFit& fit : joint.effects) all.insert(all.end(), fit.linear.begin(), fit.linear.end());
    if (joint.bls) all.insert(all.end(), joint.bls->coefficients.begin(), joint.bls->coefficients.end());
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

void write_information(const StoredInformation& stored, const IdentifiedModel& model,
                       const std::filesystem::path& directory) {
  // [R z; 0 rest], row by row from its diagonal on
  const auto& triangle = stored.information.triangle();
  std::vector<double> upper;
  for (Eigen::Index i = 0; i < triangle.rows(); ++i) {
    for (Eigen::Index k = i; k < triangle.cols(); ++k) upper.push_back(triangle(i, k));
  }
  const json document = {{"schema", schema},
                         {"model", hash_without_tables(model)},
                         {"unknowns", stored.unknowns},
                         {"weights", std::vector<double>(stored.weights.begin(), stored.weights.end())},
                         {"row_interval_s", stored.row_interval_s},
                         {"fits_drift", stored.fits_drift},
                         {"rows", stored.information.rows()},
                         {"triangle", upper}};
  const std::vector<std::uint8_t> bytes = json::to_cbor(document);
  write_file(directory / "information.cbor", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

StoredInformation read_information(const IdentifiedModel& model, const std::filesystem::path& directory) {
  const std::filesystem::path file = directory / "information.cbor";
  const auto refuse = [&](const std::string& why) {
    return InputError(fmt::format("{}: {}: run `fxdyn train` and `fxdyn export` first", file.string(), why));
  };
  if (!std::filesystem::exists(file)) throw refuse("is not there, this model was trained without it");
  try {
    const json document = json::from_cbor(read_file(file));
    if (document.value("schema", "") != schema) throw refuse(fmt::format("has not the schema {}", schema));
    if (document.at("model") != hash_without_tables(model)) throw refuse("belongs to another model than model.json");
    StoredInformation out;
    out.unknowns = document.at("unknowns").get<std::vector<std::string>>();
    const auto weights = document.at("weights").get<std::vector<double>>();
    out.weights = Eigen::Map<const Eigen::VectorXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
    out.row_interval_s = document.at("row_interval_s");
    out.fits_drift = document.at("fits_drift");
    const auto upper = document.at("triangle").get<std::vector<double>>();
    const auto size = static_cast<Eigen::Index>(out.unknowns.size()) + 1;
    if (static_cast<Eigen::Index>(upper.size()) != size * (size + 1) / 2 || weights.size() != model.joints.size())
      throw refuse("is not whole");
    SquareRootInformation::RowMajor triangle = SquareRootInformation::RowMajor::Zero(size, size);
    for (Eigen::Index i = 0, at = 0; i < size; ++i) {
      for (Eigen::Index k = i; k < size; ++k) triangle(i, k) = upper[static_cast<std::size_t>(at++)];
    }
    out.information = SquareRootInformation(std::move(triangle), document.at("rows"));
    return out;
  } catch (const json::exception&) {
    throw refuse("is not whole");
  }
}

}  // namespace fxdyn

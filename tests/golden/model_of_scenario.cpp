// model_of_scenario SCENARIO.toml DIR: the scenario's robot and effects as they stand there, with a BLS of drawn
// weights on two joints, exported: model.json and tables.hpp. Nothing is identified, so that the model may have what no
// log tells apart.

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/broad_learning.hpp"

namespace fxdyn {
namespace {

/// Torque limit as share of rated torque.
constexpr double torque_headroom = 1.2;
constexpr Eigen::Index random_states = 20000;

/// A BLS that gives some hundredths of rated torque.
void add_bls(JointFit& joint, const char* inputs, const char* activation, Eigen::Index nodes, std::uint64_t seed) {
  BroadLearningFit bls = test::random_bls(inputs, activation, joint, nodes, 1, seed);
  bls.coefficients *= 0.01 * joint.rated_torque / bls.coefficients.cwiseAbs().maxCoeff();
  joint.bls = bls;
}

IdentifiedModel model_of(const std::filesystem::path& file) {
  const Scenario scenario = read_scenario(file);
  IdentifiedModel model = scenario.plant;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    JointFit& joint = model.joints[j];
    joint.q_lower = scenario.bounds[j].lower;
    joint.q_upper = scenario.bounds[j].upper;
    joint.dq_limit = scenario.bounds[j].velocity;
    joint.ddq_limit = scenario.bounds[j].acceleration;
    joint.tau_limit = torque_headroom * joint.rated_torque;
  }
  // Joint 1 is upright and joint 2's axis meets it: no torque depends on these.
  model.inertia[0].m = model.inertia[0].zz = model.inertia[1].m = 0;
  add_bls(model.joints[1], "physical", "tanh", 20, scenario.seed);
  add_bls(model.joints[3], "extended", "relu", 12, scenario.seed + 1);
  model.project = file.filename().string();
  model.project_hash = scenario_hash(file);
  return model;
}

void make(const std::filesystem::path& scenario, const std::filesystem::path& directory) {
  IdentifiedModel model = model_of(scenario);
  const Formats formats = choose_formats(model);
  model.formats = formats;
  model.layout = layout_of(model, formats);
  const Proof proof = prove(model, &formats);
  const QuantisationError error =
      quantisation_error(model, formats, {within_limits(model, random_states, 77), creeping(model, formats)});
  for (Eigen::Index j = 0; j < error.largest.size(); ++j) {
    if (error.largest[j] > proof.error[j])
      throw DataError(fmt::format("joint {}: off by {} where {} was proven", j + 1, error.largest[j], proof.error[j]));
  }
  std::filesystem::create_directories(directory);
  model.tables_crc = write_tables(model, formats, error, proof.error, all_joints(model), directory);
  write_file(directory / "model.json", to_json(model).dump(1) + "\n");
}

}  // namespace
}  // namespace fxdyn

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fputs("usage: model_of_scenario SCENARIO.toml DIR\n", stderr);
    return 2;
  }
  fxdyn::make(argv[1], argv[2]);
} catch (const std::exception& error) {
  std::fprintf(stderr, "model_of_scenario: %s\n", error.what());
  return 1;
}

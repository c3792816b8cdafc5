#include "host_tools/pipeline/tables_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// |fixed - double| that is observed, of what is accepted as its proven bound.
constexpr double observed_share = 0.1;
/// The proven range of the rigid body's torque is refined until it is no more than this times what is attained ...
constexpr double tight_enough = 2;
/// ... or this many boxes were looked at.
constexpr int proof_boxes = 40'000;
constexpr Eigen::Index random_states = 20'000;

/// Errors of the tables on the logs, and there and on random, creeping and disturbed motion. Of the latter what is
/// counted as saturated is left out: such setpoints jump, and the drive says so.
struct Observed {
  QuantisationError on_logs, anywhere;
};

Observed observe(const IdentifiedModel& model, const Formats& formats, const std::vector<ProcessedLog>& logs) {
  std::vector<TickStates> states, judged;
  for (const ProcessedLog& log : logs) states.push_back(at_ticks(log, model.tick_s));
  judged = states;
  for (std::size_t i = 0; i < states.size(); ++i) judged.push_back(perturbed(states[i], model, 1000 + i));
  judged.push_back(within_limits(model, random_states, 77));
  judged.push_back(creeping(model, formats));
  Observed out{quantisation_error(model, formats, states), quantisation_error(model, formats, judged)};
  out.anywhere.largest = out.anywhere.uncounted.cwiseMax(out.on_logs.largest);
  return out;
}

/// A value that is enough, as one writes it: 0.0234 -> 0.03.
double round_up(double share) {
  const double decade = std::pow(10.0, std::floor(std::log10(share)));
  return std::ceil(share / decade) * decade;
}

/// @throws DataError: the error is above what was proven, or above what is accepted; names the joint that asks for most
void check_errors(const IdentifiedModel& model, const Observed& observed, const Proof& proof, double accepted,
                  const fs::path& reported) {
  const auto name = [&](std::size_t j) { return fmt::format("joint {} ({})", j + 1, model.robot.joints[j].name); };
  std::size_t worst = 0;
  double needed = 0;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    if (observed.anywhere.uncounted[k] > proof.error[k]) {
      throw DataError(fmt::format(
          "{}: fixed point is off by {:.3g}, more than the {:.3g} that were proven: please report this with {}",
          name(j), observed.anywhere.uncounted[k], proof.error[k], reported.string()));
    }
    const double rated = model.joints[j].rated_torque;
    const double seen = observed.anywhere.largest[k] / observed_share / rated, proven = proof.error[k] / rated;
    const double ask = std::isfinite(seen + proven) ? std::max(seen, proven) : INFINITY;
    if (ask <= needed) continue;
    worst = j;
    needed = ask;
  }
  if (needed <= accepted) return;
  const auto k = static_cast<Eigen::Index>(worst);
  const double rated = model.joints[worst].rated_torque, error = observed.anywhere.largest[k] / rated;
  const std::string figures =
      error > observed_share * accepted
          ? fmt::format("fixed point is off by {:.2g} % of rated torque ({:.2g} % on the logs), more than {:.2g} %",
                        100 * error, 100 * observed.on_logs.largest[k] / rated, 100 * observed_share * accepted)
          : fmt::format(
                "fixed point is proven to stay within {:.2g} % of rated torque only ({:.2g} % observed), more "
                "than {:.2g} %",
                100 * proof.error[k] / rated, 100 * error, 100 * accepted);
  const std::string accept =
      needed <= 1 ? fmt::format(
                        ", or accept it with [target] accept_error = {:.1g} and go on with `fxdyn report`, which "
                        "exports: nothing else is computed anew",
                        round_up(needed))
                  : std::string();
  throw DataError(
      fmt::format("{}: {}: no tables are written; narrow the project's [limits] to what the robot does, "
                  "check that URDF and log are of one robot{}",
                  name(worst), figures, accept));
}

fs::path drive_folder(const fs::path& directory, std::size_t joint) {
  return directory / fmt::format("joint_{}", joint + 1);
}

/// Tables of drives that the project no longer asks for would be of another model.
void remove_drives(std::size_t joints, const fs::path& directory) {
  for (std::size_t j = 0; j < joints; ++j) {
    for (const char* name : {"tables.hpp", "tables.bin", "replay.json"}) fs::remove(drive_folder(directory, j) / name);
  }
}

}  // namespace

ExportResult export_tables(IdentifiedModel& model, const Formats& formats, const TargetSettings& target,
                           const std::vector<ProcessedLog>& logs, const fs::path& directory, const fs::path& reported,
                           Progress& progress) {
  progress.stage("proving ranges and errors, writing tables", 4);
  model.formats = formats;
  model.layout = layout_of(model, formats);
  if (model.lineage.sequence == 0) model.lineage = {FixedModel(model, formats).crc(), 1};
  model.lineage.sequence = std::max(model.lineage.sequence, target.sequence);
  const Proof proof = prove(model, &formats);
  progress.step();
  const Attained attained = attain(model);
  const Eigen::VectorXd structural = prove_structural(model, attained.structural, tight_enough, proof_boxes);
  progress.step();
  const Observed observed = observe(model, formats, logs);
  const QuantisationError& error = observed.anywhere;
  progress.step();
  check_errors(model, observed, proof, target.accept_error, reported);
  model.tables_crc = write_tables(model, formats, error, proof.error, all_joints(model), directory);
  ExportResult out{model.tick_s,
                   target.board,
                   model.tables_crc,
                   model.lineage,
                   formats,
                   {},
                   {},
                   observed.on_logs.saturations,
                   fs::file_size(directory / "tables.bin")};
  remove_drives(model.joints.size(), directory);
  for (const std::size_t j : target.joints) {
    const fs::path own = drive_folder(directory, j);
    fs::create_directories(own);
    const std::uint32_t crc = write_tables(model, formats, error, proof.error, 1U << j, own);
    out.drives.push_back({j, crc, fs::file_size(own / "tables.bin")});
  }
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    out.joints.push_back({.name = model.robot.joints[j].name,
                          .unit = model.robot.joints[j].torque_unit(),
                          .rated_torque = model.joints[j].rated_torque,
                          .proven_error = proof.error[k],
                          .largest_error = error.largest[k],
                          .rms_error = error.rms[k],
                          .proven_torque = std::min(proof.torque[k], structural[k] + proof.effects[k]),
                          .attained_torque = attained.total[k],
                          .proven_structural = structural[k],
                          .attained_structural = attained.structural[k]});
  }
  progress.step();
  progress.done();
  return out;
}

}  // namespace fxdyn

#include "host_tools/replay/replay.hpp"

#include <fmt/format.h>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/hil/qemu_target.hpp"
#include "host_tools/report/replay_result.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

struct Replayed {
  Eigen::Index ticks = 0, different_ticks = 0;
  std::uint32_t fewest = UINT32_MAX, most = 0;
  std::uint64_t instructions = 0, saturations = 0;
  Eigen::VectorXd largest_error;  ///< |target - double| [N*m | N]
};

Replayed play(QemuTarget& target, const IdentifiedModel& model, FixedModel& fixed, const TickStates& states,
              Eigen::Index ticks) {
  std::vector<std::int32_t> stream;
  for (Eigen::Index k = 0; k < ticks; ++k) {
    for (const std::int32_t word : raw_states(states, k, fixed.formats())) stream.push_back(word);
  }
  const std::size_t per_tick = 3 * model.robot.size();
  target.reset();
  const std::vector<TickReply> replies = target.run(stream, per_tick);

  fixed.reset();
  Evaluator<Real> exact(with_stored_limits(model, fixed.formats()), model.tick_s);
  Replayed out;
  out.ticks = ticks;
  out.largest_error = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(model.robot.size()));
  std::vector<JointState<Real>> state(model.robot.size());
  Saturations ignored;
  for (std::size_t k = 0; k < replies.size(); ++k) {
    const std::vector<std::int32_t> words(stream.begin() + static_cast<std::ptrdiff_t>(k * per_tick),
                                          stream.begin() + static_cast<std::ptrdiff_t>((k + 1) * per_tick));
    Saturations saturations;
    const std::vector<std::int32_t> expected = fixed.tick(words, saturations);
    out.different_ticks += expected != replies[k].torques || saturations.count != replies[k].saturations;
    const auto& formats = fixed.formats();
    for (std::size_t j = 0; j < state.size(); ++j) {
      state[j] = {from_raw(words[3 * j], formats[Quantity::position]),
                  from_raw(words[3 * j + 1], formats[Quantity::velocity]),
                  from_raw(words[3 * j + 2], formats[Quantity::acceleration])};
    }
    const auto reference = exact.tick(state, ignored);
    for (std::size_t i = 0; i < replies[k].torques.size(); ++i) {
      const std::size_t j = fixed.outputs()[i];
      double& largest = out.largest_error[static_cast<Eigen::Index>(j)];
      largest = std::max(largest, std::fabs(from_raw(replies[k].torques[i], formats[Quantity::torque]) - reference[j]));
    }
    out.fewest = std::min(out.fewest, replies[k].instructions);
    out.most = std::max(out.most, replies[k].instructions);
    out.instructions += replies[k].instructions;
    out.saturations += replies[k].saturations;
  }
  return out;
}

ReplayedLog log_of(const Replayed& replayed, const TickStates& states, const IdentifiedModel& model,
                   const std::vector<std::size_t>& outputs) {
  const double ticks = static_cast<double>(std::max<Eigen::Index>(1, replayed.ticks));
  ReplayedLog out{states.name,
                  replayed.ticks,
                  replayed.different_ticks,
                  replayed.saturations,
                  replayed.fewest,
                  replayed.most,
                  static_cast<double>(replayed.instructions) / ticks,
                  {}};
  for (const std::size_t j : outputs) {
    const double error = replayed.largest_error[static_cast<Eigen::Index>(j)];
    out.joints.push_back({model.robot.joints[j].name, model.robot.joints[j].torque_unit(), j + 1, error,
                          error / model.joints[j].rated_torque});
  }
  return out;
}

/// Where the tables and the replay of these joints are: of all of them, or of a drive with one.
fs::path directory_of(const fs::path& directory, const std::vector<std::size_t>& outputs, std::size_t joints) {
  if (outputs.size() != 1 || joints == 1) return directory;
  return directory / fmt::format("joint_{}", outputs[0] + 1);
}

}  // namespace

Replay replay(Pipeline& pipeline, const fs::path& image, Eigen::Index max_ticks) {
  const IdentifiedModel model = pipeline.exported();
  std::vector<TickStates> streams;
  for (const Role role : {Role::test, Role::validate}) {
    for (const ProcessedLog& log : pipeline.logs(role)) streams.push_back(at_ticks(log, model.tick_s));
  }
  if (streams.size() < 2) {
    for (const ProcessedLog& log : pipeline.logs(Role::train)) streams.push_back(at_ticks(log, model.tick_s));
  }
  streams.push_back(perturbed(streams.front(), model, 7));

  auto target = std::make_unique<QemuTarget>(image);
  serial::Identity identity = target->hello();
  const std::uint32_t all = all_joints(model);
  FixedModel fixed(model, *model.formats, identity.outputs & all);
  const fs::path directory = directory_of(pipeline.directory(), fixed.outputs(), model.robot.size());
  // Tables of an update go into the slot that firmware of the same layout has for them.
  const bool updated = identity.layout_hash == fixed.layout_hash() && identity.tables_crc != fixed.crc();
  if (updated) {
    target.reset();
    QemuTarget::Options options;
    options.update_page = directory / "tables.bin";
    target = std::make_unique<QemuTarget>(image, options);
    identity = target->hello();
  }
  if (identity.state != serial::NodeState::ready)
    throw InputError(fmt::format("{}: the image refuses its tables (CRC or layout)", image.string()));
  if (identity.joints != model.robot.size() || identity.outputs == 0 || (identity.outputs & ~all) != 0 ||
      identity.layout_hash != fixed.layout_hash() || identity.tables_crc != fixed.crc()) {
    throw InputError(
        fmt::format("{}: holds other tables (layout {:08x}, CRC {:08x}; expected {:08x}, {:08x}); build it from {}",
                    image.string(), identity.layout_hash, identity.tables_crc, fixed.layout_hash(), fixed.crc(),
                    (directory / "tables.hpp").string()));
  }
  Progress progress;
  progress.stage("replaying on the firmware", streams.size());
  ReplayResult out;
  out.image = image.filename().string();
  out.tables_crc = fixed.crc();
  out.tables_in = updated ? "update slot" : "image";
  for (const std::size_t joint : fixed.outputs()) out.output_joints.push_back(joint + 1);
  for (const TickStates& states : streams) {
    const Replayed replayed = play(*target, model, fixed, states, std::min(max_ticks, states.t.size()));
    out.logs.push_back(log_of(replayed, states, model, fixed.outputs()));
    progress.step();
  }
  progress.done();
  const fs::path size_file = image.parent_path() / "size.json";
  if (fs::exists(size_file)) out.size = image_size_of(nlohmann::json::parse(read_file(size_file)));
  fs::create_directories(directory);
  write_file(directory / "replay.json", to_json(out).dump(1) + "\n");
  return {out.bit_exact(), directory / "replay.json"};
}

}  // namespace fxdyn

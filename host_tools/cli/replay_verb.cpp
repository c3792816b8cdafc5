#include <fmt/format.h>

#include "host_tools/cli/verb.hpp"
#include "host_tools/replay/replay.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn::cli {
namespace {

struct ReplayOptions {
  std::string image;
  Eigen::Index ticks = 5000;
  std::vector<unsigned> nodes;
  CanReplaySettings can;
};

void replay_on_bus(Pipeline& pipeline, ReplayOptions& options) {
  options.can.most_ticks = options.ticks;
  options.can.nodes.assign(options.nodes.begin(), options.nodes.end());
  const CanReplay done = replay_on_can(pipeline, options.can);
  fmt::print("{}", can_replay_table(done));
  if (const std::uint64_t disabled = done.drives.disabled_ticks; disabled > 0)
    throw DataError(fmt::format(
        "the enable input was low in {} ticks, and no torque goes out then: set it high and replay again", disabled));
  if (!done.drives.bit_exact())
    throw DataError(fmt::format("drives and host differ: see {}", (pipeline.directory() / "can_replay.json").string()));
}

void replay_in_emulator(Pipeline& pipeline, const ReplayOptions& options) {
  if (options.image.empty()) throw InputError("replay: where to? --image drive.elf (QEMU) or --can can0 (drives)");
  const Replay done = replay(pipeline, options.image, options.ticks);
  if (!done.same) throw DataError(fmt::format("firmware and host differ: see {}", done.file.string()));
  fmt::print("bit-exact: {}\n", done.file.string());
  fmt::print("{}", summary_table(pipeline.directory()));
}

}  // namespace

Action add_replay(CLI::App& verb) {
  const auto project = add_project(verb);
  const auto options = std::make_shared<ReplayOptions>();
  auto* image = verb.add_option("--image", options->image, "firmware image (.elf) made by toolchains/build_image.sh");
  auto* can = verb.add_option("--can", options->can.interface, "SocketCAN interface with the drives, e.g. can0")
                  ->excludes(image);
  verb.add_option("--nodes", options->nodes, "node ids (default: whoever answers of 1 .. joints)")
      ->delimiter(',')
      ->check(CLI::Range(1, 127))
      ->needs(can);
  verb.add_flag("--fd", options->can.fd, "CAN FD: all setpoints in one frame")->needs(can);
  verb.add_flag("--closed-loop", options->can.closed_loop,
                "no log: move the scenario's robot with the torque that comes over the bus")
      ->needs(can);
  verb.add_option("--moves", options->can.most_moves, "of the closed loop, the first ones alone (default: all)")
      ->needs(can);
  verb.add_option("--ticks", options->ticks, "at most this many ticks of each log")->capture_default_str();
  return [project, options, can] {
    Pipeline pipeline(project->project, project->out);
    if (can->count() > 0)
      replay_on_bus(pipeline, *options);
    else
      replay_in_emulator(pipeline, *options);
  };
}

}  // namespace fxdyn::cli

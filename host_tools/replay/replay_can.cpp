#include "host_tools/effects/identified_model.hpp"
#include "host_tools/replay/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/can/guard.hpp"
#include "host_tools/hil/can_replay.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/vibration/vibration.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

/// Ticks until a torque has come up its ramp, by far.
constexpr Index lead_in = 250;

/// The highest node id that is no drive's, for the host's heartbeat.
std::uint8_t free_id(const std::vector<std::uint8_t>& nodes) {
  std::uint8_t id = canopen::largest_node_id;
  while (id > 1 && std::find(nodes.begin(), nodes.end(), id) != nodes.end()) --id;
  return id;
}

/// The log's torque at the ticks, linearly in between.
VectorXd measured_at(const ProcessedLog& log, const VectorXd& t, Index joint) {
  VectorXd out(t.size());
  for (Index k = 0, i = 0; k < t.size(); ++k) {
    while (i + 2 < log.t.size() && log.t[i + 1] <= t[k]) ++i;
    const double share = std::clamp((t[k] - log.t[i]) / (log.t[i + 1] - log.t[i]), 0.0, 1.0);
    out[k] = (1 - share) * log.tau(i, joint) + share * log.tau(i + 1, joint);
  }
  return out;
}

CanReplay::PlayedLog play(CanDrives& drives, const ProcessedLog& log, const IdentifiedModel& model, Index most_ticks,
                          Progress& progress) {
  const TickStates states = at_ticks(log, model.tick_s);
  const Index ticks = std::min(most_ticks, states.t.size()), n = states.q.cols();
  drives.restart();
  MatrixXd torque(ticks, n);
  Index equal = 0;
  for (Index k = 0; k < ticks; ++k) {
    const CanDrives::Tick tick = drives.tick(states.q.row(k), states.dq.row(k), states.ddq.row(k));
    equal += tick.equal ? 1 : 0;
    for (Index j = 0; j < n; ++j) torque(k, j) = tick.torque[static_cast<std::size_t>(j)];
    if (k % 500 == 499) progress.step();
  }
  drives.stop();
  CanReplay::PlayedLog out{states.name, ticks, equal, {}};
  // The torque comes up by its ramp at the start: not the model's yet.
  const Index first = std::min<Index>(ticks - 1, lead_in);
  for (Index j = 0; j < n; ++j) {
    const VectorXd measured = measured_at(log, states.t.head(ticks), j);
    const auto rms = [&](const VectorXd& x) {
      return std::sqrt(x.tail(ticks - first).squaredNorm() / static_cast<double>(ticks - first));
    };
    const double error = rms(torque.col(j) - measured);
    const std::size_t i = static_cast<std::size_t>(j);
    CanReplay::Joint joint{model.robot.joints[i].name, model.robot.joints[i].torque_unit(), {}, {}, rms(measured)};
    if (std::isfinite(error)) {
      joint.error_to_measured = error;
      joint.of_rated = error / model.joints[i].rated_torque;
    }
    out.joints.push_back(std::move(joint));
  }
  return out;
}

/// The vibration experiment with the torque that comes over the bus while the plant moves.
VibrationResult in_the_loop(CanDrives& drives, const Pipeline& pipeline, std::size_t most_moves) {
  const std::size_t n = pipeline.project().robot.size();
  const Reference* reference = nullptr;
  Feedforward drive;
  drive.most_moves = most_moves;
  drive.begin = [&](const Reference& next) {
    reference = &next;
    drives.restart();
    // At rest at the start until the torque has come up its ramp: a drive is switched on before the robot moves.
    for (Index k = 0; k < lead_in; ++k) drives.tick(next.q.row(0), next.dq.row(0), next.ddq.row(0));
  };
  drive.torque = [&](Index k) {
    const CanDrives::Tick tick = drives.tick(reference->q.row(k), reference->dq.row(k), reference->ddq.row(k));
    VectorXd tau(static_cast<Index>(n));
    for (std::size_t j = 0; j < n; ++j) {
      if (!std::isfinite(tick.torque[j]))
        throw DataError(fmt::format("no torque came for joint {} at tick {}", j + 1, k));
      tau[static_cast<Index>(j)] = tick.torque[j];
    }
    return tau;
  };
  return vibration_with(pipeline.project().file, pipeline.directory(), drive);
}

}  // namespace

CanReplay replay_on_can(Pipeline& pipeline, const CanReplaySettings& settings) {
  try {
    can::SocketBus bus(settings.interface, settings.fd);
    const std::uint8_t master = free_id(settings.nodes);
    can::Guard guard(settings.interface, master);
    const IdentifiedModel model = pipeline.exported();
    CanDrives drives(bus, model, {settings.nodes, settings.fd, master});
    guard.stop_by_signals(drives.nodes());
    CanReplay out{settings.interface, settings.fd, {}, {}, {}};
    Progress progress;
    if (settings.closed_loop) {
      out.closed_loop = in_the_loop(drives, pipeline, settings.most_moves);
    } else {
      std::vector<ProcessedLog> logs;
      for (const Role role : {Role::test, Role::validate, Role::train}) {
        if (logs.empty() || role == Role::validate)
          for (ProcessedLog& log : pipeline.logs(role)) logs.push_back(std::move(log));
      }
      std::size_t steps = 0;
      for (const ProcessedLog& log : logs)
        steps += static_cast<std::size_t>(std::min(settings.most_ticks, at_ticks(log, model.tick_s).t.size()) / 500);
      progress.stage("replaying over " + settings.interface, std::max<std::size_t>(1, steps));
      for (const ProcessedLog& log : logs) out.logs.push_back(play(drives, log, model, settings.most_ticks, progress));
      progress.done();
    }
    drives.stop();
    out.drives = drives.report();
    write_file(pipeline.directory() / "can_replay.json", to_json(out).dump(1) + "\n");
    return out;
  } catch (const can::BusError& error) {
    throw InputError(error.what());
  } catch (const can::NodeError& error) {
    throw DataError(error.what());
  }
}

json to_json(const CanReplay& result) {
  json out = to_json(result.drives);
  out["schema"] = "fxdyn.can_replay/1";
  out["interface"] = result.interface;
  out["fd"] = result.fd;
  out["bit_exact"] = result.drives.bit_exact();
  if (result.closed_loop) {
    out["closed_loop"] = to_json(*result.closed_loop);
    return out;
  }
  const auto or_null = [](const std::optional<double>& value) { return value ? json(*value) : json(nullptr); };
  json& logs = out["logs"] = json::array();
  for (const CanReplay::PlayedLog& log : result.logs) {
    json joints = json::array();
    for (std::size_t j = 0; j < log.joints.size(); ++j) {
      const CanReplay::Joint& joint = log.joints[j];
      joints.push_back({{"joint", joint.name},
                        {"index", j + 1},
                        {"unit", joint.unit},
                        {"error_to_measured", or_null(joint.error_to_measured)},
                        {"of_rated", or_null(joint.of_rated)},
                        {"measured_rms", joint.measured_rms}});
    }
    logs.push_back({{"log", log.name}, {"ticks", log.ticks}, {"equal_ticks", log.equal_ticks}, {"joints", joints}});
  }
  return out;
}

std::string can_replay_table(const CanReplay& result) {
  std::string out;
  if (result.closed_loop) {
    out += vibration_table(*result.closed_loop);
  } else {
    out += fmt::format("{:<24} {:>8} {:>8}  torque over the bus against the measured one, RMS of rated, %\n", "log",
                       "ticks", "equal");
  }
  for (const CanReplay::PlayedLog& log : result.logs) {
    out += fmt::format("{:<24} {:>8} {:>8} ", log.name, log.ticks, log.equal_ticks);
    for (const CanReplay::Joint& joint : log.joints)
      out += joint.of_rated ? fmt::format(" {:>6.2f}", 100 * *joint.of_rated) : "      -";
    out += "\n";
  }
  const DriveReport& drives = result.drives;
  out += fmt::format(
      "{} of {} ticks equal bit for bit, {} frames lost, round trip p50 {:.2f} p99 {:.2f} max {:.2f} ms, {:.0f} "
      "ticks/s\n",
      drives.equal_ticks, drives.ticks, drives.frames_lost, drives.p50_ms, drives.p99_ms, drives.max_ms,
      drives.ticks_per_second);
  for (const DriveReport::Node& node : drives.nodes) {
    std::vector<std::size_t> joints;
    for (const std::size_t joint : node.joints) joints.push_back(joint + 1);
    out += fmt::format("node {} ({}, fxdyn {}): joints {}, most cost of a tick {}\n", node.id, node.board, node.version,
                       json(joints).dump(), node.most_cost_of_a_tick);
  }
  return out;
}

}  // namespace fxdyn

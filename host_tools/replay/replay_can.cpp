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

json play(CanDrives& drives, const ProcessedLog& log, const IdentifiedModel& model, Index most_ticks,
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
  json joints = json::array();
  // The torque comes up by its ramp at the start: not the model's yet.
  const Index first = std::min<Index>(ticks - 1, lead_in);
  for (Index j = 0; j < n; ++j) {
    const VectorXd measured = measured_at(log, states.t.head(ticks), j);
    const auto rms = [&](const VectorXd& x) {
      return std::sqrt(x.tail(ticks - first).squaredNorm() / static_cast<double>(ticks - first));
    };
    const double error = rms(torque.col(j) - measured);
    const std::size_t i = static_cast<std::size_t>(j);
    joints.push_back({{"joint", model.robot.joints[i].name},
                      {"index", j + 1},
                      {"unit", model.robot.joints[i].torque_unit()},
                      {"error_to_measured", std::isfinite(error) ? json(error) : json(nullptr)},
                      {"of_rated", std::isfinite(error) ? json(error / model.joints[i].rated_torque) : json(nullptr)},
                      {"measured_rms", rms(measured)}});
  }
  return {{"log", states.name}, {"ticks", ticks}, {"equal_ticks", equal}, {"joints", joints}};
}

/// The vibration experiment with the torque that comes over the bus while the plant moves.
json in_the_loop(CanDrives& drives, const Pipeline& pipeline, std::size_t most_moves) {
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
    json document = {{"schema", "fxdyn.can_replay/1"}, {"interface", settings.interface}, {"fd", settings.fd}};
    Progress progress;
    if (settings.closed_loop) {
      document["closed_loop"] = in_the_loop(drives, pipeline, settings.most_moves);
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
      json played = json::array();
      for (const ProcessedLog& log : logs) played.push_back(play(drives, log, model, settings.most_ticks, progress));
      progress.done();
      document["logs"] = played;
    }
    drives.stop();
    document.update(drives.report());
    const bool same = document.at("equal_ticks") == document.at("ticks") && document.at("frames_lost") == 0;
    document["bit_exact"] = same;
    write_file(pipeline.directory() / "can_replay.json", document.dump(1) + "\n");
    return {same, document};
  } catch (const can::BusError& error) {
    throw InputError(error.what());
  } catch (const can::NodeError& error) {
    throw DataError(error.what());
  }
}

std::string can_replay_table(const json& result) {
  std::string out;
  if (result.contains("closed_loop")) out += vibration_table(result.at("closed_loop"));
  if (result.contains("logs")) {
    out += fmt::format("{:<24} {:>8} {:>8}  torque over the bus against the measured one, RMS of rated, %\n", "log",
                       "ticks", "equal");
    for (const json& log : result.at("logs")) {
      out += fmt::format("{:<24} {:>8} {:>8} ", log.at("log").get<std::string>(), log.at("ticks").get<Index>(),
                         log.at("equal_ticks").get<Index>());
      for (const json& joint : log.at("joints"))
        out += joint.at("of_rated").is_null() ? "      -"
                                              : fmt::format(" {:>6.2f}", 100 * joint.at("of_rated").get<double>());
      out += "\n";
    }
  }
  const json& trip = result.at("round_trip_ms");
  out += fmt::format(
      "{} of {} ticks equal bit for bit, {} frames lost, round trip p50 {:.2f} p99 {:.2f} max {:.2f} ms, {:.0f} "
      "ticks/s\n",
      result.at("equal_ticks").get<std::uint64_t>(), result.at("ticks").get<std::uint64_t>(),
      result.at("frames_lost").get<std::uint64_t>(), trip.at("p50").get<double>(), trip.at("p99").get<double>(),
      trip.at("max").get<double>(), result.at("ticks_per_second").get<double>());
  for (const json& node : result.at("nodes"))
    out += fmt::format("node {} ({}, fxdyn {}): joints {}, most cost of a tick {}\n", node.at("id").get<int>(),
                       node.at("board").get<std::string>(), node.at("version").get<std::string>(),
                       node.at("joints").dump(), node.at("most_cost_of_a_tick").get<std::uint32_t>());
  return out;
}

}  // namespace fxdyn

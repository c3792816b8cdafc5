#pragma once

#include <string>
#include <utility>
#include <vector>

#include "host_tools/identify/gate_data.hpp"
#include "tests/support/files.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn::test {

/// A project that names these logs; its file is named after it and says nothing.
inline Project small_project(const std::string& name, const Robot& robot, const std::vector<Log>& logs) {
  Project project;
  project.file = write(name + ".toml", "# the text does not matter here\n");
  project.urdf = project.file;
  project.robot = robot;
  for (const Log& log : logs) {
    LogEntry entry;
    entry.file = log.file;
    entry.role = log.role;
    project.logs.push_back(entry);
  }
  return project;
}

/// The logs as read_gate_data() would have them.
inline GateData small_gate_data(std::vector<Log> logs) {
  GateData data;
  for (const Log& log : logs)
    data.references.push_back({log.file.string(), to_string(log.role), "0f", log.from_s, log.to_s});
  data.filter = small_filter(static_cast<std::size_t>(logs.front().joints()));
  data.logs = processed(std::move(logs));
  return data;
}

/// A train and a validate log of a plant, with white noise on the torque.
inline std::vector<Log> train_and_validate(const IdentifiedModel& plant, double noise) {
  std::vector<Log> logs{exact_log(plant, Role::train, 1), exact_log(plant, Role::validate, 2)};
  for (std::size_t i = 0; i < logs.size(); ++i) add_torque_noise(logs[i], noise, i + 1);
  return logs;
}

}  // namespace fxdyn::test

// check_told RIGHT.toml WRONG.toml [all]: whether the data show a mistake that was put into a project. WRONG has the
// logs of RIGHT in the same order, with other columns, gains or offsets, or another gravity. Prints
//   gained: by the right arrangement over what WRONG says
//   behind: with `all`: what the right arrangement is behind the change that explains most; 0: it is the best
// in nats, and exits with 3 where WRONG is refused before anything is compared.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/support/error.hpp"
#include "tests/check/told.hpp"

namespace {

using namespace fxdyn;
using Eigen::Index;

/// Which column a joint has of a signal.
std::string column(const LogFormat& format, const char* signal, std::size_t joint) {
  const auto named = format.joint_columns.find(signal);
  return named == format.joint_columns.end() ? fmt::format("{}{}", signal, joint + 1) : named->second[joint];
}

/// Which joint of `wrong` has the column that a joint of `right` has.
std::size_t joint_in(const LogFormat& wrong, const LogFormat& right, const char* signal, std::size_t joint,
                     std::size_t joints) {
  for (std::size_t i = 0; i < joints; ++i)
    if (column(wrong, signal, i) == column(right, signal, joint)) return i;
  throw InputError(fmt::format("no joint has the column {}", column(right, signal, joint)));
}

double value(const std::vector<double>& of_joints, std::size_t joint, double otherwise) {
  return of_joints.empty() ? otherwise : of_joints[joint];
}

/// What makes the columns of `wrong` those of `right`.
Arrangement right_for(const Project& right, const Project& wrong) {
  Arrangement out = as_given(right.robot);
  const LogFormat &a = right.logs.front().format, &b = wrong.logs.front().format;
  for (std::size_t j = 0; j < right.robot.size(); ++j) {
    const auto joint = static_cast<Index>(j);
    const std::size_t motion = joint_in(b, a, "q", j, right.robot.size());
    const std::size_t torque = joint_in(b, a, "tau", j, right.robot.size());
    out.motion_from[j] = static_cast<Index>(motion);
    out.torque_from[j] = static_cast<Index>(torque);
    out.motion_gain[joint] = value(a.position_gain, j, 1) / value(b.position_gain, motion, 1);
    out.motion_offset[joint] =
        value(a.position_offset, j, 0) - out.motion_gain[joint] * value(b.position_offset, motion, 0);
    out.torque_gain[joint] = value(a.torque_gain, j, 1) / value(b.torque_gain, torque, 1);
  }
  return out;
}

/// By how much another change explains the samples better.
double behind(const ArrangementEvidence& evidence, const Arrangement& right) {
  ArrangementOptions any;  // also what is too little to be reported
  any.vague_gain = 0;
  const double of_right = test::nats_with_a_spring(evidence, right);
  double most = 0;
  for (const ArrangementFinding& finding : find_mistakes(evidence, any))
    most = std::max(most, of_right - test::nats_with_a_spring(evidence, finding.move.result));
  return most;
}

int run(const char* right_file, const char* wrong_file, bool all) {
  const ArrangementOptions options;
  const Project right = read_project(right_file), wrong = read_project(wrong_file);
  const GateData gate = read_gate_data(wrong, std::filesystem::path(wrong_file).parent_path());
  const double lead_s = wrong.signals.torque_lead_s.value_or(0);
  const ArrangementEvidence evidence(wrong.robot, sample_torque(gate.logs, options.samples, lead_s), options);
  const Arrangement arrangement = right_for(right, wrong);
  fmt::print("{{\"gained\": {:.1f}, \"needed\": {}", test::gained_by(evidence, arrangement), options.gain);
  if (all) fmt::print(", \"behind\": {:.1f}", behind(evidence, arrangement));
  fmt::print("}}\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc == 3 || argc == 4) return run(argv[1], argv[2], argc == 4);
    fmt::print(stderr, "check_told RIGHT.toml WRONG.toml [all]\n");
  } catch (const fxdyn::InputError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 3;
  } catch (const std::exception& error) {
    fmt::print(stderr, "check_told: {}\n", error.what());
  }
  return 2;
}

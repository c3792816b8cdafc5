// make_golden DIR OUT.hpp [TICKS RUNS]: golden vectors of the exported model in DIR (model.json), computed by the
// host's fixed point; TICKS a run, RUNS with random setpoints of a kind.

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <exception>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

/// How much of it.
struct Extent {
  Eigen::Index ticks_per_run = 100;  ///< then the state is reset
  int random_runs = 2;               ///< of a kind
};

double side(Random& random) { return random.uniform() < 0.5 ? -1 : 1; }

/// One run of ticks with setpoints between the joints' limits times `reach`; `corners`: only at the ends.
TickStates random_run(const IdentifiedModel& model, Eigen::Index ticks_per_run, Random& random, double reach,
                      bool corners) {
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  TickStates run;
  run.t = Eigen::VectorXd::LinSpaced(ticks_per_run, 0, 1);
  run.q = run.dq = run.ddq = Eigen::MatrixXd(ticks_per_run, n);
  for (Eigen::Index k = 0; k < ticks_per_run; ++k) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const JointFit& joint = model.joints[static_cast<std::size_t>(j)];
      const auto part = [&] { return reach * (corners ? side(random) : random.uniform(-1, 1)); };
      run.q(k, j) = 0.5 * (joint.q_upper + joint.q_lower) + part() * 0.5 * (joint.q_upper - joint.q_lower);
      run.dq(k, j) = part() * joint.dq_limit;
      run.ddq(k, j) = part() * joint.ddq_limit;
    }
  }
  return run;
}

/// A smooth motion with reversals, slow enough that the effects which remember the path matter.
TickStates smooth_run(const IdentifiedModel& model, Eigen::Index ticks_per_run, double amplitude) {
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  TickStates run;
  run.t = Eigen::VectorXd::LinSpaced(ticks_per_run, 0, model.tick_s * static_cast<double>(ticks_per_run - 1));
  run.q = run.dq = run.ddq = Eigen::MatrixXd(ticks_per_run, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double w = 30 + 5 * static_cast<double>(j);
    const JointFit& joint = model.joints[static_cast<std::size_t>(j)];
    for (Eigen::Index k = 0; k < ticks_per_run; ++k) {
      run.q(k, j) = 0.5 * (joint.q_upper + joint.q_lower) + amplitude * std::sin(w * run.t[k]);
      run.dq(k, j) = amplitude * w * std::cos(w * run.t[k]);
      run.ddq(k, j) = -amplitude * w * w * std::sin(w * run.t[k]);
    }
  }
  return run;
}

/// A bus that stopped: the same setpoints over and over.
TickStates held_run(const IdentifiedModel& model, Eigen::Index ticks_per_run, Random& random) {
  TickStates run = random_run(model, ticks_per_run, random, 1, false);
  for (Eigen::MatrixXd* column : {&run.q, &run.dq, &run.ddq})
    *column = column->row(0).replicate(ticks_per_run, 1).eval();
  return run;
}

std::string array_text(const char* type, const char* name, const std::vector<std::int64_t>& values,
                       std::size_t a_line) {
  std::string text = fmt::format("inline constexpr std::array<{}, {}> {}{{\n", type, values.size(), name);
  for (std::size_t i = 0; i < values.size(); ++i) {
    // -2147483648 is not one literal in C++
    text += values[i] == INT32_MIN ? "(-2147483647 - 1)," : fmt::format("{},", values[i]);
    if ((i + 1) % a_line == 0) text += "\n";
  }
  return text + "};\n";
}

void make(const std::filesystem::path& directory, const std::filesystem::path& out, const Extent& extent) {
  const auto [ticks, copies] = extent;
  const IdentifiedModel model = read_model(directory / "model.json");
  FixedModel fixed(model, model.formats.value());
  Random random(20260911);
  std::vector<TickStates> runs{smooth_run(model, ticks, 0.002), smooth_run(model, ticks, 0.05)};
  for (int i = 0; i < copies; ++i) runs.push_back(random_run(model, ticks, random, 1, true));
  for (int i = 0; i < copies; ++i) runs.push_back(random_run(model, ticks, random, 1, false));
  for (int i = 0; i < copies; ++i) runs.push_back(random_run(model, ticks, random, 3, false));  // beyond the limits
  runs.push_back(random_run(model, ticks, random, 1e9, true));  // the ends of the words themselves
  runs.push_back(held_run(model, ticks, random));

  std::vector<std::int64_t> setpoints, torques, saturation_counts;
  for (const TickStates& run : runs) {
    fixed.reset();
    for (Eigen::Index k = 0; k < ticks; ++k) {
      Saturations saturations;
      const std::vector<std::int32_t> words = raw_states(run, k, fixed.formats());
      const std::vector<std::int32_t> tau = fixed.tick(words, saturations);
      setpoints.insert(setpoints.end(), words.begin(), words.end());
      torques.insert(torques.end(), tau.begin(), tau.end());
      saturation_counts.push_back(saturations.count);
    }
  }
  std::size_t effects = 0, nodes = 0;
  for (const JointFit& joint : model.joints) {
    effects += joint.effects.size();
    nodes += joint.bls ? static_cast<std::size_t>(joint.bls->nodes()) : 0;
  }
  const std::size_t joints = model.robot.size();
  write_file(out,
             fmt::format("// Generated by tests/golden/make.sh. Do not edit: make it anew, together with tables.hpp.\n"
                         "#pragma once\n\n#include <array>\n#include <cstddef>\n#include <cstdint>\n\n"
                         "namespace fxdyn::golden {{\n\n"
                         "inline constexpr std::uint32_t tables_crc = {}U;\n"
                         "inline constexpr std::uint32_t joints = {}, effects = {}, bls_nodes = {};  // in all joints\n"
                         "inline constexpr std::size_t ticks = {}, ticks_per_run = {};  // at rest before each run\n\n"
                         "// q, dq, ddq of every joint, a line a tick\n{}\n// torques\n{}\n// a tick\n{}\n"
                         "}}  // namespace fxdyn::golden\n",
                         model.tables_crc, joints, effects, nodes, saturation_counts.size(), ticks,
                         array_text("std::int32_t", "setpoints", setpoints, 3 * joints),
                         array_text("std::int32_t", "torques", torques, joints),
                         array_text("std::uint8_t", "saturations", saturation_counts, 50)));
}

}  // namespace
}  // namespace fxdyn

int main(int argc, char** argv) try {
  if (argc != 3 && argc != 5) {
    std::fputs("usage: make_golden DIR OUT.hpp [TICKS RUNS]\n", stderr);
    return 2;
  }
  fxdyn::Extent extent;
  if (argc == 5) extent = {std::atoi(argv[3]), std::atoi(argv[4])};
  fxdyn::make(argv[1], argv[2], extent);
} catch (const std::exception& error) {
  std::fprintf(stderr, "make_golden: %s\n", error.what());
  return 1;
}

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/excite/excite.hpp"
#include "host_tools/excite/paper_table1.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {

using nlohmann::json;
namespace fs = std::filesystem;

Table1 paper_table1() {
  Table1 out;
  for (const paper::Series& series : paper::table1) {
    out.printed.push_back({series.q0, Eigen::Map<const Eigen::VectorXd>(series.a.data(), 5),
                           Eigen::Map<const Eigen::VectorXd>(series.b.data(), 5)});
    out.projected.push_back(out.printed.back());
    project_onto_boundary_conditions(out.projected.back());
  }
  out.printed_motion = play(out.printed, paper::period_s, 1, paper::step_s);
  out.printed_motion.name = "table1_printed";
  out.projected_motion = play(out.projected, paper::period_s, 1, paper::step_s);
  out.projected_motion.name = "table1_projected";
  return out;
}

namespace {

/// |after - before| / |before|
double change(const Eigen::VectorXd& before, const Eigen::VectorXd& after) {
  return (after - before).norm() / before.norm();
}

json ranges(const Motion& motion, Eigen::Index joint) {
  return {{"q", {motion.q.col(joint).minCoeff(), motion.q.col(joint).maxCoeff()}},
          {"dq", motion.dq.col(joint).cwiseAbs().maxCoeff()},
          {"ddq", motion.ddq.col(joint).cwiseAbs().maxCoeff()}};
}

}  // namespace

std::string excite_paper(const fs::path& directory) {
  const Table1 table = paper_table1();
  json joints = json::array();
  std::string text = fmt::format(
      "\nTable 1 at t = 0: all of these should be zero{:>12}changes by\n{:<8}{:>12}{:>14}{:>16}"
      "{:>12}{:>10}\n",
      "", "joint", "q - q0 [rad]", "dq [rad/s]", "ddq [rad/s^2]", "|a|", "|b|");
  std::vector<std::string> names;
  for (std::size_t j = 0; j < table.printed.size(); ++j) {
    const FourierJoint &printed = table.printed[j], &projected = table.projected[j];
    const auto column = static_cast<Eigen::Index>(j);
    const FourierState at = evaluate(printed, paper::period_s, 0), after = evaluate(projected, paper::period_s, 0);
    const double a = change(printed.a, projected.a), b = change(printed.b, projected.b);
    const auto vector = [](const Eigen::VectorXd& v) { return std::vector<double>(v.begin(), v.end()); };
    names.push_back(fmt::format("joint {}", j + 1));
    joints.push_back(
        {{"joint", j + 1},
         {"q0", printed.centre},
         {"start_printed", {{"q_less_q0", at.q - printed.centre}, {"dq", at.dq}, {"ddq", at.ddq}}},
         {"start_projected", {{"q_less_q0", after.q - projected.centre}, {"dq", after.dq}, {"ddq", after.ddq}}},
         {"change_of_a", a},
         {"change_of_b", b},
         {"projected_a", vector(projected.a)},
         {"projected_b", vector(projected.b)},
         {"range_printed", ranges(table.printed_motion, column)},
         {"range_projected", ranges(table.projected_motion, column)}});
    text += fmt::format("{:<8}{:>12.4f}{:>14.4f}{:>16.4f}{:>10.0f} %{:>8.0f} %\n", j + 1, at.q - printed.centre, at.dq,
                        at.ddq, 100 * a, 100 * b);
  }
  const Motion& projected = table.projected_motion;
  text += fmt::format("\nprojected onto them: q {:.2f} .. {:.2f} rad, |dq| <= {:.2f} rad/s, |ddq| <= {:.2f} rad/s^2\n",
                      projected.q.minCoeff(), projected.q.maxCoeff(), projected.dq.cwiseAbs().maxCoeff(),
                      projected.ddq.cwiseAbs().maxCoeff());
  for (const Motion* motion : {&table.printed_motion, &table.projected_motion}) {
    write_motion(directory, *motion, names, "rad");
  }
  const json out{{"schema", "fxdyn.excite_paper/1"},
                 {"source", "Appl. Sci. 2025, 15, 7679, Table 1"},
                 {"period_s", paper::period_s},
                 {"step_s", paper::step_s},
                 {"joints", joints}};
  write_file(directory / "table1.json", out.dump(1) + "\n");
  return text + fmt::format("written: {}\n", (directory / "table1.json").string());
}

}  // namespace fxdyn

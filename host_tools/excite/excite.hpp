#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "host_tools/excite/plan.hpp"

namespace fxdyn {

/// Plans the trajectories of a project and writes them to `directory`: <name>.csv (t, q, dq, ddq at the plan's step)
/// and <name>.svg each, and excite.json. Returns the table for the terminal.
/// @throws InputError, DataError as make_plan(); then nothing is written.
std::string excite(const Project& project, const std::filesystem::path& directory, Progress& progress);

/// The same of a robot's motion.
void write_motion(const std::filesystem::path& directory, const Motion& motion, const Robot& robot);

/// An entry of the key "trajectories" of excite.json.
nlohmann::json trajectory_json(const PlannedTrajectory& trajectory, const Robot& robot);

/// NAME.csv and NAME.svg of a motion; joint names for the key of the plot, the unit of position for its axes.
void write_motion(const std::filesystem::path& directory, const Motion& motion, const std::vector<std::string>& names,
                  const std::string& unit);

/// The paper's Table 1 and its nearest coefficients that meet its boundary conditions.
struct Table1 {
  std::vector<FourierJoint> printed, projected;
  Motion printed_motion, projected_motion;  ///< one period
};
Table1 paper_table1();

/// The trajectory of the paper's Table 1 as printed and projected onto its boundary conditions (least change of the
/// coefficients): table1_printed and table1_projected as .csv and .svg, and table1.json with q, dq, ddq at the start
/// (position less its offset), the relative change of the coefficients and the ranges. Returns the table for the
/// terminal.
std::string excite_paper(const std::filesystem::path& directory);

}  // namespace fxdyn

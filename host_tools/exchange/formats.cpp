#include "host_tools/exchange/formats.hpp"

#include <fmt/format.h>

#include <array>

#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

std::span<const ExportFormat> export_formats() {
  static constexpr std::array all{
      ExportFormat{"urdf", "the project's URDF with the identified bodies and <dynamics damping friction>",
                   "simulator.urdf", "urdfdom", false, write_urdf_dynamics, replay_urdf},
      ExportFormat{"mjcf", "MuJoCo: bodies, joints with damping, frictionloss and armature, one motor a joint",
                   "simulator.xml", "MuJoCo", true, write_mjcf, replay_mjcf},
      ExportFormat{"sdf", "Gazebo: bodies, joints with <dynamics> damping and friction, and their limits",
                   "simulator.sdf", "libsdformat", false, write_sdf, replay_sdf},
      ExportFormat{"drake", "Drake: a URDF with damping and the rotors' inertias; Drake's joints have no dry friction",
                   "simulator_drake.urdf", own_reader, true, write_drake, replay_drake, false, false, false, false,
                   nullptr, false},
      ExportFormat{"isaaclab",
                   "Isaac Lab and mjlab: actuators in Python, with ranges to randomise them; bodies as URDF",
                   "simulator_isaaclab.py", own_reader, true, write_isaaclab, replay_isaaclab, false, false, true},
      ExportFormat{"bam", "BAM: friction models m1 to m6 of each joint as JSON; bodies as URDF", "simulator_bam.json",
                   own_reader, true, write_bam, replay_bam, true, true, false, false, bam_model},
      ExportFormat{"usd", "USD: a layer with PhysX joint friction and armature; bodies as URDF", "simulator_usd.usda",
                   own_reader, true, write_usd, replay_usd},
      ExportFormat{"inverse_dynamics_solver",
                   "ROS 2: a plug-in of inverse_dynamics_solver with the whole model, from the drive's tables",
                   "inverse_dynamics_solver", own_reader, true, write_solver_package, replay_tables, true, true, false,
                   true},
  };
  return all;
}

std::string export_format_names() {
  std::string out;
  for (const ExportFormat& format : export_formats()) out += (out.empty() ? "" : ", ") + std::string(format.name);
  return out;
}

const ExportFormat& export_format(const std::string& name) {
  for (const ExportFormat& format : export_formats()) {
    if (name == format.name) return format;
  }
  throw InputError(fmt::format("export: --to {}: no such format; there are {}", name, export_format_names()));
}

}  // namespace fxdyn

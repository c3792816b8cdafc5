#include "host_tools/exchange/formats.hpp"

#include <fmt/format.h>

#include <array>

#include "host_tools/exchange/own_reading.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

constexpr std::array all_formats{
    ExportFormat{
        .name = "urdf",
        .help = "the project's URDF with the identified bodies and <dynamics damping friction>",
        .file = "simulator.urdf",
        .reader = "urdfdom",
        .write = write_urdf_dynamics,
        .replay = replay_urdf,
    },
    ExportFormat{
        .name = "mjcf",
        .help = "MuJoCo: bodies, joints with damping, frictionloss and armature, one motor a joint",
        .file = "simulator.xml",
        .reader = "MuJoCo",
        .has_armature = true,
        .write = write_mjcf,
        .replay = replay_mjcf,
    },
    ExportFormat{
        .name = "sdf",
        .help = "Gazebo: bodies, joints with <dynamics> damping and friction, and their limits",
        .file = "simulator.sdf",
        .reader = "libsdformat",
        .write = write_sdf,
        .replay = replay_sdf,
    },
    ExportFormat{
        .name = "drake",
        .help = "Drake: a URDF with damping and the rotors' inertias; Drake's joints have no dry friction",
        .file = "simulator_drake.urdf",
        .reader = own_reader,
        .has_armature = true,
        .write = write_drake,
        .replay = replay_drake,
        .has_dry_friction = false,
    },
    ExportFormat{
        .name = "isaaclab",
        .help = "Isaac Lab and mjlab: actuators in Python, with ranges to randomise them; bodies as URDF",
        .file = "simulator_isaaclab.py",
        .reader = own_reader,
        .has_armature = true,
        .write = write_isaaclab,
        .replay = replay_isaaclab,
        .has_ranges = true,
    },
    ExportFormat{
        .name = "bam",
        .help = "BAM: friction models m1 to m6 of each joint as JSON; bodies as URDF",
        .file = "simulator_bam.json",
        .reader = own_reader,
        .has_armature = true,
        .write = write_bam,
        .replay = replay_bam,
        .has_stribeck = true,
        .has_load = true,
        .friction_model = bam_model,
    },
    ExportFormat{
        .name = "usd",
        .help = "USD: a layer with PhysX joint friction and armature; bodies as URDF",
        .file = "simulator_usd.usda",
        .reader = own_reader,
        .has_armature = true,
        .write = write_usd,
        .replay = replay_usd,
    },
    ExportFormat{
        .name = "inverse_dynamics_solver",
        .help = "ROS 2: a plug-in of inverse_dynamics_solver with the whole model, from the drive's tables",
        .file = "inverse_dynamics_solver",
        .reader = own_reader,
        .has_armature = true,
        .write = write_solver_package,
        .replay = replay_tables,
        .has_stribeck = true,
        .has_load = true,
        .whole_model = true,
    },
};

}  // namespace

std::span<const ExportFormat> export_formats() { return all_formats; }

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

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/exchange/xml_text.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "model/torque_terms.hpp"

// A package of ROS 2 with a plug-in of inverse_dynamics_solver (Petrone, Ferrentino, Chiacchio; its interface is
// inverse_dynamics_solver/inverse_dynamics_solver.hpp). The plug-in is a thin shell around TorqueTerms and the drive's
// own tables, so the whole model is in it.

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

constexpr const char* manifest = R"(<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>Inverse dynamics of {robot}, identified by fxdyn.</description>
  <maintainer email="nobody@example.org">written by fxdyn</maintainer>
  <license>Proprietary</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <depend>inverse_dynamics_solver</depend>
  <depend>pluginlib</depend>
  <depend>rclcpp</depend>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
)";

constexpr const char* build = R"(# Written by fxdyn. It needs the headers of fxdyn: package libfxdyn-dev.
cmake_minimum_required(VERSION 3.22)
project({package} LANGUAGES CXX)
find_package(ament_cmake REQUIRED)
find_package(inverse_dynamics_solver REQUIRED)
find_package(pluginlib REQUIRED)
find_package(rclcpp REQUIRED)
find_package(fxdyn REQUIRED)

add_library({package} SHARED src/solver.cpp)
target_compile_features({package} PRIVATE cxx_std_20)
target_link_libraries({package} PRIVATE fxdyn::model)
ament_target_dependencies({package} inverse_dynamics_solver pluginlib rclcpp)

pluginlib_export_plugin_description_file(inverse_dynamics_solver plugins.xml)
install(TARGETS {package} LIBRARY DESTINATION lib)
ament_package()
)";

constexpr const char* description = R"(<library path="{package}">
  <class name="{package}/Solver" type="{package}::Solver" base_class_type="inverse_dynamics_solver::InverseDynamicsSolver">
    <description>Inverse dynamics of {robot}, identified by fxdyn.</description>
  </class>
</library>
)";

constexpr const char* source = R"(// Written by fxdyn. The torque is that of the drive's tables, tables.hpp.
#include <inverse_dynamics_solver/inverse_dynamics_solver.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/logging.hpp>

#include <stdexcept>
#include <string>
#include <type_traits>

#include "model/torque_terms.hpp"
#include "tables.hpp"

namespace {package} {{

/// Joints in this order: {joints}.
class Solver : public inverse_dynamics_solver::InverseDynamicsSolver {{
 public:
  using Terms = fxdyn::TorqueTerms<fxdyn::tables::Model>;
  using Vector = Eigen::VectorXd;

  /// Nothing to read: everything is in the tables.
  void initialize(rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr, const std::string&,
                  const std::string&) override {{}}
  Eigen::MatrixXd getInertiaMatrix(const Vector& q) const override {{
    return told([&](fxdyn::Saturations& cut) {{ return terms_.inertia(sized(q), cut); }});
  }}
  /// What the sign of the velocity does not change.
  Vector getCoriolisVector(const Vector& q, const Vector& dq) const override {{
    return told([&](fxdyn::Saturations& cut) {{ return terms_.coriolis(sized(q), sized(dq), cut); }});
  }}
  /// With springs and offsets.
  Vector getGravityVector(const Vector& q) const override {{
    return told([&](fxdyn::Saturations& cut) {{ return terms_.gravity(sized(q), cut); }});
  }}
  Vector getFrictionVector(const Vector& dq) const override {{
    return told([&](fxdyn::Saturations& cut) {{ return terms_.friction(sized(dq), cut); }});
  }}
  /// Without friction, as the interface has it: the robot's torque is getTorques() + getFrictionVector().
  Vector getTorques(const Vector& q, const Vector& dq, const Vector& ddq) const override {{
    return told([&](fxdyn::Saturations& cut) {{ return terms_.torque_without_friction(sized(q), sized(dq), sized(ddq), cut); }});
  }}

 private:
  static Terms::Column sized(const Vector& x) {{
    if (x.size() != Terms::joints)
      throw std::invalid_argument("{package}: " + std::to_string(x.size()) + " joints instead of {count}: {joints}");
    return x;
  }}
  template <class Get>
  static std::invoke_result_t<Get, fxdyn::Saturations&> told(Get get) {{
    fxdyn::Saturations cut;
    auto out = get(cut);
    if (cut.count != 0)
      RCLCPP_WARN_ONCE(rclcpp::get_logger("{package}"), "a state is beyond the limits of the model and was limited");
    return out;
  }}
  Terms terms_{{fxdyn::tables::parameters}};
}};

}}  // namespace {package}

PLUGINLIB_EXPORT_CLASS({package}::Solver, inverse_dynamics_solver::InverseDynamicsSolver)
)";

/// As REP 144 has it: lower case, digits and single underscores.
std::string package_of(const std::string& robot) {
  std::string out = "fxdyn_";
  for (const char c : robot + "_solver") {
    const auto letter = static_cast<unsigned char>(c);
    if (std::isalnum(letter) != 0 && letter < 0x80) {
      out += static_cast<char>(std::tolower(letter));
    } else if (out.back() != '_') {
      out += '_';
    }
  }
  return out;
}

/// TorqueTerms::torque() at each row of the motion, of a tick that gives a vector of torques.
/// @param still two torques that differ by less are equal; 0: in fixed point [N*m | N]
template <class Reset, class Tick>
Eigen::MatrixXd settled_torques(Eigen::Index rows, Eigen::Index joints, double still, Reset&& reset, Tick&& tick) {
  Eigen::MatrixXd out(rows, joints);
  for (Eigen::Index row = 0; row < rows; ++row) {
    reset();
    Eigen::VectorXd tau = tick(row);
    for (int count = 1, equal = 1; count < SettledTorque::most_ticks && equal < SettledTorque::equal_ticks; ++count) {
      const Eigen::VectorXd next = tick(row);
      equal = (next - tau).cwiseAbs().maxCoeff() <= still ? equal + 1 : 1;
      tau = next;
    }
    out.row(row) = tau;
  }
  return out;
}

}  // namespace

void write_solver_package(const SimpleRobot& robot, const fs::path& folder) {
  std::string joints;
  for (const Joint& joint : robot.robot.joints) joints += (joints.empty() ? "" : ", ") + joint.name;
  if (joints.find_first_of("\"\\\n") != std::string::npos)
    throw InputError(
        fmt::format("export --to inverse_dynamics_solver: joint names with quotes don't fit C++: {}", joints));
  const std::string package = package_of(robot.robot.name);
  const auto text = [&](const char* form, const std::string& name) {
    return fmt::format(fmt::runtime(form), fmt::arg("package", package), fmt::arg("robot", name),
                       fmt::arg("joints", joints), fmt::arg("count", robot.robot.size()));
  };
  fs::create_directories(folder / "src");
  write_file(folder / "package.xml", text(manifest, escaped(robot.robot.name)));
  write_file(folder / "plugins.xml", text(description, escaped(robot.robot.name)));
  write_file(folder / "CMakeLists.txt", text(build, robot.robot.name));
  write_file(folder / "src/tables.hpp", read_file(folder.parent_path() / "tables.hpp"));
  write_file(folder / "src/solver.cpp", text(source, robot.robot.name));
}

ReplayedTorque replay_tables(const fs::path&, const IdentifiedModel& expected, const MotionRows& motion, double) {
  const Formats& formats = formats_of(expected);
  FixedModel fixed(expected, formats);
  const TickStates states("", {}, motion.q, motion.dq, motion.ddq);
  Saturations ignored;
  ReplayedTorque out;
  out.tau = settled_torques(
      motion.q.rows(), motion.q.cols(), 0, [&] { fixed.reset(); },
      [&](Eigen::Index row) {
        const std::vector<std::int32_t> raw = fixed.tick(raw_states(states, row, formats), ignored);
        Eigen::VectorXd tau(motion.q.cols());
        for (std::size_t i = 0; i < raw.size(); ++i)
          tau[static_cast<Eigen::Index>(i)] = from_raw(raw[i], formats[Quantity::torque]);
        return tau;
      });
  out.sliding = Eigen::MatrixXd::Ones(out.tau.rows(), out.tau.cols());
  return out;
}

Eigen::MatrixXd settled(const IdentifiedModel& model, const MotionRows& motion) {
  Evaluator<Real> evaluator(with_stored_limits(model, formats_of(model)), tick_of(model));
  Saturations ignored;
  const Eigen::Index joints = motion.q.cols();
  return settled_torques(
      motion.q.rows(), joints, from_raw(1, formats_of(model)[Quantity::torque]), [&] { evaluator.reset(); },
      [&](Eigen::Index row) {
        std::vector<JointState<Real>> states(static_cast<std::size_t>(joints));
        for (Eigen::Index j = 0; j < joints; ++j)
          states[static_cast<std::size_t>(j)] = {motion.q(row, j), motion.dq(row, j), motion.ddq(row, j)};
        const auto tau = evaluator.tick(states, ignored);
        return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(tau.data(), joints));
      });
}

std::vector<std::string> settled_effects(const IdentifiedModel& model, std::size_t joint) {
  std::vector<std::string> out;
  for (const EffectFit& fit : joints_of(model).at(joint).effects) {
    if (find_effect(fit.effect)->remembers) out.push_back(fit.effect);
  }
  const auto& bls = joints_of(model)[joint].bls;
  if (bls && bls->inputs != StateInputs::name) out.emplace_back("bls");
  return out;
}

}  // namespace fxdyn

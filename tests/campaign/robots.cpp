#include "tests/campaign/case.hpp"

#include <mutex>

namespace fxdyn::campaign {

const std::vector<TestRobot>& test_robots() {
  static const std::vector<TestRobot> robots{
      {"puma560",
       "host_tools/demo/puma560.urdf",
       {97.6, 186.4, 89.4, 24.2, 20.1, 21.3},
       {6, 6, 9, 18, 18, 18},
       {5.8, 9.5, 4.0, 0.41, 0.43, 0.22},
       {7.0, 10.6, 6.3, 1.07, 0.85, 0.7},
       {0.002, 0.004, 0.006, 0.012, 0.008, 0.02},
       {0.9, -1.5, 0.6, 0.1, -0.08, 0.05},
       {1.14, 4.71, 0.827, 0.2, 0.179, 0.193}},
      {"ur10_like",
       "tests/excite/ur10_like.urdf",
       {330, 330, 150, 54, 54, 54},
       {8, 8, 12, 16, 16, 16},
       {14, 17, 9, 2.2, 2.4, 1.8},
       {13, 15, 9, 3.1, 2.6, 2.9},
       {0.01, 0.006, 0.015, 0.03, 0.02, 0.012},
       {1.2, 0.5, -0.8, 0.2, -0.15, 0.1},
       {6.2, 6.2, 2.6, 0.55, 0.55, 0.55}},
      {"scara_like",
       "tests/campaign/scara.urdf",
       {140, 62, 160, 7.5},
       {22, 30, 7, 70},
       {2.6, 1.1, 28, 0.055},
       {3.9, 1.7, 9, 0.21},
       {0.02, 0.03, 0.004, 0.05},
       {-0.4, 0.2, 1.5, 0.02},
       {0.62, 0.24, 4.0, 0.012}},
      {"arm",
       "tests/campaign/arm.urdf",
       {60, 20},
       {8, 12},
       {1.5, 0.6},
       {2.0, 0.8},
       {0.015, 0.015},
       {0.3, -0.12},
       {0.2, 0.08}},
  };
  return robots;
}

std::string to_string(Group group) {
  switch (group) {
    case Group::single:
      return "single";
    case Group::mujoco:
      return "mujoco";
    case Group::clean:
      return "clean";
    case Group::changed_friction:
      return "changed_friction";
    case Group::pair:
      return "pair";
    case Group::outside:
      return "outside";
    case Group::no_baseline:
      return "no_baseline";
    case Group::background:
      return "background";
    case Group::dual_encoder:
      return "dual_encoder";
    case Group::controlled:
      return "controlled";
    case Group::drawn:
      return "drawn";
  }
  return "";
}

std::string to_string(Friction friction) {
  switch (friction) {
    case Friction::catalogue:
      return "catalogue";
    case Friction::lugre:
      return "lugre";
    case Friction::maxwell:
      return "maxwell";
    case Friction::smooth_sign:
      return "smooth_sign";
  }
  return "";
}

const TestRobot& robot_of(const Case& wanted) {
  if (!wanted.drawn_robot) return test_robots()[wanted.robot];
  static std::mutex mutex;
  static std::map<std::uint64_t, TestRobot> drawn;  // references to a map's values stay
  const std::lock_guard lock(mutex);
  const auto known = drawn.find(*wanted.drawn_robot);
  if (known != drawn.end()) return known->second;
  return drawn.emplace(*wanted.drawn_robot, draw_robot(*wanted.drawn_robot)).first->second;
}

}  // namespace fxdyn::campaign

#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// One test log as the methods see it; torques are filtered alike but for the measured one, samples x joints [N*m | N].
struct ComparedLog {
  std::string log;
  const Robot* robot = nullptr;
  Eigen::VectorXd t;
  Eigen::MatrixXd measured;                       ///< as it is in the log
  Eigen::MatrixXd reference;                      ///< the noise-free torque, else the measured one
  std::string reference_name;                     ///< "true" or "measured"
  Eigen::MatrixXd rigid;                          ///< torque of the true rigid body and rotors; empty: not known
  Eigen::MatrixXd learned_friction;               ///< what bls_pso_physical adds to its rigid body
  std::map<std::string, Eigen::MatrixXd> torque;  ///< by method
  std::vector<double> rated;
  Eigen::VectorXd train_t;  ///< of the first train log
  Eigen::MatrixXd train_q;
};

/// A picture that write_comparison_plots() draws.
struct ComparisonPlot {
  const char* file;   ///< in DIR/plots
  const char* title;  ///< for the report
};
inline constexpr ComparisonPlot comparison_plots[] = {
    {"compare_trajectories.svg", "Excitation: the first train log (as Fig. 5)"},
    {"compare_friction.svg", "Friction torque: true, measured, learned (as Fig. 6)"},
    {"compare_friction_error.svg", "Error of the learned friction torque (as Fig. 7)"},
    {"compare_torque.svg", "Total torque: true and predicted (as Fig. 8)"},
    {"compare_torque_error.svg", "Error of the total torque (as Fig. 9)"},
    {"compare_methods.svg", "RLS, MLP, BLS against the truth (as Fig. 10)"},
    {"compare_methods_error.svg", "Smoothed error of the methods (as Fig. 11)"},
};

/// Draws them, as far as the methods are there; earlier ones are removed.
/// @throws InputError where gnuplot is missing or fails
void write_comparison_plots(const ComparedLog& log, const std::filesystem::path& directory);

}  // namespace fxdyn

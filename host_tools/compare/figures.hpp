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

/// Draws comparison_plots (page/comparison_plots.hpp), as far as the methods are there; earlier ones are removed.
/// @throws InputError where gnuplot is missing or fails
void write_comparison_plots(const ComparedLog& log, const std::filesystem::path& directory);

}  // namespace fxdyn

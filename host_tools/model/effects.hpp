#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "host_tools/log/log.hpp"
#include "model/catalogue.hpp"

namespace fxdyn {

/// What the host knows of an effect without its type: its entry in the catalogue.
struct EffectInfo {
  std::string_view name, equation;
  std::span<const ParameterInfo> shape, linear;
};

/// nullptr where the catalogue has no such effect.
const EffectInfo* find_effect(std::string_view name);
std::vector<std::string_view> effect_names();

/// One joint's inputs over a log, as columns.
struct JointSeries {
  Eigen::VectorXd q, dq, ddq, structural;
  double step_s = 0;
};

/// phi of a catalogue effect over a log: samples x linear parameters. States start at rest with the log.
Eigen::MatrixXd effect_columns(std::string_view effect, std::span<const double> shape, double sign_width,
                               const JointSeries& series);

}  // namespace fxdyn

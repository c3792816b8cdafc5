#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/signals/log.hpp"
#include "model/catalogue.hpp"

namespace fxdyn {

/// What the host knows of an effect without its type: its entry in the catalogue.
struct EffectInfo {
  std::string_view name, equation;
  std::span<const ParameterInfo> shape, linear;
  ActsOn acts_on;
  bool needs_structural, needs_total, needs_peers;
  bool uses_sign;  ///< its phi depends on the joint's sign width
};

/// All effects, those on the body last.
const std::vector<EffectInfo>& effect_infos();
/// nullptr where there is no such effect.
const EffectInfo* find_effect(std::string_view name);
/// Names of all effects, and of those of the Catalogue only (all but those on the body).
std::vector<std::string_view> effect_names();
std::vector<std::string_view> joint_effect_names();

/// Why identify can't fit the effect yet; empty if it can.
std::string why_not_identified(const EffectInfo& info);

/// One joint's inputs over a log, as columns. What is empty is not known; effects that need it are refused.
struct JointSeries {
  Eigen::VectorXd q, dq, ddq, structural;
  double step_s = 0;
  Eigen::VectorXd total{};
  Eigen::MatrixXd peers_dq{}, peers_sign{}, peers_ddq{};  ///< samples x joints of the robot
};

/// phi of a catalogue effect over a log: samples x linear parameters. States start at rest with the log.
/// @throws InputError: no such effect, or the series lacks what it needs.
Eigen::MatrixXd effect_columns(std::string_view effect, std::span<const double> shape, double sign_width,
                               const JointSeries& series);

}  // namespace fxdyn

#include "host_tools/excite/effect_information.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double largest_of(const std::vector<MatrixXd>& torque, std::size_t joint) {
  double most = 0;
  for (const MatrixXd& tau : torque) most = std::max(most, tau.col(static_cast<Index>(joint)).cwiseAbs().maxCoeff());
  return most;
}

Log to_log(const Motion& motion) {
  Log log;
  log.file = motion.name;
  log.step_s = motion.step_s;
  log.t = motion.t;
  log.from_s = motion.t[0];
  log.to_s = motion.t[motion.t.size() - 1];
  log.q = motion.q;
  log.dq = motion.dq;
  log.ddq = motion.ddq;
  return log;
}

}  // namespace

MatrixXd information_left(const MatrixXd& columns, const MatrixXd& cross, const MatrixXd& nuisance) {
  constexpr double rank_tolerance = 1e-12;
  const VectorXd scale = nuisance.diagonal().unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * nuisance * scale.asDiagonal());
  const double most = eigen.eigenvalues().tail(1)[0];
  const VectorXd inverse =
      eigen.eigenvalues().unaryExpr([=](double x) { return x > rank_tolerance * most ? 1 / x : 0.0; });
  const MatrixXd half = scale.asDiagonal() * eigen.eigenvectors();
  return columns - cross.transpose() * (half * inverse.asDiagonal() * half.transpose()) * cross;
}

std::vector<Index> columns_from(Index first, Index count) {
  std::vector<Index> indices;
  for (Index i = 0; i < count; ++i) indices.push_back(first + i);
  return indices;
}

namespace {

/// All that the catalogue has beyond the nominal model, with typical shapes.
std::vector<EffectCandidate> catalogue_of(const Robot& robot, const std::vector<Motion>& motions,
                                          const std::vector<RobotColumns>& columns) {
  std::vector<MatrixXd> torque, structural;
  for (const RobotColumns& c : columns) {
    torque.push_back(c.torque());
    structural.push_back(c.structural());
  }
  std::vector<EffectCandidate> out;
  for (const EffectInfo& info : effect_infos()) {
    if (!info.sought()) continue;  // laws that unite others are shown by what shows those
    for (std::size_t j = 0; j < (info.acts_on == ActsOn::body ? 1 : robot.size()); ++j) {
      for (const auto& shape : typical_shapes(info.name, j, robot, motions, torque, structural))
        out.push_back({std::string(info.name), j, shape});
    }
  }
  return out;
}

}  // namespace

void Information::add_blocks(const Robot& robot, const std::vector<EffectCandidate>& candidates) {
  Index at = base;
  const auto add = [&](const EffectCandidate& candidate) {
    const EffectInfo& info = *find_effect(candidate.effect);
    Block block{candidate, info.acts_on == ActsOn::body, at, static_cast<Index>(info.linear.size())};
    block.raw.resize(robot.size());
    at += block.count;
    blocks.push_back(std::move(block));
  };
  for (std::size_t j = 0; j < robot.size(); ++j) {
    for (const std::string& effect : nominal_effects()) add({effect, j, {}});
  }
  nominal_blocks = blocks.size();
  for (const EffectCandidate& candidate : candidates) add(candidate);
  gram = MatrixXd::Zero(at, at);
}

Information::Information(const IdentifiedModel& nominal, const std::vector<Motion>& motions,
                         const VectorXd& white_noise, std::optional<double> torque_cutoff_hz, Progress& progress) {
  measure(nominal, motions, white_noise, torque_cutoff_hz, nullptr, &progress);
}

Information::Information(const IdentifiedModel& nominal, const std::vector<Motion>& motions,
                         const VectorXd& white_noise, std::optional<double> torque_cutoff_hz,
                         const std::vector<EffectCandidate>& candidates) {
  measure(nominal, motions, white_noise, torque_cutoff_hz, &candidates, nullptr);
}

void Information::measure(const IdentifiedModel& nominal, const std::vector<Motion>& motions,
                          const VectorXd& white_noise, std::optional<double> torque_cutoff_hz,
                          const std::vector<EffectCandidate>* candidates, Progress* progress) {
  std::vector<Log> logs;
  for (const Motion& motion : motions) logs.push_back(to_log(motion));
  SignalSettings signals;
  signals.torque_cutoff_hz = torque_cutoff_hz;
  filter = choose_filter(logs, signals);

  std::vector<RobotColumns> columns;
  for (const Motion& motion : motions) columns.emplace_back(nominal, motion);
  const DhChain chain = to_dh(robot_of(nominal));
  const BaseSet base_set = find_base(chain);
  base = static_cast<Index>(base_set.columns.size());
  add_blocks(robot_of(nominal),
             candidates != nullptr ? *candidates : catalogue_of(robot_of(nominal), motions, columns));

  for (std::size_t m = 0; m < motions.size(); ++m)
    add_motion(motions[m], logs[m], columns[m], white_noise, chain, base_set, progress);
  if (progress != nullptr) progress->done();
  for (Block& block : blocks) {
    for (MatrixXd& raw : block.raw) raw /= seconds;
  }
}

void Information::add_motion(const Motion& motion, const Log& recorded, const RobotColumns& columns,
                             const VectorXd& white_noise, const DhChain& chain, const BaseSet& base_set,
                             Progress* progress) {
  const auto n = static_cast<std::size_t>(motion.q.cols());
  const ProcessedLog log = process(recorded, filter);
  const Index samples = log.last - log.first;
  const double nyquist = 0.5 / motion.step_s, cutoff = std::min(filter.torque_cutoff_hz, nyquist);
  const double duration = static_cast<double>(samples) * motion.step_s;
  seconds += duration;
  independent_samples += 2 * cutoff * duration;
  // White noise within the cut-off, and weights that count independent samples instead of rows.
  noise = white_noise * std::sqrt(cutoff / nyquist);
  const VectorXd weight = std::sqrt(2 * cutoff * duration / static_cast<double>(log.rows())) * noise.cwiseInverse();

  if (progress != nullptr) progress->stage(fmt::format("what {} shows", motion.name), blocks.size() + n);
  std::vector<std::vector<MatrixXd>> effect(blocks.size());  // [block][joint], filtered and decimated
  parallel_for(blocks.size(), [&](std::size_t b) {
    const EffectColumns full = columns(blocks[b].candidate);
    effect[b].resize(n);
    for (std::size_t j = 0; j < n; ++j) {
      const MatrixXd& c = full.joints[j];
      if (c.size() == 0) continue;
      const auto inside = c.middleRows(log.first, samples);
      const MatrixXd power = inside.transpose() * inside * motion.step_s;
      blocks[b].raw[j] = blocks[b].raw[j].size() == 0 ? power : MatrixXd(blocks[b].raw[j] + power);
      effect[b][j] = log.decimate(log.filter_columns(c));
    }
    if (progress != nullptr) progress->step();
  });

  std::vector<MatrixXd> rows(n, MatrixXd(motion.q.rows(), base));
  Regressor regressor(chain);
  for (Index k = 0; k < motion.q.rows(); ++k) {
    const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
    for (std::size_t j = 0; j < n; ++j) rows[j].row(k) = y(static_cast<Index>(j), base_set.columns);
  }
  std::vector<MatrixXd> grams(n);
  std::vector<std::vector<Index>> places(n);  // in the whole
  parallel_for(n, [&](std::size_t j) {
    std::vector<std::size_t> here;
    places[j] = columns_from(0, base);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (effect[b][j].size() == 0) continue;
      here.push_back(b);
      const auto own = columns_from(blocks[b].first, blocks[b].count);
      places[j].insert(places[j].end(), own.begin(), own.end());
    }
    MatrixXd x(log.rows(), static_cast<Index>(places[j].size()));
    x.leftCols(base) = log.decimate(log.filter_columns(rows[j]));
    rows[j].resize(0, 0);
    Index at = base;
    for (const std::size_t b : here) {
      x.middleCols(at, blocks[b].count) = effect[b][j];
      at += blocks[b].count;
    }
    x *= weight[static_cast<Index>(j)];
    grams[j] = MatrixXd::Zero(x.cols(), x.cols());
    grams[j].selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
    grams[j].triangularView<Eigen::StrictlyUpper>() = grams[j].transpose();
    if (progress != nullptr) progress->step();
  });
  for (std::size_t j = 0; j < n; ++j) gram(places[j], places[j]) += grams[j];
}

std::vector<std::vector<double>> typical_shapes(std::string_view effect, std::size_t joint, const Robot& robot,
                                                const std::vector<Motion>& motions, const std::vector<MatrixXd>& torque,
                                                const std::vector<MatrixXd>& structural) {
  const EffectInfo* info = find_effect(effect);
  if (info == nullptr) throw InputError(fmt::format("unknown effect '{}': see `fxdyn effects`", effect));
  if (info->shape.empty()) return {{}};
  MotionScales scales;
  scales.turns = robot.joints[joint].type == JointType::revolute;
  scales.joint = static_cast<unsigned>(joint);
  scales.joints = static_cast<unsigned>(robot.size());
  scales.torque = largest_of(torque, joint);
  scales.structural = largest_of(structural, joint);
  const auto col = static_cast<Index>(joint);
  double lowest = motions.front().q(0, col), highest = lowest;
  for (const Motion& motion : motions) {
    lowest = std::min(lowest, motion.q.col(col).minCoeff());
    highest = std::max(highest, motion.q.col(col).maxCoeff());
    scales.speed = std::max(scales.speed, motion.dq.col(col).cwiseAbs().maxCoeff());
    scales.seconds = std::max(scales.seconds, motion.step_s * static_cast<double>(motion.q.rows()));
  }
  scales.lowest = lowest;
  scales.range = highest - lowest;
  std::vector<std::vector<double>> values;
  for (const ParameterInfo& shape : info->shape) {
    scales.upper = upper_bound(*info, shape, motions.front().step_s);
    values.emplace_back();
    for (const double value : shape.values.judged(scales))
      values.back().push_back(std::clamp(value, shape.lower, scales.upper));
  }
  return combinations(values);
}

}  // namespace fxdyn

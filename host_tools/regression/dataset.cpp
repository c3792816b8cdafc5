#include "host_tools/regression/dataset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/encoder_noise.hpp"
#include "host_tools/regression/noise_cutoff.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/spectrum.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Samples beside a block that differences of sixth order look at, its one-sided ends included.
constexpr Index halo = 8;
/// Torque band over the frequency that holds 99.9 % of the motion: friction reverses faster than the motion.
constexpr double torque_band = 5;
constexpr double lowest_position_hz = 5;  ///< whatever the noise is, friction reverses as fast

/// Rows [from, from + count) of q and its derivatives; what is measured is not differentiated.
MotionRows slice(const MatrixXd& q, const MatrixXd& dq, const MatrixXd& ddq, Index from, Index count, double step_s) {
  const Index begin = std::max<Index>(0, from - halo), end = std::min(q.rows(), from + count + halo);
  const auto around = [&](const MatrixXd& m) { return m.middleRows(begin, end - begin); };
  const auto cut = [&](const MatrixXd& m) { return MatrixXd(m.middleRows(from - begin, count)); };
  MotionRows out;
  out.q = q.middleRows(from, count);
  out.dq = dq.size() > 0 ? MatrixXd(dq.middleRows(from, count)) : cut(differentiate(around(q), step_s));
  if (ddq.size() > 0)
    out.ddq = ddq.middleRows(from, count);
  else
    out.ddq = cut(dq.size() > 0 ? differentiate(around(dq), step_s) : differentiate_twice(around(q), step_s));
  return out;
}

/// Runs in which the torque does not move from its extreme (or stays at the project's limit), four samples or longer,
/// and into which it jumped: the peak of a coarsely measured torque is entered by a step of its resolution. A torque
/// that is logged faster than it is measured stands still everywhere: the run has to be four times as long as usual.
std::vector<std::array<Index, 2>> saturated_runs(const VectorXd& tau, double limit) {
  const Index n = tau.size();
  double resolution = 1e300;
  Index changes = 1;
  for (Index k = 1; k < n; ++k) {
    const double step = std::fabs(tau[k] - tau[k - 1]);
    if (step > 0) resolution = std::min(resolution, step);
    changes += step > 0;
  }
  const Index shortest = 4 * std::max<Index>(1, n / changes);
  std::vector<std::array<Index, 2>> runs;
  for (const double sign : {1.0, -1.0}) {
    const double extreme = limit > 0 ? std::min(0.995 * limit, (sign * tau).maxCoeff()) : (sign * tau).maxCoeff();
    if (limit > 0 && (sign * tau).maxCoeff() < 0.995 * limit) continue;
    for (Index k = 0; k < n;) {
      if (sign * tau[k] < extreme * (1 - 1e-12)) {
        ++k;
        continue;
      }
      Index end = k;
      while (end < n && sign * tau[end] >= extreme * (1 - 1e-12)) ++end;
      const bool jumped = limit > 0 || (k > 0 && std::fabs(tau[k] - tau[k - 1]) > 3 * resolution);
      if (end - k >= shortest && jumped) runs.push_back({k, end});
      k = end;
    }
  }
  return runs;
}

/// RMS of the noise that stays in the filtered torque, estimated from what lies above the cut-off (white noise
/// assumed).
double noise_floor(const VectorXd& raw, const VectorXd& filtered, double cutoff_hz, double step_s) {
  const double nyquist = 0.5 / step_s, kept = std::min(cutoff_hz, 0.95 * nyquist);
  return std::sqrt(kept / (nyquist - kept)) * (raw - filtered).norm() / std::sqrt(static_cast<double>(raw.size()));
}

/// Whether velocity holds anything above the cut-off: noise, or motion that a filter would bend.
bool is_noisy(const VectorXd& velocity, double cutoff_hz, double step_s) {
  const VectorXd above = velocity - ZeroPhaseFilter(cutoff_hz, step_s).apply(velocity);
  const Index edge = std::min<Index>(velocity.rows() / 4, static_cast<Index>(2 / (cutoff_hz * step_s)));
  const Index rows = velocity.rows() - 2 * edge;
  return above.middleRows(edge, rows).norm() > 1e-6 * velocity.middleRows(edge, rows).norm();
}

/// Where the motion sinks into the noise: the first frequency from which the density of q is below twice the level
/// of its highest octave, for four bins at least.
double crossing_frequency(const Spectrum& spectrum) {
  const Index n = spectrum.density.size();
  VectorXd high = spectrum.density.tail(n / 2);
  std::nth_element(high.begin(), high.begin() + high.size() / 2, high.end());
  const double level = 2 * high[high.size() / 2];
  for (Index k = 1; k + 3 < n; ++k) {
    // four bins, since a spectrum of lines has gaps
    if (spectrum.density.segment(k, 4).maxCoeff() < level) return spectrum.frequency(k);
  }
  return spectrum.frequency(n - 1);
}

}  // namespace

MotionRows ProcessedLog::motion(Index from, Index count) const {
  return slice(q, measured_dq, measured_ddq, from, count, step_s);
}

MotionRows ProcessedLog::link_motion(Index from, Index count) const {
  MotionRows out = motion(from, count);
  if (qlink.size() == 0) return out;
  const MotionRows link = slice(qlink, {}, {}, from, count, step_s);
  for (std::size_t j = 0; j < has_link.size(); ++j) {
    if (!has_link[j]) continue;
    const auto k = static_cast<Index>(j);
    out.q.col(k) = link.q.col(k);
    out.dq.col(k) = link.dq.col(k);
    out.ddq.col(k) = link.ddq.col(k);
  }
  return out;
}

MotionRows ProcessedLog::joint_motion(Index joint) const {
  const auto column = [&](const MatrixXd& m) { return m.size() > 0 ? MatrixXd(m.col(joint)) : MatrixXd(); };
  return slice(column(q), column(measured_dq), column(measured_ddq), 0, samples(), step_s);
}

VectorXd ProcessedLog::joint_velocity(Index joint) const {
  return measured_dq.size() > 0 ? VectorXd(measured_dq.col(joint)) : VectorXd(differentiate(q.col(joint), step_s));
}

bool ProcessedLog::is_saturated(Index joint, Index row) const {
  if (is_left_out(joint)) return true;
  const auto& runs = saturated[static_cast<std::size_t>(joint)];
  // The filter spreads a sample over about one period of its cut-off.
  const auto reach = static_cast<Index>(1 / (filter.torque_cutoff_hz * step_s));
  const Index sample = first + row * decimation;
  return std::any_of(runs.begin(), runs.end(),
                     [&](const auto& run) { return sample >= run[0] - reach && sample < run[1] + reach; });
}

void ProcessedLog::lose(Index joint, Index joints, const VectorXd& velocity) {
  if (velocity.size() == 0) return;
  if (lost_velocity.size() == 0) lost_velocity.setZero(velocity.size(), joints);
  lost_velocity.col(joint) = lost_velocity.col(joint).array().square() + velocity.array().square();
  lost_velocity.col(joint) = lost_velocity.col(joint).cwiseSqrt();
}

MatrixXd ProcessedLog::filter_columns(const Eigen::Ref<const MatrixXd>& full_rate) const {
  return ZeroPhaseFilter(filter.torque_cutoff_hz, step_s).apply(full_rate);
}

MatrixXd ProcessedLog::decimate(const Eigen::Ref<const MatrixXd>& filtered) const {
  MatrixXd out(rows(), filtered.cols());
  for (Index i = 0; i < out.rows(); ++i) out.row(i) = filtered.row(first + i * decimation);
  return out;
}

std::vector<RowBlock> row_blocks(const ProcessedLog& log) {
  const Index pad = ZeroPhaseFilter(log.filter.torque_cutoff_hz, log.step_s).edge_samples() * 13 / 2 + 1;
  const Index step = std::max<Index>(8192, 4 * pad), rows = log.rows();
  std::vector<RowBlock> blocks;
  for (Index from = 0, row = 0; row < rows; from += step) {
    RowBlock block;
    block.begin = std::max<Index>(0, from - pad);
    block.samples = std::min(log.samples(), from + step + pad) - block.begin;
    block.row = row;
    while (row < rows && log.first + row * log.decimation < from + step) ++row;
    block.rows = row - block.row;
    if (block.rows > 0) blocks.push_back(block);
  }
  return blocks;
}

MatrixXd RowBlock::filter_and_keep(const ProcessedLog& log, const MatrixXd& full) const {
  const MatrixXd filtered = log.filter_columns(full);
  MatrixXd out(rows, full.cols());
  for (Index i = 0; i < rows; ++i) out.row(i) = filtered.row(log.first + (row + i) * log.decimation - begin);
  return out;
}

FilterFit choose_filter(const std::vector<Log>& logs, const SignalSettings& settings) {
  FilterFit filter;
  const Index n = logs.front().joints();
  filter.encoder_step.assign(static_cast<std::size_t>(n), 0.0);
  filter.position_noise.assign(static_cast<std::size_t>(n), 0.0);
  double rate = 1e30;
  bool noisy = false;
  // All logs together: in a slow one of a controlled robot the share of the jerks with which a joint comes loose is
  // large, the share of the noise too.
  std::vector<EnergyByFrequency> moved(static_cast<std::size_t>(n));
  std::vector<double> range(static_cast<std::size_t>(n), 0.0), crossing(static_cast<std::size_t>(n), 0.0);
  for (const Log& log : logs) rate = std::min(rate, 1 / log.step_s);
  for (const Log& log : logs) {
    for (Index j = 0; j < n; ++j) {
      const auto k = static_cast<std::size_t>(j);
      const VectorXd q = log.q.col(j);
      if (!(q.maxCoeff() > q.minCoeff())) continue;
      const VectorXd dq = log.dq.size() > 0 ? VectorXd(log.dq.col(j)) : VectorXd(differentiate(q, log.step_s));
      Spectrum velocity = welch(dq, log.step_s);
      const Spectrum position = welch(q, log.step_s);
      if (log.dq.size() == 0) {
        // What the encoder's noise makes of the velocity is no motion: slow logs would consist of it.
        const double level = 2 * log.step_s * std::pow(position.noise_rms(), 2);
        for (Index b = 0; b < velocity.density.size(); ++b) {
          const double w = 2 * std::numbers::pi * velocity.frequency(b);
          velocity.density[b] = std::max(0.0, velocity.density[b] - 4 * w * w * level);
        }
      }
      // Above the frequency at which the motion sinks into the noise there is none.
      const double sinks = crossing_frequency(position);
      const double ceiling = std::min({30.0, 0.4 * rate, log.dq.size() == 0 ? sinks : 30.0});
      moved[k].add(velocity, ceiling, static_cast<double>(log.samples()) * log.step_s);
      const double step = log.encoder_step.size() > 0 ? log.encoder_step[j] : encoder_step(q);
      filter.encoder_step[k] = std::max(filter.encoder_step[k], step);
      filter.position_noise[k] = std::max(filter.position_noise[k], position.noise_rms());
      range[k] = std::max(range[k], q.maxCoeff() - q.minCoeff());
      crossing[k] = std::max(crossing[k], sinks);
    }
  }
  EnergyByFrequency motion;
  // The counts between which a parked joint flickers are no motion.
  const auto moves = [&](std::size_t k) { return range[k] > std::max(1e-4, 20 * filter.position_noise[k]); };
  bool any = false;
  for (std::size_t k = 0; k < moved.size(); ++k) any |= moves(k);
  for (std::size_t k = 0; k < moved.size(); ++k) {
    if (any && !moves(k)) continue;
    motion.add_shares(moved[k]);
    filter.crossing_hz = std::max(filter.crossing_hz, crossing[k]);
  }
  filter.excited_hz = motion.frequency_of_share(0.999);
  double position = std::min(0.4 * rate, std::max(10.0, 2 * filter.crossing_hz));
  if (!settings.position_cutoff_hz) {
    std::vector<bool> counts(moved.size());
    for (std::size_t k = 0; k < moved.size(); ++k) counts[k] = moves(k);
    const double band = std::max(lowest_position_hz, 2 * filter.excited_hz);
    position = std::min(position, std::max(band, noise_cutoff(logs, band, filter.encoder_step, counts)));
  }
  if (!settings.position_cutoff_hz) {
    for (const Log& log : logs) {
      for (Index j = 0; j < n && !noisy; ++j) {
        const VectorXd q = log.q.col(j);
        noisy = is_noisy(log.dq.size() > 0 ? VectorXd(log.dq.col(j)) : VectorXd(differentiate(q, log.step_s)), position,
                         log.step_s);
      }
    }
  }
  filter.position_cutoff_hz =
      settings.position_cutoff_hz.value_or(noisy ? position : rate / 2);  // half the rate: no filter
  filter.torque_cutoff_hz = settings.torque_cutoff_hz.value_or(
      std::min({0.4 * rate, filter.position_cutoff_hz, std::max(torque_band * filter.excited_hz, 10.0)}));
  filter.torque_lead_s = settings.torque_lead_s.value_or(0);
  filter.edge_s = settings.edge_s.value_or(3 / std::min(filter.torque_cutoff_hz, filter.position_cutoff_hz));
  return filter;
}

ProcessedLog process(Log log, const FilterFit& filter, const ProcessSettings& settings) {
  ProcessedLog out;
  out.name = log.file.filename().string();
  out.role = log.role;
  out.from_s = log.from_s;
  out.to_s = log.to_s;
  out.step_s = log.step_s;
  out.load = log.load;
  out.filter = filter;
  const Index samples = log.samples(), n = log.joints();
  const auto edge = static_cast<Index>(std::ceil(filter.edge_s / log.step_s));
  out.first = edge;
  out.last = samples - edge;
  if (out.last - out.first < 10) {
    throw DataError(fmt::format(
        "{}: {:.2f} s from {} s is too short: {:.2f} s at either end go to the filters; take a longer window", out.name,
        static_cast<double>(samples) * log.step_s, log.from_s, filter.edge_s));
  }
  const Index inside = out.last - out.first;
  const ZeroPhaseFilter motion(filter.position_cutoff_hz, log.step_s), torque(filter.torque_cutoff_hz, log.step_s);
  out.q_range.setZero(n);
  out.q_noise.setZero(n);
  out.torque_noise.setZero(n);
  out.saturated.resize(static_cast<std::size_t>(n));
  out.has_link.assign(static_cast<std::size_t>(n), false);
  // In place, column by column: a long log is not held twice.
  for (Index j = 0; j < n; ++j) {
    const VectorXd raw = log.q.col(j);
    log.q.col(j) = motion.apply(raw);
    const auto middle = log.q.col(j).segment(out.first, inside);
    out.q_range[j] = middle.maxCoeff() - middle.minCoeff();
    out.q_noise[j] = (raw.segment(out.first, inside) - middle).norm() / std::sqrt(static_cast<double>(inside));
    if (log.dq.size() > 0) {
      log.dq.col(j) = motion.apply(log.dq.col(j));
    } else {
      const VectorXd lost = lost_velocity(raw, log.q.col(j), filter, static_cast<std::size_t>(j), log.step_s);
      out.lose(j, n, lost);
    }
    if (log.ddq.size() > 0) log.ddq.col(j) = motion.apply(log.ddq.col(j));
    if (log.qlink.size() > 0) {
      out.has_link[static_cast<std::size_t>(j)] = !std::isnan(log.qlink(0, j));
      log.qlink.col(j) =
          out.has_link[static_cast<std::size_t>(j)] ? MatrixXd(motion.apply(log.qlink.col(j))) : MatrixXd(log.q.col(j));
    }
    if (log.tau.size() > 0) {
      const VectorXd tau = log.tau.col(j);
      out.torque_noise[j] =
          noise_floor(tau.segment(out.first, inside), torque.apply(tau).col(0).segment(out.first, inside),
                      filter.torque_cutoff_hz, log.step_s);
      out.saturated[static_cast<std::size_t>(j)] =
          saturated_runs(tau, settings.torque_limits.empty() ? 0 : settings.torque_limits[static_cast<std::size_t>(j)]);
    }
  }
  out.t = std::move(log.t);
  out.q = std::move(log.q);
  out.measured_dq = std::move(log.dq);
  out.measured_ddq = std::move(log.ddq);
  out.qlink = std::move(log.qlink);
  out.tau = std::move(log.tau);
  // Eight samples a period of the cut-off lose nothing and spare work.
  out.decimation = std::max<Index>(1, static_cast<Index>(1 / (log.step_s * 8 * filter.torque_cutoff_hz)));
  out.decimation =
      std::max(out.decimation, static_cast<Index>(std::ceil(settings.shortest_interval_s / log.step_s - 1e-9)));
  return out;
}

ModelValue with_load_of(const ProcessedLog& log, ModelValue model) {
  if (!log.load) return model;
  const Eigen::Vector3d& com = log.load->com;
  EffectFit payload;
  payload.effect = load_effect().name;
  payload.linear = {log.load->mass, com.x(), com.y(), com.z()};
  model->body.push_back(payload);
  return model;
}

double age_of(const IdentifiedModel& model, const ProcessedLog& log) {
  constexpr double constants_till_cold = 3;
  if ((!model.session && log.ran_s == 0) || log.t.size() == 0) return 0;
  double longest = 0;
  for (const JointFit& joint : model.joints) {
    for (const EffectFit& fit : joint.effects) {
      if (drifts(fit.effect)) longest = std::max(longest, fit.shape[0]);
    }
  }
  if (!model.session) return longest > 0 ? log.ran_s : 0;
  const double start = log.t[0];
  const bool belongs = start >= model.session->start_s && start <= model.session->end_s + constants_till_cold * longest;
  return longest > 0 && belongs ? start - model.session->start_s : 0;
}

std::vector<bool> moving_joints(const std::vector<ProcessedLog>& logs) {
  std::vector<bool> out(static_cast<std::size_t>(logs.front().q.cols()), false);
  for (const ProcessedLog& log : logs) {
    if (log.role != Role::train) continue;
    // Noise alone looks like motion of a few times what the filter took out.
    for (std::size_t j = 0; j < out.size(); ++j) {
      const auto k = static_cast<Index>(j);
      out[j] = out[j] || log.q_range[k] > std::max(1e-4, 20 * log.q_noise[k]);
    }
  }
  return out;
}

double bending_hz(const ProcessedLog& log) {
  constexpr double lowest_hz = 2;
  const double cutoff = std::max(log.filter.crossing_hz, lowest_hz);
  return log.filter.crossing_hz > 0 && cutoff < std::min(log.filter.position_cutoff_hz, 0.4 / log.step_s) ? cutoff : 0;
}

bool bends(std::string_view effect) { return find_effect(effect)->bends(); }

std::optional<ModelValue> stiffened(const IdentifiedModel& model) {
  ModelValue out = model;
  std::size_t bent = 0;
  for (JointFit& joint : out->joints)
    bent += std::erase_if(joint.effects, [](const EffectFit& fit) { return bends(fit.effect); });
  return bent > 0 ? std::optional(std::move(out)) : std::nullopt;
}

namespace {

void add_by_blocks(double factor, const IdentifiedModel& model, const ProcessedLog& log, MatrixXd& to, Index first) {
  Predictor predictor(with_load_of(log, model), log.step_s, age_of(model, log));
  constexpr Index block = 8192;
  const double lead = model.filter.torque_lead_s / log.step_s;
  MatrixXd all, part;
  if (lead != 0) all.resize(log.samples(), to.cols());
  for (Index from = 0; from < log.samples(); from += block) {
    const Index count = std::min(block, log.samples() - from);
    const MotionRows motion = log.motion(from, count);
    part.resize(count, log.q.cols());
    predictor(motion.q, motion.dq, motion.ddq, part);
    const auto asked = part.middleCols(first, to.cols());
    if (lead != 0) {
      all.middleRows(from, count) = asked;
    } else {
      to.middleRows(from, count) += factor * asked;
    }
  }
  for (Index j = 0; j < all.cols(); ++j) to.col(j) += factor * at_other_times(all.col(j), lead);
}

}  // namespace

void add_prediction(double factor, const IdentifiedModel& model, const ProcessedLog& log, MatrixXd& to, Index first) {
  const double cutoff = bending_hz(log);
  const auto stiff = cutoff > 0 ? stiffened(model) : std::nullopt;
  if (!stiff) return add_by_blocks(factor, model, log, to, first);
  add_by_blocks(factor, *stiff, log, to, first);
  ProcessedLog slow = log;
  const ZeroPhaseFilter filter(cutoff, log.step_s);
  for (MatrixXd* columns : {&slow.q, &slow.measured_dq, &slow.measured_ddq}) {
    if (columns->size() > 0) *columns = filter.apply(*columns);
  }
  add_by_blocks(factor, model, slow, to, first);
  add_by_blocks(-factor, *stiff, slow, to, first);
}

VectorXd predict_joint(const IdentifiedModel& model, const ProcessedLog& log, std::size_t joint) {
  MatrixXd tau = MatrixXd::Zero(log.samples(), 1);
  add_prediction(1, model, log, tau, static_cast<Index>(joint));
  return tau;
}

MatrixXd predict(const IdentifiedModel& model, const ProcessedLog& log) {
  MatrixXd tau = MatrixXd::Zero(log.samples(), log.q.cols());
  add_prediction(1, model, log, tau);
  return tau;
}

std::vector<MatrixXd> structural_torque(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
  IdentifiedModel rigid = model;
  rigid.filter.torque_lead_s = 0;
  for (JointFit& joint : rigid.joints) {
    std::erase_if(joint.effects,
                  [](const EffectFit& fit) { return find_effect(fit.effect)->acts_on != ActsOn::position; });
    joint.bls.reset();
  }
  std::vector<MatrixXd> out(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) { out[l] = predict(rigid, logs[l]); });
  return out;
}

}  // namespace fxdyn

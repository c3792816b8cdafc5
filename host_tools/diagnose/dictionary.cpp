#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "host_tools/diagnose/search.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// How a joint moves over the logs that fit.
MotionScales scales_of(const Linearised& at, std::size_t joint) {
  MotionScales s;
  const std::vector<Joint>& joints = at.models().current.robot.joints;
  const auto alike = [&](std::size_t other) { return joints[other].type == joints[joint].type; };
  s.turns = joints[joint].type == JointType::revolute;
  s.joint = static_cast<unsigned>(joint);
  s.joints = static_cast<unsigned>(at.joints());
  s.like_previous = joint > 0 && alike(joint - 1);
  s.like_next = joint + 1 < joints.size() && alike(joint + 1);
  s.sign_width = at.models().current.joints[joint].sign_width;
  const auto j = static_cast<Index>(joint);
  double lower = 1e300, upper = -1e300, last = 0;
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    const SessionLog& entry = at.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const Index first = entry.log.first, count = entry.log.last - first;
    const auto inside = [&](const MatrixXd& m) { return m.col(j).segment(first, count); };
    s.speed = std::max(s.speed, inside(at.motion(l).dq).cwiseAbs().maxCoeff());
    lower = std::min(lower, inside(at.motion(l).q).minCoeff());
    upper = std::max(upper, inside(at.motion(l).q).maxCoeff());
    s.torque = std::max(s.torque, inside(at.robot_columns(l).torque()).cwiseAbs().maxCoeff());
    s.structural = std::max(s.structural, inside(at.robot_columns(l).structural()).cwiseAbs().maxCoeff());
    last = std::max(last, entry.age_s + entry.log.step_s * static_cast<double>(entry.log.samples()));
  }
  s.range = upper - lower;
  s.seconds = last;
  return s;
}

/// Shapes to try for an effect: one list a shape parameter.
std::vector<std::vector<double>> grids(const EffectInfo& info, const Linearised& at, MotionScales s) {
  std::vector<std::vector<double>> out;
  for (const ParameterInfo& shape : info.shape) {
    const auto [least, most] = shape_limits(at.models(), s.joint, info, shape);
    s.upper = most;
    out.emplace_back();
    for (const double value : shape.values.tried(s)) out.back().push_back(std::clamp(value, least, most));
  }
  return out;
}

}  // namespace

int searched_shape(const EffectCandidate& candidate) { return find_effect(candidate.effect)->refined_shape(); }

std::vector<Group> dictionary(const Linearised& at, const std::vector<EffectCandidate>& skip) {
  std::vector<Group> out;
  const std::size_t n = at.joints();
  std::vector<std::shared_ptr<const Rotor>> rotors(n);
  std::vector<double> inertia(n);
  std::vector<const MatrixXd*> positions;
  for (std::size_t l = 0; l < at.logs().size(); ++l) positions.push_back(&at.motion(l).q);
  for (std::size_t j = 0; j < n; ++j) {
    const VectorXd in_base = hidden_rotor(at.models().current, j);
    if (in_base.size() == 0) continue;
    rotors[j] = std::make_shared<const Rotor>(Rotor{j, in_base});
    inertia[j] = least_inertia(at.models().current, j, positions);
  }
  for (const EffectInfo& info : effect_infos()) {
    if (info.nominal || info.of_spectrum()) continue;
    if (info.needs_peers && n < 2) continue;
    for (std::size_t j = 0; j < (info.acts_on == ActsOn::body ? 1 : n); ++j) {
      const bool skipped = std::any_of(skip.begin(), skip.end(), [&](const EffectCandidate& c) {
        return c.effect == info.name && (info.acts_on == ActsOn::body || c.joint == j);
      });
      if (skipped) continue;
      const MotionScales s = scales_of(at, j);
      if (info.needs_revolute && !s.turns) continue;
      if (s.seconds < info.shortest_session_s) continue;
      const auto values = grids(info, at, s);
      const auto shapes = combinations(values);
      const int searched = info.refined_shape();
      const double continuous =
          searched >= 0 ? static_cast<double>(values[static_cast<std::size_t>(searched)].size()) : 0;
      for (const auto& shape : shapes) {  // none where the joint has no mate
        Group group;
        group.candidate = {std::string(info.name), j, shape};
        group.on_body = info.acts_on == ActsOn::body;
        // A share that is 1 by definition is not free.
        group.nonlinear = (searched >= 0) - info.share;
        group.log_grid = std::log(std::max(
            1.0, static_cast<double>(shapes.size()) / std::max(1.0, continuous) * std::max(1.0, 0.5 * continuous)));
        for (const ParameterInfo& p : info.linear) group.lower.push_back(p.lower);
        if (info.separates_rotor()) group.rotor = rotors[j];
        out.push_back(group);
        if (!group.rotor || inertia[j] == 0) continue;
        // Refined once it is among the best; a column of an effect with two shapes costs more tries.
        const std::vector<double> shares =
            info.shape.size() > 1 ? std::vector<double>{0.5} : std::vector<double>{0.3, 0.6, 0.9};
        ++group.nonlinear;
        group.log_grid += std::log(1.0 + static_cast<double>(shares.size()));
        for (const double share : shares) {
          group.rotor_inertia = share * inertia[j];
          out.push_back(group);
        }
      }
    }
  }
  return out;
}

std::vector<Group> ripples(const Linearised& at, std::size_t joint, const VectorXd& residual, std::size_t most) {
  const MotionScales s = scales_of(at, joint);
  const auto& infos = effect_infos();
  const auto info = std::find_if(infos.begin(), infos.end(), [](const EffectInfo& one) { return one.of_spectrum(); });
  if (!(s.range > 0) || info == infos.end()) return {};
  const VectorXd& a = at.noise().whitening()[joint];
  const auto j = static_cast<Index>(joint);
  const double fc = at.logs().front().log.filter.torque_cutoff_hz;
  // The adjoint of decimation, filter and whitening on the residual; and how often which speed occurs.
  std::vector<double> q, g;
  std::vector<double> speed;
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    const SessionLog& entry = at.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const ProcessedLog& log = entry.log;
    const Block& b = at.blocks().of_log[l];
    VectorXd e = residual.segment(b.first, b.count), w = e;
    for (Index lag = 1; lag <= a.size() && lag < b.count; ++lag)
      w.head(b.count - lag) -= a[lag - 1] * e.tail(b.count - lag);
    VectorXd full = VectorXd::Zero(log.samples());
    for (Index r = 0; r < b.count; ++r) full[log.first + r * log.decimation] = w[r];
    full = log.filter_columns(full);
    // exp(i n q) g lives below the cut-off wherever the filter lets the ripple through
    const auto stride = std::max<Index>(1, static_cast<Index>(1 / (log.step_s * 6 * fc)));
    for (Index k = log.first; k < log.last; k += stride) {
      q.push_back(at.motion(l).q(k, j));
      g.push_back(full[k] * static_cast<double>(stride));
    }
    for (Index r = 0; r < b.count; ++r) speed.push_back(std::fabs(at.motion(l).dq(log.first + r * log.decimation, j)));
  }
  std::sort(speed.begin(), speed.end());
  constexpr std::size_t bins = 64;
  std::vector<double> bin(bins);
  for (std::size_t i = 0; i < bins; ++i) bin[i] = speed[(2 * i + 1) * speed.size() / (2 * bins)];
  const double interval = at.logs().front().log.step_s * static_cast<double>(at.logs().front().log.decimation);
  const auto power = [&](double n) {
    double sum = 0;
    for (const double v : bin) {
      const double f = n * v / (2 * std::numbers::pi);
      const double h = 1 / (1 + std::pow(f / fc, 8));
      std::complex<double> white = 1;
      for (Index lag = 1; lag <= a.size(); ++lag)
        white -= a[lag - 1] * std::polar(1.0, -2 * std::numbers::pi * f * interval * static_cast<double>(lag));
      sum += h * h * std::norm(white);
    }
    return 0.5 * sum / static_cast<double>(bins) * static_cast<double>(speed.size());
  };
  const double cell = 2 * std::numbers::pi / s.range, step = cell / 4;
  const double lowest = std::max(info->shape[0].lower, std::max(0.6 * cell, 1.3 * std::min(1.0, 6.0 / s.range)));
  const double floor = 2e-3 * power(lowest);
  constexpr std::size_t most_wavenumbers = 2400;
  std::vector<double> n, p;
  const double base_power = power(lowest);
  std::vector<std::complex<double>> turn(q.size()), at_n(q.size());
  for (std::size_t k = 0; k < q.size(); ++k) {
    turn[k] = std::polar(1.0, step * q[k]);
    at_n[k] = g[k] * std::polar(1.0, lowest * q[k]);
  }
  for (std::size_t i = 0; i < most_wavenumbers; ++i) {
    const double number = lowest + step * static_cast<double>(i), expected = power(number);
    if (expected < floor) break;
    std::complex<double> sum = 0;
    for (std::size_t k = 0; k < q.size(); ++k) {
      sum += at_n[k];
      at_n[k] *= turn[k];
    }
    n.push_back(number);
    // What is faint only because the filter takes it away must not win by that.
    p.push_back(std::norm(sum) / (2 * std::max(expected, 1e-2 * base_power)));
  }
  std::vector<std::size_t> peaks;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const bool peak = (i == 0 || p[i] >= p[i - 1]) && (i + 1 == p.size() || p[i] > p[i + 1]);
    if (peak) peaks.push_back(i);
  }
  std::sort(peaks.begin(), peaks.end(), [&](std::size_t x, std::size_t y) { return p[x] > p[y]; });
  if (peaks.size() > most) peaks.resize(most);
  std::vector<Group> out;
  for (const std::size_t i : peaks) {
    Group group;
    group.candidate = {std::string(info->name), joint, {n[i]}};
    group.nonlinear = 1;
    group.log_grid = std::log(std::max(1.0, static_cast<double>(p.size()) / 4));
    group.lower = {-unbounded, -unbounded};
    out.push_back(std::move(group));
  }
  return out;
}

}  // namespace fxdyn::diagnosis

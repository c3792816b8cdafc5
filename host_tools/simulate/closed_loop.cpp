#include "host_tools/simulate/closed_loop.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool couples(const IdentifiedModel& model) {
  for (const JointFit& joint : model.joints) {
    for (const EffectFit& fit : joint.effects) {
      const EffectInfo* info = find_effect(fit.effect);
      if (info != nullptr && info->needs_peers) return true;
    }
  }
  return false;
}

/// Forward dynamics over steps of h, with the torque constant over each.
///
/// Friction changes its sign within some mrad/s, which a drive crosses within less than a step: explicit rules
/// oscillate there. So friction is taken at the end of the step (L-stable), and what is smooth at its middle:
///   M(q_m) (v' - v) / h + b(q_m, v_m) + f(q_m, v') = tau,   q' = q + h (v + v') / 2,
///   q_m = q + h v / 2,  v_m = v + h a / 2 with the acceleration a of the step before.
/// Second order without friction. f steps a copy of the effects' states, so the presliding spring is implicit too.
class Plant {
 public:
  Plant(const IdentifiedModel& model, const VectorXd& q, const VectorXd& dq, const VectorXd& ddq, double step_s,
        double age_s)
      : coupled_(couples(model)),
        evaluator_(unlimited(forward_plant(model)), step_s),
        h_(step_s),
        q_(q),
        v_(dq),
        a_(ddq),
        width_(q.size()),
        states_(static_cast<std::size_t>(q.size())) {
    const Index n = q.size();
    for (Index i = 0; i < n; ++i) width_[i] = model.joints[static_cast<std::size_t>(i)].sign_width;
    evaluator_.warm_up(age_s);
    // Effects depend on the acceleration with constant coefficients (rotors), load_friction aside.
    const VectorXd zero = VectorXd::Zero(n);
    const VectorXd rest = tried_effects(q, zero, zero);
    rotors_.resize(n, n);
    for (Index j = 0; j < n; ++j) rotors_.col(j) = tried_effects(q, zero, VectorXd::Unit(n, j)) - rest;
  }

  const VectorXd& q() const { return q_; }
  const VectorXd& v() const { return v_; }
  const VectorXd& a() const { return a_; }

  /// M(q), rotors included: RNEA with unit accelerations.
  /// @throws DataError where it is not positive definite.
  MatrixXd mass(const VectorXd& q) {
    const Index n = q.size();
    const VectorXd zero = VectorXd::Zero(n);
    const VectorXd gravity = rigid_body(q, zero, zero);
    MatrixXd m(n, n);
    for (Index j = 0; j < n; ++j) m.col(j) = rigid_body(q, zero, VectorXd::Unit(n, j)) - gravity;
    m += rotors_;
    m = (0.5 * (m + m.transpose())).eval();
    if (Eigen::LLT<MatrixXd>(m).info() != Eigen::Success) {
      throw DataError(
          "the model's mass matrix is not positive definite, so it can't be simulated forward; it needs logs that tell "
          "the inertias: faster motion");
    }
    return m;
  }

  void step(const VectorXd& tau) {
    const VectorXd q_m = q_ + 0.5 * h_ * v_, v_m = v_ + 0.5 * h_ * a_;
    const MatrixXd m = mass(q_m) / h_;
    const VectorXd known = rigid_body(q_m, v_m, VectorXd::Zero(q_.size())) - tau;
    const auto residual = [&](const VectorXd& v) -> VectorXd { return m * (v - v_) + known + friction(q_m, v); };

    VectorXd v = v_ + h_ * a_;
    VectorXd r = residual(v);
    // Newton; friction only rises with the speed but for Stribeck's small dip, so the residual is the gradient of a
    // convex function. A step that ends where the residual has turned goes too far: back to where it vanishes along d.
    for (int iteration = 0; iteration < 30; ++iteration) {
      const VectorXd d = -jacobian(m, q_m, v, r - m * (v - v_) - known).partialPivLu().solve(r);
      const double start = d.dot(r);
      double low = 0, at_low = start, high = 1, share = 1;
      VectorXd r_new = residual(v + d);
      double at = d.dot(r_new), at_high = at;
      for (int cut = 0; cut < 12 && at_high > 0 && std::fabs(at) > 0.5 * std::fabs(start); ++cut) {
        const double secant = low - at_low * (high - low) / (at_high - at_low);
        share = cut % 2 == 0 ? secant : 0.5 * (low + high);
        r_new = residual(v + share * d);
        at = d.dot(r_new);
        (at < 0 ? low : high) = share;
        (at < 0 ? at_low : at_high) = at;
      }
      v += share * d;
      r = r_new;
      if (((share * d).array().abs() < 1e-5 * width_.array() + 1e-9 * v.array().abs()).all()) break;
    }
    a_ = (v - v_) / h_;
    q_ += 0.5 * h_ * (v_ + v);
    v_ = v;
    if (!v_.allFinite() || v_.cwiseAbs().maxCoeff() > 1e6) throw RunsAway();
    take(q_m, v_, a_);
    evaluator_.tick(states_, saturations_);  // for the effects' states
  }

 private:
  void take(const VectorXd& q, const VectorXd& dq, const VectorXd& ddq) {
    for (Index i = 0; i < q.size(); ++i) states_[static_cast<std::size_t>(i)] = {q[i], dq[i], ddq[i]};
  }
  VectorXd rigid_body(const VectorXd& q, const VectorXd& dq, const VectorXd& ddq) {
    take(q, dq, ddq);
    return Eigen::Map<const VectorXd>(evaluator_.rigid_body(states_).data(), q.size());
  }
  /// Sum of each joint's effects in a tick that is not taken.
  VectorXd tried_effects(const VectorXd& q, const VectorXd& dq, const VectorXd& ddq) {
    take(q, dq, ddq);
    evaluator_.mark();
    evaluator_.tick(states_, saturations_);
    evaluator_.rewind();
    return Eigen::Map<const VectorXd>(evaluator_.effects().data(), q.size());
  }
  /// The effects but for the rotors. load_friction sees the load of the acceleration before.
  VectorXd friction(const VectorXd& q, const VectorXd& v) { return tried_effects(q, v, a_) - rotors_ * a_; }

  /// d(residual)/dv; `here` is friction(q, v).
  MatrixXd jacobian(const MatrixXd& m, const VectorXd& q, const VectorXd& v, const VectorXd& here) {
    const VectorXd small = 1e-3 * width_;
    MatrixXd j = m;
    if (coupled_) {
      for (Index k = 0; k < v.size(); ++k)
        j.col(k) += (friction(q, v + small[k] * VectorXd::Unit(v.size(), k)) - here) / small[k];
    } else {
      const VectorXd slope = (friction(q, v + small) - here).cwiseQuotient(small);
      j.diagonal() += slope.cwiseMax(-0.5 * m.diagonal());
    }
    return j;
  }

  bool coupled_;
  Evaluator<Real> evaluator_;
  double h_;
  VectorXd q_, v_, a_, width_;
  MatrixXd rotors_;
  std::vector<JointState<Real>> states_;
  Saturations saturations_;
};

}  // namespace

IdentifiedModel forward_plant(IdentifiedModel model) {
  for (JointFit& joint : model.joints) {
    std::erase_if(joint.effects, [](const EffectFit& fit) {
      const EffectInfo* info = find_effect(fit.effect);
      return info != nullptr && (info->needs_total || info->acts_on == ActsOn::position);
    });
  }
  return model;
}

void SeenMotion::look(const VectorXd& q, const VectorXd& dq) {
  if (encoder_ <= 0) {
    q_ = q;
    dq_ = dq;
    return;
  }
  const VectorXd now = (q / encoder_).array().round() * encoder_;
  dq_ = q_.size() == 0 ? dq : VectorXd((now - q_) / period_s_);
  q_ = now;
}

ClosedLoopRun run_closed_loop(const IdentifiedModel& plant, const Reference& reference,
                              const ClosedLoopSettings& settings) {
  const Index samples = reference.q.rows(), n = reference.q.cols();
  ClosedLoopRun run{{MatrixXd(samples, n), MatrixXd(samples, n), MatrixXd(samples, n)}, MatrixXd(samples, n)};
  if (samples == 0) return run;
  Plant robot(plant, reference.q.row(0), reference.dq.row(0), reference.ddq.row(0),
              reference.step_s / settings.substeps, settings.age_s);
  const double w = 2 * std::numbers::pi * settings.bandwidth_hz;
  const VectorXd inertia = robot.mass(robot.q()).diagonal();
  const VectorXd kp = w * w * inertia, kd = 2 * settings.damping * w * inertia;
  VectorXd tau(n), before;
  SeenMotion seen(settings, reference.step_s);
  for (Index k = 0; k < samples; ++k) {
    if (k % settings.hold == 0) {
      seen.look(robot.q(), robot.v());
      tau = kp.cwiseProduct(reference.q.row(k).transpose() - seen.q()) +
            kd.cwiseProduct(reference.dq.row(k).transpose() - seen.dq());
      if (reference.feedforward.size() > 0) tau += reference.feedforward.row(k).transpose();
    }
    run.q.row(k) = robot.q();
    run.dq.row(k) = robot.v();
    run.tau.row(k) = tau;
    for (int s = 0; s < settings.substeps; ++s) {
      robot.step(tau);
      if (s == 0) run.ddq.row(k) = k == 0 ? robot.a() : VectorXd(0.5 * (before + robot.a()));
    }
    before = robot.a();
  }
  return run;
}

MatrixXd run_open_loop(const IdentifiedModel& plant, const OpenLoopStart& start, double step_s, const MatrixXd& tau,
                       int substeps, double age_s) {
  MatrixXd q(tau.rows(), tau.cols());
  if (tau.rows() == 0) return q;
  Plant robot(plant, start.q, start.dq, start.ddq, step_s / substeps, age_s);
  for (Index k = 0;; ++k) {
    q.row(k) = robot.q();
    if (k + 1 == tau.rows()) return q;
    for (int s = 0; s < substeps; ++s) {
      const double share = (s + 0.5) / substeps;  // the mean over the substep
      robot.step((1 - share) * tau.row(k).transpose() + share * tau.row(k + 1).transpose());
    }
  }
}

}  // namespace fxdyn

#include "host_tools/simulate/mujoco_plant.hpp"

#include <cmath>
#include <numbers>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/simulate/mujoco_forces.hpp"
#include "host_tools/simulate/mujoco_model.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of MuJoCo's forward dynamics [s]; its integrator is of first order.
constexpr double longest_step = 0.000125;

MatrixXd rigid_body(const IdentifiedModel& plant, const Reference& motion) {
  const MujocoModel robot(plant, {.bare = true});
  MatrixXd tau(motion.q.rows(), motion.q.cols());
  for (Index k = 0; k < tau.rows(); ++k) {
    for (Index j = 0; j < tau.cols(); ++j) {
      robot.data->qpos[j] = motion.q(k, j);
      robot.data->qvel[j] = motion.dq(k, j);
      robot.data->qacc[j] = motion.ddq(k, j);
    }
    mj_inverse(robot.model.get(), robot.data.get());
    for (Index j = 0; j < tau.cols(); ++j) tau(k, j) = robot.data->qfrc_inverse[j];
  }
  return tau;
}

/// Encoders of motors at dq, ddq; the link is at q_encoder - delta with delta by what the encoder shows.
void show_eccentricity(const IdentifiedModel& plant, PlantRun& run) {
  for (Index j = 0; j < run.q.cols(); ++j) {
    const JointFit& joint = joints_of(plant)[static_cast<std::size_t>(j)];
    if (joint.find("eccentricity") == nullptr) continue;
    for (Index k = 0; k < run.q.rows(); ++k) {
      const double motor = run.q(k, j);
      double shown = motor;
      for (int i = 0; i < 30; ++i) shown = motor + eccentric(joint, shown).delta;  // contracts by |delta| <= 0.15
      const Eccentric e = eccentric(joint, shown);
      run.q(k, j) = shown;
      run.dq(k, j) /= 1 - e.slope;
      run.ddq(k, j) = (run.ddq(k, j) + e.curvature * run.dq(k, j) * run.dq(k, j)) / (1 - e.slope);
      run.deflections(k, j) += e.delta;
    }
  }
}

bool depends_on_load(const IdentifiedModel& plant) {
  for (const JointFit& joint : joints_of(plant)) {
    for (const char* name : {"load_friction", "load_curve", "elasticity", "backlash"}) {
      if (joint.find(name) != nullptr) return true;
    }
  }
  return false;
}

/// A controlled robot: motors' and gears' state in MuJoCo.
class ControlledRobot {
 public:
  ControlledRobot(const IdentifiedModel& plant, const Reference& reference, double step_s, double age_s)
      : forces_(plant), robot_(plant, {.step_s = step_s}), age_s_(age_s) {
    const Index n = reference.q.cols();
    now_.q = reference.q.row(0);
    now_.dq = reference.dq.row(0);
    now_.ddq = reference.ddq.row(0);
    now_.load = VectorXd::Zero(n);
    // gears start bent by the load
    const MatrixXd load = rigid_body(
        plant, {reference.step_s, reference.q.row(0), reference.dq.row(0), reference.ddq.row(0), MatrixXd()});
    const MatrixXd bent = gear_deflections(plant, step_s, load);
    for (Index j = 0; j < n; ++j) {
      const auto i = static_cast<std::size_t>(j);
      const double delta = robot_.gear[i] >= 0 ? bent(0, j) : 0;
      robot_.data->qpos[robot_.motor[i]] = now_.q[j];
      robot_.data->qvel[robot_.motor[i]] = now_.dq[j];
      if (robot_.gear[i] >= 0) robot_.data->qpos[robot_.gear[i]] = -delta;
    }
    mj_forward(robot_.model.get(), robot_.data.get());
    read();
  }

  /// Inertia that each motor turns [kg m^2 | kg].
  VectorXd inertia() const {
    const int nv = robot_.model->nv;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> full(nv, nv);
    mj_fullM(robot_.model.get(), full.data(), robot_.data->qM);
    VectorXd diagonal(now_.q.size());
    for (Index j = 0; j < diagonal.size(); ++j) {
      const int at = robot_.motor[static_cast<std::size_t>(j)];
      diagonal[j] = full(at, at);
    }
    return diagonal;
  }
  /// Motors [rad | m], and what the gears are bent by.
  const DriveState& now() const { return now_; }
  VectorXd deflection() const {
    VectorXd delta = VectorXd::Zero(now_.q.size());
    for (Index j = 0; j < delta.size(); ++j) {
      const int at = robot_.gear[static_cast<std::size_t>(j)];
      if (at >= 0) delta[j] = -robot_.data->qpos[at];
    }
    return delta;
  }

  void step(const VectorXd& tau) {
    mjData& data = *robot_.data;
    now_.time_s = age_s_ + data.time;
    const VectorXd applied = tau - forces_(now_);
    for (Index j = 0; j < applied.size(); ++j)
      data.qfrc_applied[robot_.motor[static_cast<std::size_t>(j)]] = applied[j];
    mj_step(robot_.model.get(), &data);
    for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
      if (data.warning[warning].number > 0) throw RunsAway();
    }
    read();
  }

 private:
  void read() {
    const mjData& data = *robot_.data;
    for (Index j = 0; j < now_.q.size(); ++j) {
      const int at = robot_.motor[static_cast<std::size_t>(j)], gear = robot_.gear[static_cast<std::size_t>(j)];
      now_.q[j] = data.qpos[at];
      now_.dq[j] = data.qvel[at];
      now_.ddq[j] = data.qacc[at];
      // the link feels what the motor passes on: the gear's spring, or all but the rotor's own
      if (gear >= 0) {
        now_.load[j] = data.qfrc_passive[gear];
      } else {
        now_.load[j] = data.qfrc_applied[at] + data.qfrc_passive[at] + data.qfrc_constraint[at] -
                       robot_.model->dof_armature[at] * data.qacc[at];
      }
    }
  }

  DriveForces forces_;
  MujocoModel robot_;
  double age_s_;
  DriveState now_;
};

}  // namespace

PlantRun prescribed_on_mujoco(const IdentifiedModel& plant, const Reference& links, double age_s) {
  const Index samples = links.q.rows(), n = links.q.cols();
  PlantRun run;
  run.step_s = links.step_s;
  run.q = links.q;
  run.dq = links.dq;
  run.ddq = links.ddq;
  run.tau.resize(samples, n);
  MatrixXd load = MatrixXd::Zero(samples, n);
  if (depends_on_load(plant)) load = rigid_body(plant, links);
  // Where the links' motion is given, their load is, and with it where the motors have to be.
  run.deflections = gear_deflections(plant, run.step_s, load);
  const MatrixXd rate = differentiate(run.deflections, run.step_s);
  const MatrixXd push = differentiate_twice(run.deflections, run.step_s);
  run.q += run.deflections;
  run.dq += rate;
  run.ddq += push;

  const MujocoModel robot(plant, {.gears = false});
  DriveForces forces(plant);
  for (Index k = 0; k < samples; ++k) {
    for (Index j = 0; j < n; ++j) {
      const int at = robot.motor[static_cast<std::size_t>(j)], gear = robot.gear[static_cast<std::size_t>(j)];
      robot.data->qpos[at] = run.q(k, j);
      robot.data->qvel[at] = run.dq(k, j);
      robot.data->qacc[at] = run.ddq(k, j);
      if (gear < 0) continue;
      robot.data->qpos[gear] = -run.deflections(k, j);
      robot.data->qvel[gear] = -rate(k, j);
      robot.data->qacc[gear] = -push(k, j);
    }
    mj_inverse(robot.model.get(), robot.data.get());
    const VectorXd more =
        forces({run.q.row(k), run.dq.row(k), run.ddq.row(k), load.row(k), age_s + run.step_s * static_cast<double>(k)});
    for (Index j = 0; j < n; ++j)
      run.tau(k, j) = robot.data->qfrc_inverse[robot.motor[static_cast<std::size_t>(j)]] + more[j];
  }
  show_eccentricity(plant, run);
  measure_torque(plant, run.step_s, run.tau);
  return run;
}

PlantRun closed_loop_on_mujoco(const IdentifiedModel& plant, const Reference& reference,
                               const ClosedLoopSettings& settings) {
  const Index samples = reference.q.rows(), n = reference.q.cols();
  PlantRun run;
  run.step_s = reference.step_s;
  for (MatrixXd* signal : {&run.q, &run.dq, &run.ddq, &run.tau, &run.deflections}) signal->resize(samples, n);
  const int substeps = std::max(settings.substeps, static_cast<int>(std::ceil(run.step_s / longest_step - 1e-9)));
  const double step = run.step_s / substeps;
  ControlledRobot robot(plant, reference, step, settings.age_s);
  const double w = 2 * std::numbers::pi * settings.bandwidth_hz;
  const VectorXd inertia = robot.inertia();
  const VectorXd kp = w * w * inertia, kd = 2 * settings.damping * w * inertia;
  VectorXd tau, before;
  SeenMotion seen(settings, run.step_s);
  for (Index k = 0; k < samples; ++k) {
    if (k % settings.hold == 0) {
      VectorXd shown = robot.now().q;
      for (Index j = 0; j < n; ++j) {
        for (int i = 0; i < 30; ++i)
          shown[j] = robot.now().q[j] + eccentric(joints_of(plant)[static_cast<std::size_t>(j)], shown[j]).delta;
      }
      seen.look(shown, robot.now().dq);
      tau = kp.cwiseProduct(reference.q.row(k).transpose() - seen.q()) +
            kd.cwiseProduct(reference.dq.row(k).transpose() - seen.dq());
      if (reference.feedforward.size() > 0) tau += reference.feedforward.row(k).transpose();
      if (settings.drive) tau += settings.drive(k);
      if (k == 0) before = tau;
    }
    run.q.row(k) = robot.now().q;
    run.deflections.row(k) = robot.deflection();
    run.tau.row(k) = 0.5 * (before + tau);
    before = tau;
    for (int s = 0; s < substeps; ++s) {
      const VectorXd v = robot.now().dq;
      robot.step(tau);
      if (s > 0) continue;
      // the step takes q on with the new velocity: these are the central differences of q
      run.dq.row(k) = 0.5 * (v + robot.now().dq);
      run.ddq.row(k) = (robot.now().dq - v) / step;
    }
  }
  show_eccentricity(plant, run);
  measure_torque(plant, run.step_s, run.tau);
  return run;
}

std::optional<std::string> mujoco_refuses(const JointFit& joint, const EffectFit& effect, bool closed_loop) {
  if (effect.effect == "elasticity" && joint.find("rotor_inertia") == nullptr)
    return "elasticity on plant \"mujoco\" needs a rotor_inertia on the same joint";
  if (!closed_loop) return {};
  if (effect.effect == "backlash") return "backlash on plant \"mujoco\" needs motion = \"prescribed\"";
  if (effect.effect == "motor_coupling" && effect.linear[2] > 0)
    return "motor_coupling with inertia on plant \"mujoco\" needs motion = \"prescribed\"";
  return {};
}

}  // namespace fxdyn

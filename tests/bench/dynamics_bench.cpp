// Inverse dynamics and torque regressor of the PUMA 560, one sample an iteration, beside KDL's and MuJoCo's inverse
// dynamics of the same robot at the same states.

#include <benchmark/benchmark.h>
#include <mujoco/mujoco.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "host_tools/regression/regressor.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/kdl.hpp"

namespace fxdyn {
namespace {

/// States that are cycled through, so that no branch predictor or cache learns one pose.
struct States {
  static constexpr std::size_t count = 256;
  std::vector<Eigen::VectorXd> q, dq, ddq;
  explicit States(std::size_t joints) {
    test::Chains random(7);
    for (std::size_t k = 0; k < count; ++k) {
      q.push_back(random.joints(joints, 2.5));
      dq.push_back(random.joints(joints, 2));
      ddq.push_back(random.joints(joints, 8));
    }
  }
};

void rnea_fxdyn(benchmark::State& state) {
  const Robot robot = read_urdf(test::puma560);
  const States states(robot.size());
  const DhChain chain = to_dh(robot);
  std::vector<LinkInertia<Real>> inertia;
  for (std::size_t i = 0; i < robot.size(); ++i)
    inertia.push_back(to_link_inertia(robot.joints[i].inertial.value_or(Inertial{}), chain.urdf_in_dh[i]));
  constexpr std::size_t n = 6;
  std::array<JointState<Real>, n> joints;
  std::array<LinkMotion<Real>, n> motions;
  std::array<Wrench<Real>, n> wrenches;
  std::array<double, n> tau{};
  std::size_t k = 0;
  for (auto _ : state) {
    for (std::size_t i = 0; i < n; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      joints[i] = {states.q[k][j], states.dq[k][j], states.ddq[k][j]};
    }
    rnea<Real, n>(std::span<const LinkGeometry<Real>, n>(chain.links), std::span<const LinkInertia<Real>, n>(inertia),
                  {chain.up.x(), chain.up.y(), chain.up.z()}, joints, motions, wrenches, tau);
    benchmark::DoNotOptimize(tau);
    k = (k + 1) % States::count;
  }
}
BENCHMARK(rnea_fxdyn);

void regressor_fxdyn(benchmark::State& state) {
  const Robot robot = read_urdf(test::puma560);
  const States states(robot.size());
  Regressor regressor(to_dh(robot));
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(regressor(states.q[k], states.dq[k], states.ddq[k]).data());
    k = (k + 1) % States::count;
  }
}
BENCHMARK(regressor_fxdyn);

void rnea_kdl(benchmark::State& state) {
  const Robot robot = read_urdf(test::puma560);
  const States states(robot.size());
  const KDL::Chain chain = test::to_kdl(robot);
  KDL::ChainIdSolver_RNE solver(chain, test::to_kdl(robot.gravity));
  const KDL::Wrenches none(robot.size(), KDL::Wrench::Zero());
  const auto joints = static_cast<unsigned>(robot.size());
  std::vector<KDL::JntArray> q, dq, ddq;
  for (std::size_t k = 0; k < States::count; ++k) {
    for (auto* list : {&q, &dq, &ddq}) list->emplace_back(joints);
    q[k].data = states.q[k];
    dq[k].data = states.dq[k];
    ddq[k].data = states.ddq[k];
  }
  KDL::JntArray tau(joints);
  std::size_t k = 0;
  for (auto _ : state) {
    solver.CartToJnt(q[k], dq[k], ddq[k], none, tau);
    benchmark::DoNotOptimize(tau.data.data());
    k = (k + 1) % States::count;
  }
}
BENCHMARK(rnea_kdl);

void rnea_mujoco(benchmark::State& state) {
  // The published moments of link 3 miss the triangle inequality (puma560.urdf); MuJoCo has to be told to mend that.
  std::string urdf = read_file(test::puma560);
  urdf.insert(urdf.find("<link"), "<mujoco><compiler balanceinertia=\"true\"/></mujoco>\n");
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "fxdyn_bench_puma560.urdf";
  write_file(file, urdf);
  std::array<char, 500> error{};
  mjModel* model = mj_loadXML(file.c_str(), nullptr, error.data(), static_cast<int>(error.size()));
  std::filesystem::remove(file);
  if (model == nullptr) {
    state.SkipWithError(error.data());
    return;
  }
  // Nothing but the rigid body: no contacts, no limits, no passive forces.
  model->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_PASSIVE | mjDSBL_ACTUATION | mjDSBL_SENSOR;
  mjData* data = mj_makeData(model);
  const States states(static_cast<std::size_t>(model->nv));
  std::size_t k = 0;
  for (auto _ : state) {
    for (int i = 0; i < model->nv; ++i) {
      data->qpos[i] = states.q[k][i];
      data->qvel[i] = states.dq[k][i];
      data->qacc[i] = states.ddq[k][i];
    }
    mj_inverse(model, data);
    benchmark::DoNotOptimize(data->qfrc_inverse);
    k = (k + 1) % States::count;
  }
  mj_deleteData(data);
  mj_deleteModel(model);
}
BENCHMARK(rnea_mujoco);

}  // namespace
}  // namespace fxdyn

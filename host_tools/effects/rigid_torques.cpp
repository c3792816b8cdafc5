#include "host_tools/effects/rigid_torques.hpp"

#include <algorithm>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/numbers/side_by_side.hpp"
#include "host_tools/robot/robot.hpp"
#include "model/catalogue.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A matrix of samples x joints: where its first column is, and from there on how far the next one.
template <class T>
struct Columns {
  T* first;
  Index stride;
  T* at(Index row, std::size_t column) const { return first + row + static_cast<Index>(column) * stride; }
};

struct Samples {
  Columns<const double> q, dq, ddq;
  Columns<double> tau;
  Index count;
};

/// The last samples are fewer than a vector has: the rest of it repeats the last one.
template <int count>
[[gnu::always_inline]] inline Lanes<count> load(const double* from, Index there) {
  if (there >= count) return {Vector<count>::at(from).value};
  Lanes<count> out;
  for (int i = 0; i < count; ++i) out.x[i] = from[std::min<Index>(i, there - 1)];
  return out;
}

template <int count>
[[gnu::always_inline]] inline void store(Lanes<count> x, double* to, Index there) {
  if (there >= count) {
    Vector<count>::at(to).value = x.x;
    return;
  }
  for (int i = 0; i < there; ++i) to[i] = x.x[i];
}

template <int count>
[[gnu::always_inline]] inline void torques(const RigidBody& body, const Samples& samples) {
  using N = SideBySide<count>;
  const std::size_t n = body.geometry.size();
  std::vector<LinkGeometry<N>> geometry(n);
  std::vector<LinkInertia<N>> inertia(n);
  const auto three = [](const Vector3<double>& v) {
    return Vector3<Lanes<count>>{N::all(v.x), N::all(v.y), N::all(v.z)};
  };
  for (std::size_t i = 0; i < n; ++i) {
    const LinkGeometry<Real>& g = body.geometry[i];
    geometry[i] = {g.type, N::all(g.cos_alpha), N::all(g.sin_alpha), three(g.p), N::all(g.theta)};
    const LinkInertia<Real>& b = body.inertia[i];
    inertia[i] = {N::all(b.m),  three(b.h),   N::all(b.xx), N::all(b.yy),
                  N::all(b.zz), N::all(b.xy), N::all(b.xz), N::all(b.yz)};
  }
  std::vector<JointState<N>> states(n);
  std::vector<LinkMotion<N>> motions(n);
  std::vector<Wrench<N>> wrenches(n);
  std::vector<Lanes<count>> tau(n);
  for (Index k = 0; k < samples.count; k += count) {
    const Index there = samples.count - k;
    for (std::size_t i = 0; i < n; ++i)
      states[i] = {load<count>(samples.q.at(k, i), there), load<count>(samples.dq.at(k, i), there),
                   load<count>(samples.ddq.at(k, i), there)};
    rnea<N, std::dynamic_extent>(geometry, inertia, three(body.up), states, motions, wrenches, tau);
    for (std::size_t i = 0; i < n; ++i) store<count>(tau[i], samples.tau.at(k, i), there);
  }
}

void torques_two(const RigidBody& body, const Samples& samples) { torques<2>(body, samples); }
#ifdef __clang__
// It does not compile the functions below once more for other processors: `flatten` of GCC does.
constexpr auto torques_four = torques_two, torques_eight = torques_two;
#else
FXDYN_FOUR_AT_ONCE [[gnu::flatten]] void torques_four(const RigidBody& body, const Samples& samples) {
  torques<4>(body, samples);
}
FXDYN_EIGHT_AT_ONCE [[gnu::flatten]] void torques_eight(const RigidBody& body, const Samples& samples) {
  torques<8>(body, samples);
}
#endif

}  // namespace

RigidBody rigid_body_of(const IdentifiedModel& model) {
  Robot robot = robot_of(model);
  for (const EffectFit& fit : body_of(model)) {
    BodyEffects::for_each([&]<class E>() {
      if constexpr (requires { &E::turn; }) {
        if (E::name != fit.effect) return;
        const Eigen::Vector3d& g = robot.gravity;
        const auto up = E::turn({-g.x(), -g.y(), -g.z()}, fit.linear[0], fit.linear[1]);
        robot.gravity = {-up.x, -up.y, -up.z};
      }
    });
  }
  const DhChain chain = to_dh(robot);
  RigidBody out{{chain.links.begin(), chain.links.end()},
                {inertia_of(model).begin(), inertia_of(model).end()},
                {chain.up.x(), chain.up.y(), chain.up.z()}};
  for (const EffectFit& fit : body_of(model)) {
    if (!is_load(fit.effect)) continue;
    out.inertia.back() =
        with_load(out.inertia.back(), fit.linear[0], {fit.linear[1], fit.linear[2], fit.linear[3]}, chain);
  }
  return out;
}

void rigid_torques(const RigidBody& body, const Eigen::Ref<const MatrixXd>& q, const Eigen::Ref<const MatrixXd>& dq,
                   const Eigen::Ref<const MatrixXd>& ddq, Eigen::Ref<MatrixXd> tau) {
  const Samples samples{{q.data(), q.outerStride()},
                        {dq.data(), dq.outerStride()},
                        {ddq.data(), ddq.outerStride()},
                        {tau.data(), tau.outerStride()},
                        q.rows()};
  widest(&*torques_eight, &*torques_four, &*torques_two)(body, samples);
}

}  // namespace fxdyn

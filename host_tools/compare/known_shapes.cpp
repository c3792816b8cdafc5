#include "host_tools/compare/known_shapes.hpp"

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/identify/estimate.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/identify/structure.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

void draw_noise(GateData& data, const IdentifiedModel& truth, std::uint64_t seed) {
  Random random(seed);
  for (ProcessedLog& log : data.logs) {
    const MatrixXd clean = predict(truth, log);
    for (Index j = 0; j < log.tau.cols(); ++j) {
      const double noise = (log.tau.col(j) - clean.col(j)).norm() / std::sqrt(static_cast<double>(log.tau.rows()));
      for (Index k = 0; k < log.tau.rows(); ++k) log.tau(k, j) = clean(k, j) + noise * random.normal();
    }
  }
}

/// Of the truth: effects that can be identified, with its shapes.
std::vector<JointFit> true_design(const Project& project, const GateData& data, const IdentifiedModel& truth) {
  const DhChain chain = to_dh(project.robot);
  const BaseSet base = find_base(chain);
  std::vector<JointFit> design = initial_joints(project, data);
  for (std::size_t j = 0; j < design.size(); ++j) {
    design[j].sign_width = truth.joints[j].sign_width;
    for (const EffectFit& fit : truth.joints[j].effects) {
      if (in_base(fit.effect) && rotor_inertia_is_absorbed(chain, base, static_cast<Index>(j))) continue;
      if (why_not_identified(*find_effect(fit.effect)).empty()) design[j].effects.push_back(fit);
    }
  }
  return design;
}

}  // namespace

IdentifiedModel with_known_shapes(const Project& project, GateData data, const IdentifiedModel& truth,
                                  std::uint64_t draw) {
  if (draw > 0) draw_noise(data, truth, draw);
  Fitter fitter(project.robot, data.logs, true_design(project, data, truth));
  set_prior(fitter, project);
  fitter.reweight();
  return finish_model(fitter, with_structure(project, {}, "wls"), data).model;
}

}  // namespace fxdyn

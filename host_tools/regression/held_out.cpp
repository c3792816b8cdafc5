// Errors on rows that a fit has not seen: what Fitter judges designs by.

#include <cmath>

#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/own_columns.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn {

void Fitter::Tally::add(std::size_t i, const Fitter& fitter, std::size_t joint, std::size_t fold,
                        const MomentsByBlock& own, const JointFit& design, const Solution& solution) {
  Judgement& judgement = judgements[i];
  for (const std::size_t b : fitter.data_->split.judge[fold]) {
    const double error = fitter.square_error(joint, b, own[b], solution), rows = fitter.base_moments_[joint][b].count;
    judgement.blocks.push_back(std::sqrt(error / std::max(rows, 1.0)));
    square[i] += error;
    count[i] += rows;
  }
  const Eigen::VectorXd& theta = solution.theta[joint];
  judgement.physical &= last_is_physical(design, theta);
  if (design.bls)
    judgement.coefficient_sum =
        std::max(judgement.coefficient_sum, theta.tail(design.bls->coefficient_count()).cwiseAbs().sum());
}

std::vector<Judgement> Fitter::Tally::done(bool one_log) {
  for (std::size_t i = 0; i < judgements.size(); ++i) {
    judgements[i].rmse = std::sqrt(square[i] / std::max(count[i], 1.0));
    judgements[i].blocks_of_one_log = one_log;
  }
  return std::move(judgements);
}

std::vector<Judgement> Fitter::judged(std::size_t first, std::size_t last,
                                      const std::vector<const MomentsByBlock*>& all,
                                      const std::vector<const JointFit*>& design) const {
  Tally tally(last - first);
  for (std::size_t fold = 0; fold < data_->split.fit.size(); ++fold) {
    const Solution solution = solve(assemble(data_->split.fit[fold], all, design));
    for (std::size_t j = first; j < last; ++j) tally.add(j - first, *this, j, fold, *all[j], *design[j], solution);
  }
  return tally.done(data_->one_recording);
}

std::vector<Judgement> Fitter::held_out() const { return judged(0, joints(), current(), designs()); }

std::vector<Judgement> Fitter::held_out_with(std::size_t joint, const JointFit& candidate,
                                             const std::vector<double>& ridges) const {
  std::vector<JointFit> designs_with = design_;
  designs_with[joint] = candidate;
  const MomentsByBlock own = own_moments(joint, own_rows(joint, designs_with));
  JointFit design = candidate;
  std::vector<const MomentsByBlock*> all = current();
  std::vector<const JointFit*> used = designs();
  all[joint] = &own;
  used[joint] = &design;
  std::vector<Judgement> out;
  for (const double ridge : ridges) {
    if (design.bls) design.bls->ridge = ridge;
    out.push_back(judged(joint, joint + 1, all, used)[0]);
  }
  return out;
}

std::vector<std::vector<Judgement>> Fitter::held_out_with(std::size_t joint, const JointFit& candidate,
                                                          const std::vector<Eigen::Index>& sizes,
                                                          const std::vector<double>& ridges) const {
  std::vector<JointFit> designs_with = design_;
  designs_with[joint] = candidate;
  const MomentsByBlock own = own_moments(joint, own_rows(joint, designs_with));
  JointFit whole = candidate;
  whole.bls->ridge = 0;  // comes last
  std::vector<const MomentsByBlock*> all = current();
  std::vector<const JointFit*> used = designs();
  all[joint] = &own;
  used[joint] = &whole;
  const Eigen::Index coefficients = candidate.bls->coefficient_count(), inputs = candidate.bls->input_count();
  const Eigen::Index theta = own_count(candidate), effects = theta - coefficients;

  // Of each size: its design, and the leading part of the moments.
  std::vector<JointFit> design(sizes.size(), candidate);
  std::vector<MomentsByBlock> part(sizes.size(), own);
  std::vector<std::vector<Tally>> tallies(sizes.size(), std::vector<Tally>(ridges.size(), Tally(1)));
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    design[s].bls->weights = candidate.bls->weights.topRows(sizes[s]);
    const Eigen::Index count = effects + inputs + sizes[s];
    for (JointMoments& m : part[s]) {
      m.cross = m.cross.leftCols(count).eval();
      m.gram = m.gram.topLeftCorner(count, count).eval();
      m.projection = m.projection.head(count).eval();
    }
  }
  for (std::size_t fold = 0; fold < data_->split.fit.size(); ++fold) {
    const NormalEquations equations = assemble(data_->split.fit[fold], all, used);
    // The BLS's unknowns behind all others: they grow.
    const Eigen::Index p = equations.offset.back(), fixed = p - coefficients;
    const Eigen::Index at = equations.offset[joint] + effects;
    Eigen::VectorXi order(p);
    for (Eigen::Index i = 0; i < p; ++i)
      order[i] = static_cast<int>(i < at ? i : (i < fixed ? i + coefficients : at + i - fixed));
    const Eigen::MatrixXd a = equations.information(order, order);
    const Eigen::VectorXd b = equations.projection(order);
    double rows = 0;
    for (const std::size_t block : data_->split.fit[fold]) rows += base_moments_[joint][block].count;
    GrowingSolver structure(a, b);
    structure.grow(fixed);
    for (std::size_t r = 0; r < ridges.size(); ++r) {
      GrowingSolver grown = structure;
      grown.set_ridge(weights_[static_cast<Eigen::Index>(joint)] * rows * ridges[r]);
      for (std::size_t s = 0; s < sizes.size(); ++s) {
        const Eigen::Index known = fixed + inputs + sizes[s];
        Eigen::VectorXd x = Eigen::VectorXd::Zero(p);
        x(order.head(known)) = grown.solve(known);
        Solution solution = split(equations.offset, x);
        solution.theta[joint].conservativeResize(effects + inputs + sizes[s]);
        tallies[s][r].add(0, *this, joint, fold, part[s], design[s], solution);
      }
    }
  }
  std::vector<std::vector<Judgement>> out(sizes.size());
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    for (Tally& tally : tallies[s]) out[s].push_back(tally.done(data_->one_recording)[0]);
  }
  return out;
}

}  // namespace fxdyn

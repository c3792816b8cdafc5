#include "host_tools/vibration/outcome.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/model_parts.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double mean_square(const MatrixXd& m) { return m.squaredNorm() / static_cast<double>(m.size()); }

/// Largest |off| of each joint, mean over the joints.
double largest(const MatrixXd& off) { return off.colwise().maxCoeff().mean(); }

/// RMS of the torque's change from tick to tick, of rated, mean over the joints.
double roughness(const MatrixXd& tau, const IdentifiedModel& plant) {
  const Index changes = tau.rows() - 1;
  double sum = 0;
  for (Index j = 0; j < tau.cols(); ++j) {
    const VectorXd change = tau.col(j).tail(changes) - tau.col(j).head(changes);
    sum += std::sqrt(change.squaredNorm() / static_cast<double>(changes)) /
           joints_of(plant)[static_cast<std::size_t>(j)].rated_torque;
  }
  return sum / static_cast<double>(tau.cols());
}

}  // namespace

Outcome outcome_of(const PlantRun& run, const Move& move, const Reference& asked, const IdentifiedModel& plant,
                   const Instants& instants) {
  const MatrixXd link = run.q - run.deflections;
  const Index moving = move.stop - move.start, rows = run.q.rows();
  Outcome out;
  out.motor = mean_square((run.q - asked.q).middleRows(move.start, moving));
  const MatrixXd error = link - move.reference.q;
  out.link = mean_square(error.middleRows(move.start, moving));
  out.with_rest = mean_square(error.bottomRows(rows - move.start));
  // its place at the end: the mean over the last tenth of a second
  const auto last = static_cast<Index>(std::lround(0.1 / run.step_s));
  const Eigen::RowVectorXd end = link.bottomRows(last).colwise().mean();
  const MatrixXd off = (link.rowwise() - end).cwiseAbs();
  const auto late = move.asked_stop + static_cast<Index>(std::lround(instants.late_s / run.step_s));
  out.residual = largest(off.bottomRows(rows - move.stop));
  out.late = largest(off.bottomRows(rows - late));
  Index still = move.asked_stop;
  for (Index k = still; k < rows; ++k) {
    if (off.row(k).maxCoeff() > instants.band) still = k + 1;
  }
  out.still_s = run.step_s * static_cast<double>(still - move.asked_stop);
  out.settling_s = run.step_s * static_cast<double>(std::max<Index>(0, still - move.stop));
  out.roughness = roughness(run.tau.middleRows(move.start, moving), plant);
  out.q = run.q;
  return out;
}

void set_means(VibrationMethod& method, const std::vector<Move>& moves, const std::vector<Outcome>& outcomes) {
  const auto mean = [&](const std::string& kind) {
    Outcome sum;
    double count = 0;
    for (std::size_t i = 0; i < moves.size(); ++i) {
      if (kind != "all" && moves[i].kind != kind) continue;
      const Outcome& o = outcomes[i];
      ++count;
      for (double Outcome::*value : {&Outcome::motor, &Outcome::link, &Outcome::residual, &Outcome::late,
                                     &Outcome::settling_s, &Outcome::still_s, &Outcome::roughness})
        sum.*value += o.*value;
    }
    return VibrationFigures{.tracking_motor = 1e3 * std::sqrt(sum.motor / count),
                            .tracking_link = 1e3 * std::sqrt(sum.link / count),
                            .residual = 1e3 * sum.residual / count,
                            .settling_s = sum.settling_s / count,
                            .roughness = sum.roughness / count,
                            .residual_late = 1e3 * sum.late / count,
                            .still_s = sum.still_s / count};
  };
  method.all = mean("all");
  for (const Move& move : moves) {
    if (!method.kinds.contains(move.kind)) method.kinds[move.kind] = mean(move.kind);
  }
}

void add_ratios(VibrationMethod& method, const std::vector<VibrationMethod>& methods) {
  const std::map<std::string, double> own = by_name(method.all);
  for (const VibrationMethod& other : methods) {
    const std::string& name = other.feedforward;
    if ((name != "none" && name != "rigid") || !other.is_exact()) continue;
    for (const auto& [figure, base] : by_name(other.all)) {
      if (base > 0 && own.contains(figure)) method.ratios[name][figure] = own.at(figure) / base;
    }
  }
}

}  // namespace fxdyn

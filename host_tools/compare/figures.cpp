#include "host_tools/compare/figures.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "host_tools/page/comparison_plots.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr const char* truth_colour = "#222222";
constexpr const char* noise_colour = "#70e4572e";
constexpr const char* learned_colour = "#2e6fb7";
constexpr const char* learned = "bls_pso_physical";

struct Method {
  const char *name, *title, *colour;
};
constexpr Method paper_methods[] = {{"rls", "RLS", "#e4572e"},
                                    {"mlp", "MLP", "#2e6fb7"},
                                    {"bls_pso_friction", "BLS-PSO on q, dq, ddq (the paper's)", "#8e5ea2"},
                                    {learned, "BLS-PSO with memory (ours)", "#2a9d4a"}};

std::string time_label(const ComparedLog& log) { return fmt::format("time [s] in {}", log.log); }

std::string torque_label(const ComparedLog& log, Index j, const char* what) {
  const Joint& joint = log.robot->joints[static_cast<std::size_t>(j)];
  return fmt::format("{}: {} [{}]", joint.name, what, joint.torque_unit());
}

/// A chart of every joint, two in a row.
std::string of_joints(const ComparedLog& log, const char* what,
                      const std::function<std::vector<Trace>(Index)>& curves) {
  std::vector<Chart> charts;
  for (Index j = 0; j < log.reference.cols(); ++j)
    charts.push_back({time_label(log), torque_label(log, j, what), curves(j)});
  return draw(charts, 2);
}

/// Mean of |x| over a second around each sample.
VectorXd smoothed(const VectorXd& x, const VectorXd& t) {
  const double step = t.size() > 1 ? t[1] - t[0] : 1;
  const auto half = std::max<Index>(1, std::lround(0.5 / step));
  VectorXd sum(x.size() + 1);
  sum[0] = 0;
  for (Index k = 0; k < x.size(); ++k) sum[k + 1] = sum[k] + std::fabs(x[k]);
  VectorXd out(x.size());
  for (Index k = 0; k < x.size(); ++k) {
    const Index from = std::max<Index>(0, k - half), to = std::min<Index>(x.size(), k + half + 1);
    out[k] = (sum[to] - sum[from]) / static_cast<double>(to - from);
  }
  return out;
}

std::string trajectories(const ComparedLog& log) {
  static constexpr const char* colours[] = {"#2e6fb7", "#e4572e", "#2a9d4a", "#8e5ea2", "#b8860b", "#444444"};
  Chart chart{"time [s]", "q [rad | m]", {}};
  for (Index j = 0; j < log.train_q.cols(); ++j) {
    chart.curves.push_back(
        {log.train_t, log.train_q.col(j), colours[j % 6], 1.4, log.robot->joints[static_cast<std::size_t>(j)].name});
  }
  return draw({chart}, 1);
}

}  // namespace

void write_comparison_plots(const ComparedLog& log, const std::filesystem::path& directory) {
  for (const ComparisonPlot& plot : comparison_plots) std::filesystem::remove(directory / "plots" / plot.file);
  const auto write = [&](const char* file, const std::string& svg) {
    write_file(directory / "plots" / file, svg + "\n");
  };
  write("compare_trajectories.svg", trajectories(log));
  const auto ours = log.torque.find(learned);
  if (ours == log.torque.end()) return;
  const MatrixXd& predicted = ours->second;
  if (log.rigid.size() > 0) {
    const MatrixXd friction = log.reference - log.rigid, noisy = log.measured - log.rigid;
    write("compare_friction.svg", of_joints(log, "friction", [&](Index j) {
            return std::vector<Trace>{{log.t, noisy.col(j), noise_colour, 0.7, "measured"},
                                      {log.t, friction.col(j), truth_colour, 1.6, "true"},
                                      {log.t, log.learned_friction.col(j), learned_colour, 1.1, "learned"}};
          }));
    write("compare_friction_error.svg", of_joints(log, "error", [&](Index j) {
            return std::vector<Trace>{{log.t, log.learned_friction.col(j) - friction.col(j), learned_colour, 1, {}}};
          }));
  }
  write("compare_torque.svg", of_joints(log, "torque", [&](Index j) {
          return std::vector<Trace>{{log.t, log.reference.col(j), truth_colour, 1.6, log.reference_name},
                                    {log.t, predicted.col(j), learned_colour, 1, "predicted"}};
        }));
  write("compare_torque_error.svg", of_joints(log, "error", [&](Index j) {
          return std::vector<Trace>{{log.t, predicted.col(j) - log.reference.col(j), learned_colour, 1, {}}};
        }));
  std::vector<Chart> charts;
  Chart errors{time_label(log), "|error|, % of rated, mean of the joints", {}};
  for (const Method& method : paper_methods) {
    const auto found = log.torque.find(method.name);
    if (found == log.torque.end()) continue;
    charts.push_back({time_label(log),
                      torque_label(log, 0, "torque"),
                      {{log.t, log.reference.col(0), truth_colour, 1.8, log.reference_name},
                       {log.t, found->second.col(0), method.colour, 1.1, method.title}}});
    VectorXd mean = VectorXd::Zero(log.t.size());
    for (Index j = 0; j < log.reference.cols(); ++j) {
      const VectorXd error = found->second.col(j) - log.reference.col(j);
      mean += smoothed(error, log.t) *
              (100 / log.rated[static_cast<std::size_t>(j)] / static_cast<double>(log.reference.cols()));
    }
    errors.curves.push_back({log.t, mean, method.colour, 1.5, method.title});
  }
  write("compare_methods.svg", draw(charts, 1));
  write("compare_methods_error.svg", draw({errors}, 1));
}

}  // namespace fxdyn

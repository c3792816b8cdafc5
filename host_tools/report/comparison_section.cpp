#include <fmt/format.h>
#include <map>

#include <nlohmann/json.hpp>
#include <numeric>

#include "host_tools/page/comparison_plots.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/report/comparison_result.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using namespace page;
using nlohmann::json;

/// Table 2 of Han, Wu, Hui 2025, which gives no unit.
struct Published {
  const char *name, *method;
  double rmse, smoothness, time_s;
};
constexpr Published table_2[] = {{"rls", "RLS", 0.11723, 0.60058, 0.0001024},
                                 {"mlp", "MLP", 0.11116, 0.56249, 0.044911},
                                 {"bls_pso", "BLS-PSO on the rigid body", 0.10893, 0.55865, 0.0003557},
                                 {"bls_pso_friction", "BLS-PSO on Eq. 8", 0.10893, 0.55865, 0.0003557}};

std::string paper_table(const std::vector<MethodResult>& methods) {
  Table table({{"method"},
               {"RMSE", "n"},
               {"paper", "n"},
               {"smoothness", "n"},
               {"paper", "n"},
               {"time of a prediction [s]", "n"},
               {"paper", "n"}});
  for (const Published& row : table_2) {
    for (const MethodResult& method : methods) {
      if (method.name != row.name) continue;
      const std::vector<double>& rmse = method.rmse;
      table.add({{row.method},
                 number(std::accumulate(rmse.begin(), rmse.end(), 0.0) / static_cast<double>(rmse.size())),
                 number(row.rmse, 5),
                 number(method.smoothness, 3),
                 number(row.smoothness, 5),
                 number(1e-6 * method.predict_us, 2),
                 number(row.time_s, 4)});
    }
  }
  return subsection("Beside the paper's Table 2") + table.html("The paper's figures and ours") +
         paragraph(
             "RMSE is the mean over the joints in N m; the paper gives no unit, no robot and no test data, defines "
             "neither its smoothness nor what its time is of. BLS-PSO is the paper's, on q, dq, ddq. Eq. 8 has viscous "
             "and "
             "Coulomb friction in its structure, as the MLP and RLS have here; the other row learns what the rigid "
             "body "
             "alone leaves. Only the order of the methods can be compared.");
}

}  // namespace

std::string comparison_section(const ReportInput& input, const json& result) {
  const ComparisonResult comparison = comparison_of(result);
  const std::vector<MethodResult>& methods = comparison.methods;
  std::string out = section("Methods compared");
  out += paragraph(
      fmt::format("Every method had the same train and validate logs; errors on the test logs, against the {}.",
                  comparison.against_truth ? "truth" : "measurement"));
  std::vector<Cell> head{{"method"}, {"mean of rated", "n"}};
  for (std::size_t j = 0; j < methods.at(0).rmse.size(); ++j) head.push_back({fmt::format("joint {}", j + 1), "n"});
  for (const char* name : {"smoothness", "multiplications a tick", "training [s]", "us a prediction", "fixed - double"})
    head.push_back({name, "n"});
  Table table(head);
  for (const MethodResult& method : methods) {
    std::vector<Cell> row{{method.name}, {fmt::format("{:.3f} %", method.mean_percent_rated), "n"}};
    for (const double share : method.percent_rated) row.push_back({fmt::format("{:.3g} %", share), "n"});
    row.push_back(number(method.smoothness, 3));
    row.push_back({fmt::format("{:.0f}", method.macs_per_tick), "n"});
    row.push_back(method.train_s ? number(*method.train_s, 3) : Cell{"-", "n"});
    row.push_back(number(method.predict_us, 2));
    row.push_back(method.fixed_error ? Cell{fmt::format("{:.1e}", *method.fixed_error), "n"} : Cell{"-", "n"});
    table.add(row);
  }
  out += table.html("Errors, share of rated torque");
  out += paragraph(
      "RMSE of each joint as a share of its rated torque. Smoothness: how much the torque changes from sample to "
      "sample "
      "(RMS) beside the reference; 1 is as smooth. Fixed - double: the largest difference, of rated torque.");
  std::vector<Cell> joints_head{{"RMSE, peak [N*m | N]"}};
  for (std::size_t j = 0; j < methods.at(0).rmse.size(); ++j)
    joints_head.push_back({fmt::format("joint {}", j + 1), "n"});
  Table absolute(joints_head);
  for (const MethodResult& method : methods) {
    std::vector<Cell> row{{method.name}};
    for (std::size_t j = 0; j < method.rmse.size(); ++j)
      row.push_back({fmt::format("{:.3g}, {:.3g}", method.rmse[j], method.peak[j]), "n"});
    absolute.add(row);
  }
  out += absolute.html("Errors in N*m or N") + paragraph("RMSE of each joint, and its largest error at any sample.");
  if (comparison.paper) out += paper_table(methods);
  for (const ComparisonPlot& plot : comparison_plots) {
    const std::filesystem::path file = input.directory / "plots" / plot.file;
    if (std::filesystem::exists(file)) out += figure(read_file(file), plot.title);
  }
  return out;
}

}  // namespace fxdyn

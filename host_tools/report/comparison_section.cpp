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

std::string paper_table(const json& methods) {
  Table table({{"method"},
               {"RMSE", "n"},
               {"paper", "n"},
               {"smoothness", "n"},
               {"paper", "n"},
               {"time of a prediction [s]", "n"},
               {"paper", "n"}});
  for (const Published& row : table_2) {
    for (const json& method : methods) {
      if (method.at("name") != row.name) continue;
      const auto rmse = method.at("rmse").get<std::vector<double>>();
      table.add({{row.method},
                 number(std::accumulate(rmse.begin(), rmse.end(), 0.0) / static_cast<double>(rmse.size())),
                 number(row.rmse, 5),
                 number(method.at("smoothness"), 3),
                 number(row.smoothness, 5),
                 number(1e-6 * method.at("predict_us").get<double>(), 2),
                 number(row.time_s, 4)});
    }
  }
  return subsection("Beside the paper's Table 2") + table.html() +
         paragraph(
             "RMSE is the mean over the joints in N m; the paper gives no unit, no robot and no test data, defines "
             "neither its smoothness nor what its time is of. BLS-PSO is the paper's, on q, dq, ddq. Eq. 8 has viscous "
             "and "
             "Coulomb friction in its structure, as the MLP and RLS have here; the other row learns what the rigid "
             "body "
             "alone leaves. Only the order of the methods can be compared.");
}

}  // namespace

std::string comparison_section(const ReportInput& input, const json& comparison) {
  const json& methods = comparison.at("methods");
  std::string out = section("Methods compared");
  out += paragraph("Every method had the same train and validate logs; errors on the test logs, against the " +
                   comparison.at("against").get<std::string>() + ".");
  std::vector<Cell> head{{"method"}, {"mean of rated", "n"}};
  for (std::size_t j = 0; j < methods.at(0).at("rmse").size(); ++j)
    head.push_back({fmt::format("joint {}", j + 1), "n"});
  for (const char* name : {"smoothness", "multiplications a tick", "training [s]", "us a prediction", "fixed - double"})
    head.push_back({name, "n"});
  Table table(head);
  for (const json& method : methods) {
    std::vector<Cell> row{{method.at("name").get<std::string>()},
                          {fmt::format("{:.3f} %", method.at("mean_percent_rated").get<double>()), "n"}};
    for (const json& share : method.at("percent_rated"))
      row.push_back({fmt::format("{:.3g} %", share.get<double>()), "n"});
    row.push_back(number(method.at("smoothness"), 3));
    row.push_back({fmt::format("{:.0f}", method.at("macs_per_tick").get<double>()), "n"});
    const json& train_s = method.at("train_s");
    row.push_back(train_s.is_null() ? Cell{"-", "n"} : number(train_s, 3));
    row.push_back(number(method.at("predict_us"), 2));
    const json& fixed = method.at("fixed_error");
    row.push_back(fixed.is_null() ? Cell{"-", "n"} : Cell{fmt::format("{:.1e}", fixed.get<double>()), "n"});
    table.add(row);
  }
  out += table.html();
  out += paragraph(
      "RMSE of each joint as a share of its rated torque. Smoothness: how much the torque changes from sample to "
      "sample "
      "(RMS) beside the reference; 1 is as smooth. Fixed - double: the largest difference, of rated torque.");
  std::vector<Cell> joints_head{{"RMSE, peak [N*m | N]"}};
  for (std::size_t j = 0; j < methods.at(0).at("rmse").size(); ++j)
    joints_head.push_back({fmt::format("joint {}", j + 1), "n"});
  Table absolute(joints_head);
  for (const json& method : methods) {
    std::vector<Cell> row{{method.at("name").get<std::string>()}};
    for (std::size_t j = 0; j < method.at("rmse").size(); ++j)
      row.push_back(
          {fmt::format("{:.3g}, {:.3g}", method["rmse"][j].get<double>(), method["peak"][j].get<double>()), "n"});
    absolute.add(row);
  }
  out += absolute.html();
  if (comparison.value("paper", false)) out += paper_table(methods);
  for (const ComparisonPlot& plot : comparison_plots) {
    const std::filesystem::path file = input.directory / "plots" / plot.file;
    if (std::filesystem::exists(file)) out += subsection(plot.title) + read_file(file);
  }
  return out;
}

}  // namespace fxdyn

#include "host_tools/report/comparison_section.hpp"

#include <fmt/format.h>
#include <map>

#include <nlohmann/json.hpp>
#include <numeric>

#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
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
                                 {"bls_pso", "BLS-PSO", 0.10893, 0.55865, 0.0003557}};

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
             "neither its smoothness nor what its time is of. BLS-PSO is the paper's, on q, dq, ddq, and learns what "
             "the rigid "
             "body leaves, while the MLP and RLS have Coulomb and viscous friction as well. Only the order of the "
             "methods "
             "can be compared.");
}

}  // namespace

std::string comparison_section(const json& comparison, const std::filesystem::path& directory) {
  if (comparison.is_null()) return {};
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
    const std::filesystem::path file = directory / "plots" / plot.file;
    if (std::filesystem::exists(file)) out += subsection(plot.title) + read_file(file);
  }
  return out;
}

std::string vibration_section(const json& vibration) {
  if (vibration.is_null()) return {};
  const json& control = vibration.at("control");
  std::string out = section("Vibration");
  out += paragraph(fmt::format(
      "The scenario's robot in closed loop, gears that bend and friction on its motors, in a simulator that shares no "
      "code "
      "with the model. PD of {:.3g} Hz and damping {:.2g}, the best of a grid without feedforward; tick {:.3g} ms.",
      control.at("bandwidth_hz").get<double>(), control.at("damping").get<double>(),
      1e3 * control.at("tick_s").get<double>()));
  for (const char* kind : {"all", "point_to_point", "reversals", "slow"}) {
    Table table({{"feedforward"},
                 {"computed in"},
                 {"parameters off"},
                 {"reference of"},
                 {"motor [mrad]", "n"},
                 {"link [mrad]", "n"},
                 {"residual [mrad]", "n"},
                 {"settling [ms]", "n"},
                 {"roughness of rated", "n"}});
    for (const json& method : vibration.at("methods")) {
      const json& move = method.at("moves").at(kind);
      table.add({{method.at("feedforward").get<std::string>()},
                 {method.at("numbers").get<std::string>()},
                 {method.at("parameters_off").get<std::string>()},
                 {method.value("reference", "link")},
                 number(move.at("tracking_motor"), 3),
                 number(move.at("tracking_link"), 3),
                 number(move.at("residual"), 3),
                 {fmt::format("{:.0f}", 1e3 * move.at("settling_s").get<double>()), "n"},
                 number(move.at("roughness"), 2)});
    }
    out += subsection(std::string("Moves: ") + kind) + table.html();
  }
  Table ratios({{"feedforward"},
                {"computed in"},
                {"parameters off"},
                {"motor / PD alone", "n"},
                {"link / PD alone", "n"},
                {"residual / PD alone", "n"},
                {"motor / rigid", "n"},
                {"link / rigid", "n"}});
  for (const json& method : vibration.at("methods")) {
    const auto ratio = [&](const char* base, const char* key) {
      const json::json_pointer at(fmt::format("/ratios/{}/{}", base, key));
      return method.contains(at) ? number(method.at(at), 3) : Cell{"-", "n"};
    };
    ratios.add({{method.at("feedforward").get<std::string>()},
                {method.at("numbers").get<std::string>()},
                {method.at("parameters_off").get<std::string>()},
                ratio("none", "tracking_motor"),
                ratio("none", "tracking_link"),
                ratio("none", "residual"),
                ratio("rigid", "tracking_motor"),
                ratio("rigid", "tracking_link")});
  }
  out += subsection("All moves, against the PD alone and the rigid body") + ratios.html();
  return out + paragraph(
                   "Motor, link: RMS of the position error while it moves, the motor's against what it was asked for, "
                   "the link's against the links' reference. With the motors' reference they are asked to be ahead by "
                   "what the model says that the gears bend. Residual: how far a link is from where it "
                   "comes to rest, "
                   "at most, after the stop, mean over the joints. Settling: until every link stays within a quarter "
                   "of what it is "
                   "off at most with the PD alone. "
                   "Roughness: RMS of the torque's change from tick to tick.");
}

std::string efficiency_section(const json& efficiency) {
  if (efficiency.is_null()) return {};
  std::string out = section("Error against seconds of data");
  const auto draw_curves = [&](const char* key, const char* x_of, const std::string& x_label) {
    std::map<std::string, std::pair<std::vector<double>, std::vector<double>>> curves;
    for (const json& point : efficiency.at(key)) {
      for (const auto& [name, error] : point.at("percent_rated").items()) {
        if (error.is_null()) continue;
        std::string title = name;
        if (std::string(key) == "mix") title += fmt::format(", {:g} s", point.at("seconds").get<double>());
        curves[title].first.push_back(point.at(x_of).get<double>());
        curves[title].second.push_back(error.get<double>());
      }
    }
    static constexpr const char* colours[] = {"#2e6fb7", "#e4572e", "#2a9d4a", "#8e5ea2", "#b8860b", "#444444"};
    Chart chart{x_label, "test error, % of rated", {}, true};
    for (const auto& [title, points] : curves) {
      const auto vector = [](const std::vector<double>& v) {
        return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size())));
      };
      chart.curves.push_back(
          {vector(points.first), vector(points.second), colours[chart.curves.size() % 6], 1.6, title});
    }
    return draw({chart}, 1);
  };
  out += paragraph("Half of the seconds fast motion, half slow.");
  out += draw_curves("curve", "seconds", "seconds of train data");
  out += subsection("Which mix of fast and slow motion");
  out += draw_curves("mix", "slow_share", "share of slow motion");
  return out;
}

}  // namespace fxdyn

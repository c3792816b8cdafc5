#include "host_tools/report/comparison_result.hpp"

#include <fmt/format.h>

#include <cmath>

#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

MethodResult method_of(const json& file) {
  MethodResult out;
  out.name = file.at("name");
  out.rmse = file.at("rmse").get<std::vector<double>>();
  out.percent_rated = file.at("percent_rated").get<std::vector<double>>();
  out.peak = file.at("peak").get<std::vector<double>>();
  out.mean_percent_rated = file.at("mean_percent_rated");
  out.smoothness = file.at("smoothness");
  out.macs_per_tick = file.at("macs_per_tick");
  out.train_s = optional_of(file.at("train_s"));
  out.predict_us = file.at("predict_us");
  out.fixed_error = optional_of(file.at("fixed_error"));
  return out;
}

}  // namespace

json to_json(const ComparisonResult& result) {
  json methods = json::array();
  for (const MethodResult& method : result.methods) {
    methods.push_back({{"name", method.name},
                       {"rmse", method.rmse},
                       {"percent_rated", method.percent_rated},
                       {"mean_percent_rated", method.mean_percent_rated},
                       {"peak", method.peak},
                       {"smoothness", method.smoothness},
                       {"macs_per_tick", method.macs_per_tick},
                       {"train_s", or_null(method.train_s)},
                       {"predict_us", method.predict_us},
                       {"fixed_error", or_null(method.fixed_error)}});
  }
  return {{"schema", "fxdyn.compare/1"},
          {"against", result.against_truth ? "truth" : "measurement"},
          {"project_hash", result.project_hash},
          {"made_from", result.made_from},
          {"paper", result.paper},
          {"methods", methods}};
}

ComparisonResult comparison_of(const json& file) {
  ComparisonResult out;
  out.against_truth = file.at("against") == "truth";
  out.project_hash = file.value("project_hash", "");
  out.made_from = file.value("made_from", json());
  out.paper = file.value("paper", false);
  for (const json& method : file.at("methods")) out.methods.push_back(method_of(method));
  return out;
}

std::string compare_table(const ComparisonResult& result) {
  std::string out = fmt::format("errors against the {}, test logs, % of rated torque per joint\n",
                                result.against_truth ? "truth" : "measurement");
  out += fmt::format("{:<17} {:>7}  {:<48} {:>6} {:>7} {:>8} {:>8} {:>9}\n", "method", "mean %", "joints %", "smooth",
                     "MAC", "train s", "us", "fixed");
  for (const MethodResult& method : result.methods) {
    std::string joints;
    for (const double share : method.percent_rated) joints += fmt::format("{:.3g} ", share);
    out += fmt::format("{:<17} {:>7.3f}  {:<48} {:>6.3f} {:>7.0f} {:>8.2f} {:>8.2f} {:>9}\n", method.name,
                       method.mean_percent_rated, joints, method.smoothness, method.macs_per_tick,
                       method.train_s.value_or(NAN), method.predict_us,
                       method.fixed_error ? fmt::format("{:.2g}", *method.fixed_error) : "-");
  }
  out += fmt::format("\n{:<17} RMSE, peak of every joint [N*m | N]\n", "method");
  for (const MethodResult& method : result.methods) {
    out += fmt::format("{:<17}", method.name);
    for (std::size_t j = 0; j < method.rmse.size(); ++j)
      out += fmt::format(" {:.3g}, {:.3g}{}", method.rmse[j], method.peak[j], j + 1 < method.rmse.size() ? ";" : "\n");
  }
  return out;
}

}  // namespace fxdyn

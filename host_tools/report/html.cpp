#include <fmt/format.h>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/page/plot.hpp"
#include "host_tools/report/comparison_section.hpp"
#include "host_tools/report/diagnosis_section.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/report/results.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using namespace page;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* style = R"(
body { font: 15px/1.45 system-ui, sans-serif; color: #222; margin: 0 auto; max-width: 1080px; padding: 1.5em; }
h1 { font-size: 1.7em; margin: 0; } h2 { font-size: 1.25em; margin: 2em 0 .4em; border-bottom: 2px solid #e4572e; }
h3 { font-size: 1em; margin: 1.6em 0 .2em; } p { margin: .4em 0; max-width: 52em; } .quiet { color: #666; }
table { border-collapse: collapse; margin: .6em 0; font-size: .92em; }
th, td { padding: .22em .7em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { background: #f4f4f4; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.bad { background: #fde5e0; } td.good { background: #e6f4e6; } .split { columns: 2; column-gap: 3em; }
.split tr { break-inside: avoid; } svg { width: 100%; height: auto; } .scroll { overflow-x: auto; }
)";

/// Standard deviation over value: small ones with two digits, large ones without decimals or exponents.
std::string uncertainty(double share) {
  return share > 10    ? "> 1000 %"
         : share < 0.1 ? fmt::format("{:.2g} %", 100 * share)
                       : fmt::format("{:.0f} %", 100 * share);
}

std::string text(const json& value) { return value.get<std::string>(); }

std::string header(const json& model, const json& metrics) {
  const json& robot = model.at("robot");
  std::string out = fmt::format("<h1>{}</h1>\n", escape(text(robot.at("name"))));
  const auto gravity = robot.at("gravity").get<std::vector<double>>();
  out += fmt::format(
      "<p class=\"quiet\">project {}, {} moving joints, gravity [{:.4g} {:.4g} {:.4g}] m/s², tick {:.4g} ms, fxdyn "
      "{}</p>\n",
      escape(text(model.at("project"))), robot.at("joints").size(), gravity[0], gravity[1], gravity[2],
      1000 * model.at("tick_s").get<double>(), escape(text(model.at("tool_version"))));
  out += paragraph(fmt::format(
      "{} base parameters. Torque is on the joint side of the gearbox, positive along the axis of the joint.",
      metrics.at("base_parameters").get<int>()));
  return out;
}

std::string data_section(const json& model, const json& metrics, const std::string& role) {
  Table logs({{"log"}, {"from [s]", "n"}, {"to [s]", "n"}, {"role"}, {"what it decided"}});
  for (const json& log : metrics.at("logs")) {
    const std::string of = text(log.at("role"));
    logs.add({{text(log.at("file"))},
              number(log.at("from_s"), 6),
              number(log.at("to_s"), 6),
              {of},
              {of == "train"      ? "the parameters"
               : of == "validate" ? "which effects and nodes are kept"
                                  : "nothing: only judged"}});
  }
  std::string out = section("Data") + logs.html();
  out += paragraph(
      "Choices were gated on: " + text(metrics.at("gate")) + ". The errors below are on the " + role + " logs" +
      (role == "test" ? ", which decided nothing." : ", since there is no test log: they are optimistic."));
  for (const json& note : metrics.value("notes", json::array())) out += paragraph("Note: " + text(note) + ".");
  const json& filter = model.at("filter");
  out += paragraph(
      fmt::format("Filters (zero phase, Butterworth of order 4, forward and backward): motion {:.4g} Hz; torque and "
                  "every model column alike {:.4g} Hz; {:.3g} s dropped at both ends of each log.",
                  filter.at("position_cutoff_hz").get<double>(), filter.at("torque_cutoff_hz").get<double>(),
                  filter.at("edge_s").get<double>()));
  return out;
}

std::string error_section(const json& model, const Results& results) {
  const json& stages = results.metrics.at("stages");
  std::vector<Cell> head{{"joint"},         {"unit"},
                         {"rated", "n"},    {"model"},
                         {"RMSE", "n"},     {"of RMS torque", "n"},
                         {"of rated", "n"}, {"noise floor", "n"}};
  Table table(head);
  const json& joints = model.at("joints");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double rated = joints.at(j).at("rated_torque");
    for (const json& stage : stages) {
      const bool first = &stage == &stages.front(), last = &stage == &stages.back();
      const PooledError error = pooled_error(stage.at("logs"), results.role, j);
      table.add({{first ? text(joints.at(j).at("joint")) : ""},
                 {first ? text(joints.at(j).at("unit")) : ""},
                 first ? number(rated) : Cell{},
                 {stage_title(stage)},
                 {fmt::format("{:.4g}", error.rmse), last ? "n good" : "n"},
                 percent(error.relative()),
                 percent(error.rmse / rated),
                 last ? number(error.noise_floor, 3) : Cell{}});
    }
  }
  std::string out = section(fmt::format("Error on the {} logs", results.role)) + table.html();
  out += paragraph(
      "RMSE between measured and predicted torque, both filtered alike, over all logs of the role. The noise floor is "
      "an estimate of what white noise of the torque signal leaves after the filter: an error close to it leaves "
      "little to learn.");
  Table per_log(
      {{"log"}, {"joint"}, {"unit"}, {"RMSE", "n"}, {"of RMS torque", "n"}, {"unfiltered RMSE", "n"}, {"bias", "n"}});
  for (const json& log : results.metrics.at("logs")) {
    if (log.at("role") != results.role) continue;
    for (const json& joint : log.at("joints")) {
      per_log.add({{text(log.at("file"))},
                   {text(joint.at("joint"))},
                   {text(joint.at("unit"))},
                   number(joint.at("rmse")),
                   percent(joint.at("relative")),
                   number(joint.at("rmse_raw")),
                   number(joint.at("bias"), 2)});
    }
  }
  return out + "<h3>The final model, log by log</h3>\n" + per_log.html();
}

std::string base_section(const json& model) {
  constexpr const char* units[] = {"kg", "kg*m", "kg*m^2"};
  Table table({{"parameter"}, {"value", "n"}, {"std", "n"}, {"std / |value|", "n"}, {"unit"}});
  for (const json& p : model.at("base_parameters")) {
    const int kind = p.at("column").get<int>() % 10;
    const double relative = p.at("relative_std");
    table.add({{text(p.at("name"))},
               number(p.at("value")),
               number(p.at("std"), 2),
               {uncertainty(relative), relative > 0.3 ? "n bad" : "n"},
               {units[kind == 0  ? 0
                      : kind < 4 ? 1
                                 : 2]}});
  }
  return section("Base parameters") +
         paragraph(
             "m: mass, hx hy hz: first moment, Jxx .. Jyz: inertia about the frame's origin, of the link with that "
             "number, in "
             "modified Denavit-Hartenberg frames. Each stands for its group: what can't be told apart from it is added "
             "to it. "
             "Red: the standard deviation is above 30 % of the value, the data hardly determine it.") +
         "<div class=\"split\">" + table.bare_html() + "</div>\n";
}

std::string effects_section(const json& model) {
  Table table({{"joint"}, {"effect"}, {"side of the gearbox"}, {"torque"}, {"parameters"}});
  for (const json& joint : model.at("joints")) {
    for (const json& effect : joint.at("effects")) {
      std::string parameters;
      for (const json& p : effect.at("parameters")) {
        parameters += fmt::format(
            "{}{} = {:.4g}{} {}", parameters.empty() ? "" : ", ", text(p.at("name")), p.at("value").get<double>(),
            p.contains("std") ? fmt::format(" ± {:.2g}", p.at("std").get<double>()) : "", text(p.at("unit")));
      }
      const bool first = &effect == &joint.at("effects").front();
      table.add({{first ? text(joint.at("joint")) : ""},
                 {text(effect.at("effect")) + (effect.at("origin") == "named" ? " (found)" : "")},
                 {text(effect.at("side"))},
                 {text(effect.at("equation"))},
                 {parameters}});
    }
  }
  std::string out = section("Effects") + table.html();
  out += paragraph(
      "± is one standard deviation; parameters without it were searched, not estimated. Next to a kept BLS the "
      "coefficients of friction are no longer physical values of their own: both share the same torque.");
  return out;
}

/// What the search of each joint's BLS settled on, kept or not.
std::string choice_table(const json& training) {
  Table table({{"joint"},
               {"by"},
               {"nodes", "n"},
               {"windows", "n"},
               {"activation"},
               {"inputs"},
               {"ridge", "n"},
               {"scale", "n"},
               {"distances"},
               {"reference velocity", "n"},
               {"J of rated", "n"},
               {"generations", "n"},
               {"evaluations", "n"}});
  bool any = false;
  for (const json& joint : training) {
    const json choice = joint.value("choice", json());
    if (choice.is_null()) continue;
    any = true;
    const std::string length = text(joint.at("unit")) == "N" ? "m" : "rad";
    std::string distances = "none";
    if (choice.contains("distances")) {
      const auto d = choice.at("distances").get<std::vector<double>>();
      distances = fmt::format("{:.2g}, {:.2g}, {:.2g} {}", d[0], d[1], d[2], length);
    }
    table.add({{text(joint.at("joint"))},
               {text(choice.at("by"))},
               {fmt::format("{}", choice.at("nodes").get<int>()), "n"},
               {fmt::format("{}", choice.at("windows").get<int>()), "n"},
               {text(choice.at("activation"))},
               {text(choice.at("inputs"))},
               number(choice.at("ridge"), 2),
               number(choice.at("scale"), 2),
               {distances},
               {fmt::format("{:.2g} {}/s", choice.at("reference_velocity").get<double>(), length), "n"},
               {fmt::format("{:.4g} %", 100 * choice.at("J").get<double>()), "n"},
               choice.contains("generations") ? Cell{fmt::format("{}", choice.at("generations").get<int>()), "n"}
                                              : Cell{"-", "n"},
               {fmt::format("{}", joint.at("evaluations").get<int>()), "n"}});
  }
  if (!any) return {};
  return subsection("What the search settled on") + table.html() +
         paragraph(
             "By the particle swarm (pso) or the grid, whether it was kept or not. Distances are how far the joint "
             "moves "
             "until the presliding states follow. J: held-out RMSE, rounding of fixed point and a price for "
             "multiplications.");
}

std::string bls_section(const json& metrics) {
  std::string out = section("Broad Learning System");
  if (!metrics.contains("training")) return out + paragraph("Not trained.");
  const json& training = metrics.at("training");
  if (training.empty()) return out + paragraph("Switched off in the project file.");
  Table table({{"joint"}, {"unit"}, {"held out without", "n"}, {"held out with", "n"}, {"change", "n"}, {"decision"}});
  for (const json& joint : training) {
    const double without = joint.at("held_out_without"), with = joint.at("held_out_with");
    const bool kept = joint.at("kept"), found = !joint.contains("choice") || !joint.at("choice").is_null();
    table.add({{text(joint.at("joint"))},
               {text(joint.at("unit"))},
               number(without),
               found ? number(with) : Cell{"-", "n"},
               found ? Cell{fmt::format("{:+.1f} %", 100 * (with / without - 1)), "n"} : Cell{"-", "n"},
               {kept    ? "kept"
                : found ? "not kept"
                        : "none that fixed point could hold",
                kept ? "good" : ""}});
  }
  return out + table.html() +
         paragraph(
             "Held-out RMSE on the gate data (see Data), not on the test logs. It is kept where that falls by at least "
             "5 % (20 % where blocks of one log judge). Physical inputs are velocity and three presliding states; "
             "extended ones add load, angle and acceleration; the state has no memory.") +
         choice_table(training);
}

std::string limits_section(const json& model) {
  Table table({{"joint"}, {"position"}, {"velocity", "n"}, {"acceleration", "n"}, {"torque", "n"}});
  for (const json& joint : model.at("joints")) {
    const std::string unit = text(joint.at("unit")), length = unit == "N" ? "m" : "rad";
    const json& limits = joint.at("limits");
    const auto with_unit = [&](const char* key, const std::string& of) {
      return Cell{fmt::format("{:.4g} {}", limits.at(key).get<double>(), of), "n"};
    };
    table.add({{text(joint.at("joint"))},
               {fmt::format("{:.4g} .. {:.4g} {}", limits.at("position").at(0).get<double>(),
                            limits.at("position").at(1).get<double>(), length)},
               with_unit("velocity", length + "/s"),
               with_unit("acceleration", length + "/s^2"),
               with_unit("torque", unit)});
  }
  return "<h3>Limits</h3>\n" + table.html() +
         paragraph(
             "Inputs are clamped to them. From the project file; else from the URDF where the logs come near them; "
             "else 1.2 "
             "times the largest in the train and validate logs.");
}

std::string fixed_point_section(const json& model, const json& exported) {
  std::string out = section("Fixed point");
  if (exported.is_null()) return out + paragraph("Not exported from this model: run fxdyn export.");
  Table errors({{"joint"},
                {"unit"},
                {"observed |fixed - double|", "n"},
                {"of rated", "n"},
                {"RMS", "n"},
                {"proven at most", "n"},
                {"of rated", "n"},
                {"torque attained", "n"},
                {"proven at most", "n"}});
  for (const json& joint : exported.at("joints")) {
    errors.add({{text(joint.at("joint"))},
                {text(joint.at("unit"))},
                number(joint.at("observed_max"), 3),
                {fmt::format("{:.2g}", joint.at("observed_max_of_rated").get<double>()), "n"},
                number(joint.at("quantisation_rms"), 3),
                number(joint.at("proven_bound"), 3),
                {fmt::format("{:.2g}", joint.at("proven_bound_of_rated").get<double>()), "n"},
                number(joint.at("torque_range").at("attained"), 4),
                number(joint.at("torque_range").at("proven"), 4)});
  }
  out += errors.html();
  out += paragraph(
      "Observed on the train and validate logs, on disturbed copies of them with states far beyond the limits, on "
      "random "
      "states within them and while creeping. Proven for every motion within the limits. The last two columns: the "
      "largest torque of the model that a search within the limits finds, and what it can't exceed.");
  out += paragraph(fmt::format("Tables: {} bytes. Saturated numbers on the undisturbed logs: {}.",
                               exported.at("table_bytes").get<std::int64_t>(),
                               exported.at("saturations_on_logs").get<std::int64_t>()));
  Table formats({{"quantity"}, {"fractional bits", "n"}, {"bits", "n"}, {"step", "n"}, {"range", "n"}});
  for (const auto& [name, value] : exported.at("formats").items()) {
    const int bits = value, width = name.ends_with("_sum") ? 64 : 32;
    formats.add({{name},
                 {fmt::format("{}", bits), "n"},
                 {fmt::format("{}", width), "n"},
                 number(std::ldexp(1.0, -bits), 3),
                 {fmt::format("±{:.4g}", std::ldexp(1.0, width - 1 - bits)), "n"}});
  }
  return out + limits_section(model) + "<h3>Formats</h3>\n" + formats.html();
}

std::string replay_section(const json& replayed) {
  std::string out = section("Replay on the firmware");
  if (replayed.is_null())
    return out + paragraph(
                     "Not replayed with these tables: build the image with toolchains/build_image.sh, then run fxdyn "
                     "replay.");
  const ReplaySummary sum = summarise_replay(replayed);
  out += paragraph(fmt::format("{} ticks on {} in QEMU (image {}): {}. {} to {} instructions a tick.", sum.ticks,
                               sum.processor, text(replayed.at("image")),
                               sum.different_ticks == 0
                                   ? "every torque is the host's bit for bit"
                                   : fmt::format("{} ticks differ from the host", sum.different_ticks),
                               sum.fewest, sum.most));
  if (replayed.contains("size")) {
    out += paragraph(fmt::format("Image: {} bytes flash, {} bytes RAM (stack included).",
                                 replayed.at("size").at("flash_bytes").get<int>(),
                                 replayed.at("size").at("ram_bytes").get<int>()));
  }
  Table table({{"stream"},
               {"ticks", "n"},
               {"different", "n"},
               {"saturations", "n"},
               {"instructions a tick", "n"},
               {"largest |firmware - double| of rated", "n"}});
  for (const json& log : replayed.at("logs")) {
    double largest = 0;
    for (const json& joint : log.at("joints"))
      largest = std::max(largest, joint.at("largest_error_of_rated").get<double>());
    const auto different = log.at("different_ticks").get<std::int64_t>();
    table.add({{text(log.at("log"))},
               {fmt::format("{}", log.at("ticks").get<std::int64_t>()), "n"},
               {fmt::format("{}", different), different == 0 ? "n good" : "n bad"},
               {fmt::format("{}", log.at("saturations").get<std::int64_t>()), "n"},
               {fmt::format("{:.0f}", log.at("instructions_per_tick").at("mean").get<double>()), "n"},
               {fmt::format("{:.2g}", largest), "n"}});
  }
  return out + table.html();
}

std::string plot_section(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
  std::vector<TorquePlot> plots;
  std::vector<std::string> titles;
  for (const ProcessedLog& log : logs) {
    const Eigen::MatrixXd predicted = log.filter_columns(predict(model, log));
    const Eigen::MatrixXd measured = log.filter_columns(log.tau);
    const Eigen::Index count = log.last - log.first;
    for (std::size_t j = 0; j < model.robot.size(); ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      const Joint& joint = model.robot.joints[j];
      TorquePlot plot{log.t.segment(log.first, count), measured.col(k).segment(log.first, count),
                      predicted.col(k).segment(log.first, count), joint.torque_unit()};
      const double rmse = (plot.measured - plot.predicted).norm() / std::sqrt(static_cast<double>(count));
      titles.push_back(fmt::format("{} in {}: RMSE {:.3g} {}", joint.name, log.name, rmse, joint.torque_unit()));
      plots.push_back(std::move(plot));
    }
  }
  const std::vector<std::string> pictures = draw(plots);
  std::string out = section("Torque, measured and predicted") +
                    paragraph("Both filtered at the torque cut-off; the residual beneath.");
  for (std::size_t i = 0; i < pictures.size(); ++i) out += "<h3>" + escape(titles[i]) + "</h3>\n" + pictures[i] + "\n";
  return out;
}

}  // namespace

void write_report(const IdentifiedModel& fitted, const std::vector<ProcessedLog>& logs, const fs::path& directory) {
  const Results results = read_results(directory);
  const json model = to_json(fitted);
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>{} - "
      "fxdyn</title>\n<style>{}</style></head><body>\n",
      escape(fitted.robot.name), style);
  page += header(model, results.metrics);
  page += data_section(model, results.metrics, results.role);
  page += error_section(model, results);
  if (!results.diagnosis.is_null()) page += diagnosis_section(results.diagnosis, directory);
  page += bls_section(results.metrics);
  page += comparison_section(results.compared, directory);
  page += efficiency_section(results.efficiency);
  page += vibration_section(results.vibration);
  for (const std::string& verb : results.stale) {
    page += paragraph(fmt::format(
        "{}.json is of another project file, other logs or another model and left out: run `fxdyn {}` again.", verb,
        verb));
  }
  page += effects_section(model);
  page += base_section(model);
  page += fixed_point_section(model, results.exported);
  page += replay_section(results.replayed);
  page += plot_section(fitted, logs);
  page += "</body></html>\n";
  write_file(directory / "report.html", page);
}

}  // namespace fxdyn

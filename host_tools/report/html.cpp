#include <fmt/format.h>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/report/results.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"
#include "model/version.hpp"

namespace fxdyn {
namespace {

using namespace page;
namespace fs = std::filesystem;

constexpr const char* style = R"(
body { font: 15px/1.45 system-ui, sans-serif; color: #222; margin: 0 auto; max-width: 1080px; padding: 1.5em; }
h1 { font-size: 1.7em; margin: 0; } h2 { font-size: 1.25em; margin: 2em 0 .4em; border-bottom: 2px solid #e4572e; }
h3 { font-size: 1em; margin: 1.6em 0 .2em; } p { margin: .4em 0; max-width: 52em; } .quiet { color: #666; }
table { border-collapse: collapse; margin: .6em 0; font-size: .92em; }
th, td { padding: .22em .7em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { background: #f4f4f4; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.bad { background: #fde5e0; } td.good { background: #e6f4e6; }
td.amber { background: #fdf0d0; } .split { columns: 2; column-gap: 3em; }
.split tr { break-inside: avoid; } svg { width: 100%; height: auto; } .scroll { overflow-x: auto; }
)";

std::string header(const IdentifiedModel& model, const MetricsResult& metrics) {
  const Robot& robot = robot_of(model);
  std::string out = fmt::format("<h1>{}</h1>\n", escape(robot.name));
  const Eigen::Vector3d& gravity = robot.gravity;
  out += fmt::format(
      "<p class=\"quiet\">project {}, {} moving joints, gravity [{:.4g} {:.4g} {:.4g}] m/s², tick {:.4g} ms, fxdyn "
      "{}</p>\n",
      escape(project_of(model)), robot.size(), gravity[0], gravity[1], gravity[2], 1000 * tick_of(model), version);
  out += paragraph(fmt::format(
      "{} base parameters. Torque is on the joint side of the gearbox, positive along the axis of the joint.",
      metrics.base_parameters));
  return out;
}

}  // namespace

void write_report(const IdentifiedModel& fitted, const std::vector<ProcessedLog>& logs, const fs::path& directory) {
  const Results results = read_results(directory);
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>{} - "
      "fxdyn</title>\n<style>{}</style></head><body>\n",
      escape(robot_of(fitted).name), style);
  const ReportInput input{fitted, logs, results, directory};
  page += header(fitted, metrics_of(results["metrics"]));
  page += draw_sections(input, report_sections());
  page += "</body></html>\n";
  write_file(directory / "report.html", page);
}

}  // namespace fxdyn

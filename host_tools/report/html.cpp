#include <fmt/format.h>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/report/results.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using namespace page;
using nlohmann::json;
namespace fs = std::filesystem;

std::string header(const json& model, const MetricsResult& metrics) {
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
      metrics.base_parameters));
  return out;
}

}  // namespace

void write_report(const IdentifiedModel& fitted, const std::vector<ProcessedLog>& logs, const fs::path& directory) {
  const Results results = read_results(directory);
  const ReportInput input{fitted, to_json(fitted), logs, results, directory};
  std::string body = header(input.model, metrics_of(results["metrics"]));
  body += draw_sections(input, report_sections());
  write_file(directory / "report.html", document(robot_of(fitted).name, body));
}

}  // namespace fxdyn

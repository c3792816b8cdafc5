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
  const ReportInput input{fitted, logs, results, directory};
  std::string body = header(fitted, metrics_of(results["metrics"]));
  body += draw_sections(input, report_sections());
  write_file(directory / "report.html", document(robot_of(fitted).name, body));
}

}  // namespace fxdyn

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
  const Eigen::Vector3d& gravity = robot.gravity;
  return fmt::format(
      "<header><h1>{}</h1>\n<p class=\"quiet\">project {}, {} moving joint{}, gravity [{:.4g} {:.4g} {:.4g}] m/s², "
      "tick "
      "{:.4g} ms, {} base parameters, fxdyn {}. Torque is on the joint side of the gearbox, positive along the axis of "
      "the joint.</p></header>\n",
      escape(robot.name), escape(project_of(model)), robot.size(), robot.size() == 1 ? "" : "s", gravity[0], gravity[1],
      gravity[2], 1000 * tick_of(model), metrics.base_parameters, version);
}

/// What stands between the first <h2 ..> and its end; "" where there is none.
std::string heading_of(const std::string& content) {
  const std::size_t open = content.find("<h2"), from = content.find('>', open);
  const std::size_t to = content.find("</h2>", open);
  return open == std::string::npos || to == std::string::npos ? "" : content.substr(from + 1, to - from - 1);
}

/// The sections, each with its name as anchor, and the contents: a link a section.
std::string contents_and_sections(const ReportInput& input) {
  std::string links, body;
  for (const ReportSection& section : report_sections()) {
    const std::string content = draw_sections(input, {&section, 1});
    if (content.empty()) continue;
    body += fmt::format("<section id=\"{}\">\n{}</section>\n", section.name, content);
    if (const std::string heading = heading_of(content); !heading.empty() && section.name != "overview")
      links += fmt::format("<li><a href=\"#{}\">{}</a></li>\n", section.name, heading);
  }
  return "<nav aria-label=\"Contents\"><ul>\n" + links + "</ul></nav>\n<main id=\"main\">\n" + body + "</main>\n";
}

}  // namespace

void write_report(const IdentifiedModel& fitted, const std::vector<ProcessedLog>& logs, const fs::path& directory,
                  const ReportSettings& settings) {
  const Results results = read_results(directory);
  const ReportInput input{fitted, logs, results, directory, settings};
  write_file(directory / "report.html", document(robot_of(fitted).name, header(fitted, metrics_of(results["metrics"])) +
                                                                            contents_and_sections(input)));
}

}  // namespace fxdyn

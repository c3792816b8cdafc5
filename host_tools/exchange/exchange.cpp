#include "host_tools/exchange/exchange.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/exchange/certificate.hpp"
#include "host_tools/exchange/load_friction.hpp"
#include "host_tools/exchange/posterior.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

std::vector<ProcessedLog> without_load(std::vector<ProcessedLog> logs) {
  std::erase_if(logs, [](const ProcessedLog& log) { return log.load.has_value(); });
  return logs;
}

/// Test logs, else those that validated; without a known load, which no file for simulators carries.
std::vector<ProcessedLog> held_out_logs(Pipeline& pipeline) {
  std::vector<ProcessedLog> logs = without_load(pipeline.logs(Role::test));
  if (logs.empty()) logs = without_load(pipeline.logs(Role::validate));
  if (logs.empty())
    throw DataError(
        "export --to: each held-out log has a load, and the file has none: give a log without it the role \"test\"");
  return logs;
}

/// What the project alone decides: asked before hours of work.
/// @throws InputError
void check_project(const Project& project, bool bodies) {
  if (bodies && !project.identify.physical) {
    throw InputError(fmt::format(
        "{}: a simulator takes possible bodies only: set `physical = true` in [identify], then export again",
        project.file.string()));
  }
  if (!project.has_role(Role::test) && !project.has_role(Role::validate)) {
    throw InputError(fmt::format("{}: no held-out log to judge the file by: give a log or a window the role \"test\"",
                                 project.file.string()));
  }
}

/// The links as possible bodies, of the stage that made the model.
Robot possible_bodies(const Pipeline& pipeline) {
  const fs::path file = pipeline.directory() / "identified.urdf";
  if (!fs::exists(file)) {
    throw InputError(fmt::format("{}: is not there: run `fxdyn run {} --out {}` first", file.string(),
                                 pipeline.project().file.string(), pipeline.directory().string()));
  }
  return read_urdf(file);
}

}  // namespace

std::string export_for_simulators(Pipeline& pipeline, const std::vector<std::string>& formats) {
  for (const std::string& name : formats) export_format(name);  // an unknown one: before hours of work
  const auto whole = [](const std::string& name) { return export_format(name).whole_model; };
  const bool bodies = !std::all_of(formats.begin(), formats.end(), whole);
  check_project(pipeline.project(), bodies);
  const bool tables = std::any_of(formats.begin(), formats.end(), whole);
  const IdentifiedModel model = tables ? pipeline.exported() : pipeline.model();
  const Robot links = bodies ? possible_bodies(pipeline) : model.robot;
  const std::vector<ProcessedLog> held_out = held_out_logs(pipeline), train = pipeline.logs(Role::train);
  std::string out;
  for (const std::string& name : formats) {
    const ExportFormat& format = export_format(name);
    SimpleRobot simple = format.whole_model
                             ? SimpleRobot{model.robot, std::vector<SimpleJoint>(model.robot.size()), {}}
                             : simple_robot(model, links, format.has_armature, train,
                                            {.dry_friction = format.has_dry_friction}, format.has_stribeck);
    if (format.has_load && !format.whole_model) fit_load_friction(simple, model, train);
    simple.urdf = pipeline.project().urdf;
    if (format.has_ranges) simple.ranges = joint_ranges(pipeline.project(), model, train);
    const fs::path file = pipeline.directory() / format.file;
    format.write(simple, file);
    const Certificate certificate = certify(format, file, simple, model, held_out);
    write_file(pipeline.directory() / fmt::format("certificate_{}.json", name), to_json(certificate).dump(1) + "\n");
    require_as_meant(certificate);
    out += certificate_table(certificate);
  }
  return out;
}

}  // namespace fxdyn

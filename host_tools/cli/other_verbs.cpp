// Verbs that need no project, or not always.

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/check/check.hpp"
#include "host_tools/check/init.hpp"
#include "host_tools/cli/verb.hpp"
#include "host_tools/excite/excite.hpp"
#include "host_tools/pipeline/forward_log.hpp"
#include "host_tools/pipeline/next_experiment.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/pipeline/refine_model.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/temporary_folder.hpp"

namespace fxdyn::cli {

Action add_excite(CLI::App& verb) {
  struct Options {
    std::string project, out, after;
    bool paper = false;
  };
  const auto options = std::make_shared<Options>();
  auto* project = verb.add_option("PROJECT", options->project, "project file (TOML); needs no log");
  verb.add_flag("--paper", options->paper,
                "no project: the trajectory of the paper's Table 1, as printed and corrected")
      ->excludes(project);
  verb.add_option("--after", options->after,
                  "results of `diagnose`: plan one or two motions that decide what it left open")
      ->needs(project);
  verb.add_option("--out", options->out, "directory for the results")->required();
  return [options] {
    if (!options->paper && options->project.empty())
      throw InputError("excite: name a PROJECT, or --paper; see fxdyn excite --help");
    Progress progress;
    if (options->paper) {
      fmt::print("{}", excite_paper(options->out));
    } else if (options->after.empty()) {
      fmt::print("{}", excite(read_project(options->project), options->out, progress));
    } else {
      fmt::print("{}", excite_after(read_project(options->project), options->after, options->out, progress));
    }
  };
}

Action add_check(CLI::App& verb) {
  struct Options {
    std::string project, out;
    bool as_json = false;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("PROJECT", options->project, "project file (TOML)")->required();
  verb.add_flag("--json", options->as_json, "what was seen as JSON");
  verb.add_option("--out", options->out, "directory for the logs of scenarios (default: none is kept)");
  return [options] {
    const TemporaryFolder temporary;
    const CheckResult result = check(read_project(options->project),
                                     options->out.empty() ? temporary.path() : std::filesystem::path(options->out));
    fmt::print("{}", options->as_json ? to_json(result).dump(2) + "\n" : check_table(result));
    std::fflush(stdout);
    if (result.has_error())
      throw DataError("these logs can't be what the project says: write the lines above, then check again");
    if (!options->as_json) {
      const std::filesystem::path project = options->project;
      fmt::print("next: fxdyn run {} --out out/{}\n", project.string(), project.stem().string());
    }
  };
}

Action add_init(CLI::App& verb) {
  struct Options {
    std::vector<std::string> logs;
    std::string urdf, columns;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("LOG", options->logs, "logs (CSV) of the robot, with or without a line of names")->required();
  verb.add_option("--urdf", options->urdf, "the robot's URDF")->required();
  verb.add_option(
      "--columns", options->columns,
      "where the names do not tell: '{ t = \"..\", q = [\"..\", ..], tau = [\"..\", ..] }', names or numbers");
  return [options] {
    fmt::print("{}", init_project({options->logs.begin(), options->logs.end()}, options->urdf,
                                  std::filesystem::current_path(), options->columns));
    fmt::print(stderr, "next, if this is written to robot.toml: fxdyn check robot.toml\n");
  };
}

Action add_simulate(CLI::App& verb) {
  struct Options {
    std::string scenario, out;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("SCENARIO", options->scenario, "scenario file (TOML)")->required();
  verb.add_option("--out", options->out, "directory for the logs")->required();
  return [options] {
    for (const auto& file : simulate(options->scenario, options->out)) fmt::print("{}\n", file.string());
  };
}

Action add_predict(CLI::App& verb) {
  struct Options {
    std::string model, log, numbers = "real", out;
    bool raw = false, trajectory = false;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("--model", options->model, "model.json")->required();
  verb.add_option("--log", options->log, "log (CSV); without torque there are no metrics")->required();
  verb.add_option("--numbers", options->numbers, "real (double) or fixed (as the firmware computes)")
      ->check(CLI::IsMember({"real", "fixed"}))
      ->capture_default_str();
  verb.add_flag("--raw", options->raw, "torque as computed, with the noise of q; default: below the torque's cut-off");
  verb.add_flag("--trajectory", options->trajectory,
                "also the motion with its feedforward, as a JointTrajectory of ROS 2 (YAML)");
  verb.add_option("--out", options->out, "directory for the prediction")->required();
  return [options] {
    fmt::print("{}", predict_log(
                         options->model, options->log,
                         {.fixed = options->numbers == "fixed", .raw = options->raw, .trajectory = options->trajectory},
                         options->out));
    fmt::print("prediction in {}\n", options->out);
  };
}

Action add_forward(CLI::App& verb) {
  struct Options {
    std::string model, log, out;
    int given = 20;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("--model", options->model, "model.json")->required();
  verb.add_option("--log", options->log, "log (CSV) with torque")->required();
  verb.add_option("--given", options->given, "first samples of the log that are known: where the motion starts")
      ->capture_default_str();
  verb.add_option("--out", options->out, "directory for the simulated motion")->required();
  return [options] { fmt::print("{}", forward_log(options->model, options->log, options->given, options->out)); };
}

Action add_refine(CLI::App& verb) {
  struct Options {
    std::string model;
    int given = 20;
  };
  const auto project = add_project(verb);
  const auto options = std::make_shared<Options>();
  verb.add_option("--model", options->model, "the model to start from (default: model.json in --out)");
  verb.add_option("--given", options->given, "first samples of a log that are known: where the motion starts")
      ->capture_default_str();
  return [project, options] {
    const std::filesystem::path out = project->out;
    const std::filesystem::path model =
        options->model.empty() ? out / "model.json" : std::filesystem::path(options->model);
    fmt::print("{}", refine_model(project->project, model, options->given, out));
  };
}

namespace {

/// "X,Y,Z"
Eigen::Vector3d point_of(const std::string& text) {
  Eigen::Vector3d out;
  std::size_t at = 0;
  for (int k = 0; k < 3; ++k) {
    const std::size_t end = k < 2 ? text.find(',', at) : text.size();
    const char *from = text.data() + at, *to = text.data() + (end == std::string::npos ? at : end);
    const auto [read, error] = std::from_chars(from, to, out[k]);
    if (error != std::errc() || read != to || !std::isfinite(out[k]))
      throw InputError(fmt::format("payload: --com {}: expected three lengths in metres, as in 0,0.02,0.1", text));
    at = end + 1;
  }
  return out;
}

}  // namespace

Action add_payload(CLI::App& verb) {
  struct Options {
    std::string model, log, out, com, unloaded;
    double mass = 0;
  };
  const auto options = std::make_shared<Options>();
  verb.add_option("--model", options->model, "model.json, identified without load")->required();
  verb.add_option("--log", options->log, "log (CSV) recorded with the load")->required();
  const auto* mass = verb.add_option("--mass", options->mass, "the load is known [kg]: find the gains of the torques");
  const auto* com = verb.add_option("--com", options->com, "its centre X,Y,Z in the last link's URDF frame [m]");
  const auto* unloaded = verb.add_option("--unloaded", options->unloaded, "log (CSV) of the same motion without load");
  verb.add_option("--out", options->out, "directory for the results")->required();
  return [options, mass, com, unloaded] {
    if (mass->count() == 0 && com->count() + unloaded->count() > 0)
      throw InputError("payload: --com and --unloaded belong to a known load: give its --mass too");
    if (mass->count() == 0) {
      fmt::print("{}", identify_payload(options->model, options->log, options->out));
      fmt::print("load in {0}/payload.json, model with it in {0}/model.json\n", options->out);
      return;
    }
    if (!(options->mass > 0)) throw InputError("payload: --mass has to be above 0 kg");
    if (com->count() == 0) throw InputError("payload: --mass needs --com X,Y,Z: where the load's centre is");
    if (unloaded->count() == 0)
      throw InputError("payload: --mass needs --unloaded: the log of the same motion without the load");
    fmt::print("{}", identify_torque_gains(options->model, options->unloaded, options->log,
                                           {options->mass, point_of(options->com)}, options->out));
    fmt::print("gains in {0}/payload.json, the line in {0}/torque_gain.toml; then identify again\n", options->out);
  };
}

}  // namespace fxdyn::cli

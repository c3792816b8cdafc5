#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "host_tools/compare/compare.hpp"
#include "host_tools/compare/efficiency.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/excite/excite.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/replay/replay.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/update/update.hpp"
#include "host_tools/vibration/vibration.hpp"
#include "model/version.hpp"

namespace {

using namespace fxdyn;

std::string_view name_of(ActsOn acts_on) {
  switch (acts_on) {
    case ActsOn::torque:
      return "torque";
    case ActsOn::position:
      return "position";
    case ActsOn::body:
      return "body";
  }
  return "";
}

void print_effects(bool as_json) {
  nlohmann::json list = nlohmann::json::array();
  for (const EffectInfo& effect : effect_infos()) {
    nlohmann::json parameters = nlohmann::json::array();
    const auto add = [&](const auto& infos, const char* kind) {
      for (const ParameterInfo& p : infos) {
        parameters.push_back({{"name", p.name},
                              {"kind", kind},
                              {"unit", p.unit},
                              {"unit_prismatic", p.unit_prismatic},
                              {"lower", p.lower},
                              {"upper", p.upper},
                              {"source", p.source}});
      }
    };
    add(effect.shape, "shape");
    add(effect.linear, "linear");
    list.push_back({{"effect", effect.name},
                    {"equation", effect.equation},
                    {"acts_on", name_of(effect.acts_on)},
                    {"side", "joint"},
                    {"parameters", parameters}});
  }
  if (as_json) {
    fmt::print("{}\n", list.dump(1));
    return;
  }
  for (const auto& effect : list) {
    fmt::print("{:<20} {}{}\n", effect["effect"].get<std::string>(), effect["acts_on"] == "torque" ? "tau = " : "",
               effect["equation"].get<std::string>());
    for (const auto& p : effect["parameters"]) {
      fmt::print("{:<20}   {} [{}] ({})\n", "", p["name"].get<std::string>(), p["unit"].get<std::string>(),
                 p["source"].get<std::string>());
    }
  }
}

int run(int argc, char** argv) {
  CLI::App app{
      "fxdyn: from a robot's measured log to torque feedforward on its drive controllers.\n"
      "Example: fxdyn run robot.toml --out out/robot"};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return fmt::format("fxdyn: {}: see fxdyn VERB --help\n", error.what());
  });

  std::string project, out, scenario, model, log, image, numbers = "real";
  bool as_json = false;
  Eigen::Index ticks = 5000;
  const auto stage = [&](const char* name, const char* what) {
    CLI::App* verb =
        app.add_subcommand(name, fmt::format("{}\nExample: fxdyn {} robot.toml --out out/robot{}", what, name,
                                             std::string_view(name) == "replay"   ? " --image drive.elf"
                                             : std::string_view(name) == "update" ? " --log new.csv"
                                                                                  : ""));
    verb->add_option("PROJECT", project, "project file (TOML)")->required();
    verb->add_option("--out", out, "directory for the results")->required();
    return verb;
  };
  const CLI::App* run_verb = stage("run", "diagnose, train, export and report in one go.");
  const CLI::App* identify_verb =
      stage("identify", "Structure and friction from the train logs: model.json, metrics.json.");
  const CLI::App* diagnose_verb =
      stage("diagnose", "Find and name what the nominal model lacks, add it: diagnosis.json, model.json.");
  const CLI::App* train_verb =
      stage("train", "Fit a Broad Learning System on what diagnosis left; keep it where validation improves.");
  const CLI::App* export_verb =
      stage("export", "Choose fixed-point formats, write tables.hpp, tables.bin, export.json.");
  const CLI::App* report_verb = stage("report", "Draw report.html from what the other stages wrote.");
  const CLI::App* compare_verb =
      stage("compare", "Every method on the same logs, from plain least squares to named effects: compare.json.");
  const CLI::App* efficiency_verb =
      stage("efficiency", "Test error against the seconds of train data, per method: efficiency.json.");
  const CLI::App* vibration_verb =
      stage("vibration", "The model as feedforward of the scenario's robot with gears that bend: vibration.json.");
  CLI::App* replay_verb = stage(
      "replay",
      "Stream the held-out logs to a firmware image in QEMU (--image) or to drive nodes on a CAN bus (--can) and\n"
      "compare bit for bit: replay.json, can_replay.json.");
  auto* image_option =
      replay_verb->add_option("--image", image, "firmware image (.elf) made by toolchains/build_image.sh");
  CanReplaySettings can_replay;
  auto* can_option =
      replay_verb->add_option("--can", can_replay.interface, "SocketCAN interface with the drives, e.g. can0")
          ->excludes(image_option);
  std::vector<unsigned> nodes;
  replay_verb->add_option("--nodes", nodes, "node ids (default: whoever answers of 1 .. joints)")
      ->delimiter(',')
      ->check(CLI::Range(1, 127))
      ->needs(can_option);
  replay_verb->add_flag("--fd", can_replay.fd, "CAN FD: all setpoints in one frame")->needs(can_option);
  replay_verb
      ->add_flag("--closed-loop", can_replay.closed_loop,
                 "no log: move the scenario's robot with the torque that comes over the bus")
      ->needs(can_option);
  replay_verb->add_option("--moves", can_replay.most_moves, "of the closed loop, the first ones alone (default: all)")
      ->needs(can_option);
  replay_verb->add_option("--ticks", ticks, "at most this many ticks of each log")->capture_default_str();

  UpdateSettings new_session;
  CLI::App* update_verb = stage(
      "update", "Refit the coefficients with a new log, keep them where they are better: tables.bin, update.json.");
  update_verb->add_option("--log", new_session.log, "log (CSV) of a new session")->required();
  update_verb->add_option("--forgetting", new_session.forgetting,
                          "what was known a second ago counts, 1: all (default: the project's identify.forgetting)");
  update_verb->add_flag("--rebuild", new_session.rebuild, "choose formats anew: the firmware needs a rebuild");

  CLI::App* excite_verb = app.add_subcommand(
      "excite",
      "Plan trajectories that show the robot's parameters, within its limits: CSV to play, excite.json, plots.\n"
      "Example: fxdyn excite robot.toml --out out/plan");
  bool paper = false;
  auto* excite_project = excite_verb->add_option("PROJECT", project, "project file (TOML); needs no log");
  excite_verb->add_flag("--paper", paper, "no project: the trajectory of the paper's Table 1, as printed and corrected")
      ->excludes(excite_project);
  excite_verb->add_option("--out", out, "directory for the results")->required();

  CLI::App* simulate_verb = app.add_subcommand(
      "simulate", "Make logs from a scenario.\nExample: fxdyn simulate scenario.toml --out out/logs");
  simulate_verb->add_option("SCENARIO", scenario, "scenario file (TOML)")->required();
  simulate_verb->add_option("--out", out, "directory for the logs")->required();
  CLI::App* predict_verb =
      app.add_subcommand("predict",
                         "Torque of a model over a log: CSV and metrics.json.\nExample: fxdyn predict --model "
                         "out/robot/model.json --log run.csv --out out/prediction");
  predict_verb->add_option("--model", model, "model.json")->required();
  predict_verb->add_option("--log", log, "log (CSV); without torque there are no metrics")->required();
  predict_verb->add_option("--numbers", numbers, "real (double) or fixed (as the firmware computes)")
      ->check(CLI::IsMember({"real", "fixed"}))
      ->capture_default_str();
  predict_verb->add_option("--out", out, "directory for the prediction")->required();
  CLI::App* payload_verb =
      app.add_subcommand("payload",
                         "Load on the last link from a log recorded with it: payload.json, and the model with it.\n"
                         "Example: fxdyn payload --model out/robot/model.json --log loaded.csv --out out/loaded");
  payload_verb->add_option("--model", model, "model.json, identified without load")->required();
  payload_verb->add_option("--log", log, "log (CSV) recorded with the load")->required();
  payload_verb->add_option("--out", out, "directory for the results")->required();
  CLI::App* effects_verb =
      app.add_subcommand("effects", "List the effects that the model knows.\nExample: fxdyn effects --json");
  effects_verb->add_flag("--json", as_json, "for machines");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // What is missing is missing because of the word that is misspelt.
    const auto unknown = app.remaining(true);
    if (error.get_exit_code() != 0 && !unknown.empty()) {
      const bool option = unknown.front().starts_with("-"), no_verb = app.get_subcommands().empty();
      fmt::print(stderr, "fxdyn: '{}' {}: see fxdyn {}--help\n", unknown.front(),
                 option ? "is no option here" : (no_verb ? "is no verb" : "was not expected"), no_verb ? "" : "VERB ");
      return 2;
    }
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (*effects_verb) {
    print_effects(as_json);
  } else if (*excite_verb) {
    if (!paper && project.empty()) throw InputError("excite: name a PROJECT, or --paper; see fxdyn excite --help");
    Progress progress;
    fmt::print("{}", paper ? excite_paper(out) : excite(read_project(project), out, progress));
  } else if (*simulate_verb) {
    for (const auto& file : simulate(scenario, out)) fmt::print("{}\n", file.string());
  } else if (*predict_verb) {
    predict_log(model, log, numbers == "fixed", out);
    fmt::print("prediction in {}\n", out);
  } else if (*payload_verb) {
    identify_payload(model, log, out);
    fmt::print("load in {}/payload.json, model with it in {}/model.json\n", out, out);
  } else if (*compare_verb) {
    fmt::print("{}", compare_table(compare(project, out)));
  } else if (*efficiency_verb) {
    fmt::print("{}", efficiency_table(efficiency(project, out)));
  } else if (*vibration_verb) {
    fmt::print("{}", vibration_table(vibration(project, out)));
  } else if (*update_verb) {
    Pipeline pipeline(project, out);
    const Update done = update(pipeline, new_session);
    fmt::print("{}", done.table);
    if (!done.accepted) throw DataError("the new coefficients are worse on the log's last third: nothing was replaced");
    fmt::print("updated: {0}/tables.bin, the page before is {0}/tables.previous.bin\n", out);
  } else {
    Pipeline pipeline(project, out);
    if (*run_verb) {
      pipeline.run();
      if (pipeline.project().compare.enabled) {
        fmt::print("{}", compare_table(compare(project, out)));
        pipeline.report();
      }
    }
    if (*identify_verb) pipeline.identify();
    if (*diagnose_verb) pipeline.diagnose();
    if (*train_verb) pipeline.train();
    if (*export_verb) pipeline.export_tables();
    if (*report_verb) pipeline.report();
    if (*can_option) {
      can_replay.most_ticks = ticks;
      can_replay.nodes.assign(nodes.begin(), nodes.end());
      const CanReplay done = replay_on_can(pipeline, can_replay);
      fmt::print("{}", can_replay_table(done.result));
      if (const auto disabled = done.result.at("disabled_ticks").get<std::uint64_t>(); disabled > 0)
        throw DataError(fmt::format(
            "the enable input was low in {} ticks, and no torque goes out then: set it high and replay again",
            disabled));
      if (!done.same)
        throw DataError(
            fmt::format("drives and host differ: see {}", (pipeline.directory() / "can_replay.json").string()));
      return 0;
    }
    if (*replay_verb) {
      if (image.empty()) throw InputError("replay: where to? --image drive.elf (QEMU) or --can can0 (drives)");
      const Replay done = replay(pipeline, image, ticks);
      if (!done.same) throw DataError(fmt::format("firmware and host differ: see {}", done.file.string()));
      fmt::print("bit-exact: {}\n", done.file.string());
    }
    fmt::print("{}", summary_table(pipeline.directory()));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const fxdyn::InputError& error) {
    fmt::print(stderr, "fxdyn: {}\n", error.what());
    return 2;
  } catch (const fxdyn::DataError& error) {
    fmt::print(stderr, "fxdyn: {}\n", error.what());
    return 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "fxdyn: internal error: {}\n", error.what());
    return 2;
  }
}

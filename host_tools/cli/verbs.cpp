#include <array>

#include "host_tools/cli/verb.hpp"

namespace fxdyn::cli {

std::span<const Verb> verbs() {
  static constexpr std::array all{
      Verb{"init", "A commented project file for logs of a robot, to standard output.",
           "run1.csv run2.csv --urdf robot.urdf > robot.toml", add_init},
      Verb{"check", "Look at the logs before any fit: columns, signs, zeros, units and rest against the URDF.",
           "robot.toml", add_check},
      Verb{"run", "diagnose, train, export and report in one go.", "robot.toml --out out/robot", add_run},
      Verb{"identify", "Structure and friction from the train logs: model.json, metrics.json.",
           "robot.toml --out out/robot", add_identify},
      Verb{"diagnose", "Find and name what the nominal model lacks, add it: diagnosis.json, model.json.",
           "robot.toml --out out/robot", add_diagnose},
      Verb{"train", "Fit a Broad Learning System on what diagnosis left; keep it where validation improves.",
           "robot.toml --out out/robot", add_train},
      Verb{"export",
           "Choose fixed-point formats, write tables.hpp, tables.bin, export.json; or files for simulators (--to).",
           "robot.toml --out out/robot", add_export},
      Verb{"report", "Draw report.html from what the other stages wrote.", "robot.toml --out out/robot", add_report},
      Verb{"compare", "Every method on the same logs, from plain least squares to named effects: compare.json.",
           "robot.toml --out out/robot", add_compare},
      Verb{"efficiency", "Test error against the seconds of train data, per method: efficiency.json.",
           "robot.toml --out out/robot", add_efficiency},
      Verb{"vibration", "The model as feedforward of the scenario's robot with gears that bend: vibration.json.",
           "robot.toml --out out/robot", add_vibration},
      Verb{"replay",
           "Stream the held-out logs to a firmware image in QEMU (--image) or to drive nodes on a CAN bus (--can) and\n"
           "compare bit for bit: replay.json, can_replay.json.",
           "robot.toml --out out/robot --image drive.elf", add_replay},
      Verb{"update", "Refit the coefficients with a new log, keep them where they are better: tables.bin, update.json.",
           "robot.toml --out out/robot --log new.csv", add_update},
      Verb{"verify", "Whether tables, model, project, logs and version in DIR belong together, and an image (--image).",
           "out/robot --image drive.elf", add_verify},
      Verb{"excite",
           "Plan trajectories that show the robot's parameters, within its limits: CSV to play, excite.json, plots.",
           "robot.toml --out out/plan", add_excite},
      Verb{"simulate", "Make logs from a scenario.", "scenario.toml --out out/logs", add_simulate},
      Verb{"predict", "Torque of a model over a log: CSV and metrics.json.",
           "--model out/robot/model.json --log run.csv --out out/prediction", add_predict},
      Verb{"forward",
           "Positions from the torques of a log, in open and in closed loop: forward.json, open.csv, closed.csv.",
           "--model out/robot/model.json --log run.csv --out out/forward", add_forward},
      Verb{"refine",
           "Parameters that fit the simulated positions of the train logs, from those by torque on: refined.json.",
           "robot.toml --out out/robot", add_refine},
      Verb{"payload",
           "Load on the last link from a log recorded with it: payload.json, and the model with it; or, of a load that "
           "is\n"
           "known (--mass), the gains of the torques: payload.json, torque_gain.toml.",
           "--model out/robot/model.json --log loaded.csv --out out/loaded", add_payload},
      Verb{"fleet", "Many robots, each in a process of its own: worst first, what drifts: fleet.html, fleet.json.",
           "fleet.toml --out out/fleet", add_fleet},
      Verb{"fleet-worker", "A part of a fleet, as a task of a cluster: what `fleet --slurm` submits.",
           "fleet.toml --out out/fleet --chunk 0 --of 8", add_fleet_worker},
      Verb{"history", "What drifts from session to session of one robot: history.html, history.json.",
           "out/2026-05-01 out/2026-06-01 --out out/history", add_history},
      Verb{"effects", "List the effects that the model knows.", "stribeck presliding", add_effects},
      Verb{"doctor", "What this machine lacks for which verb, and the command that installs it.", "", add_doctor},
      Verb{"completion", "What bash or zsh needs to complete verbs, options and file names, to standard output.",
           "bash > ~/.local/share/bash-completion/completions/fxdyn", add_completion},
      Verb{"man", "The manual page of fxdyn or of a verb, to standard output.", "run | man -l -", add_man},
  };
  return all;
}

}  // namespace fxdyn::cli

#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace fxdyn::cli {

/// What a verb does once its options are read.
/// @throws InputError, DataError
using Action = std::function<void()>;

/// A verb of the command line. A new one is a function beside the others and a line in verbs.cpp.
struct Verb {
  const char* name;
  const char* help;               ///< what it does and what it writes
  const char* example;            ///< what follows "fxdyn NAME "
  Action (*add)(CLI::App& verb);  ///< adds its options; the action holds them
};

/// All of them, in the order of `fxdyn --help`.
std::span<const Verb> verbs();

// One file a group: stages of a project, the replay, and verbs that need no project.
Action add_run(CLI::App& verb);
Action add_identify(CLI::App& verb);
Action add_diagnose(CLI::App& verb);
Action add_train(CLI::App& verb);
Action add_export(CLI::App& verb);
Action add_report(CLI::App& verb);
Action add_compare(CLI::App& verb);
Action add_efficiency(CLI::App& verb);
Action add_vibration(CLI::App& verb);
Action add_update(CLI::App& verb);
Action add_replay(CLI::App& verb);
Action add_init(CLI::App& verb);
Action add_check(CLI::App& verb);
Action add_excite(CLI::App& verb);
Action add_simulate(CLI::App& verb);
Action add_predict(CLI::App& verb);
Action add_forward(CLI::App& verb);
Action add_refine(CLI::App& verb);
Action add_payload(CLI::App& verb);
Action add_effects(CLI::App& verb);
Action add_fleet(CLI::App& verb);
Action add_fleet_worker(CLI::App& verb);
Action add_history(CLI::App& verb);
Action add_verify(CLI::App& verb);
Action add_doctor(CLI::App& verb);
Action add_completion(CLI::App& verb);
Action add_man(CLI::App& verb);

/// PROJECT and --out, as most verbs have them.
struct ProjectOptions {
  std::string project, out;
};
std::shared_ptr<ProjectOptions> add_project(CLI::App& verb);

}  // namespace fxdyn::cli

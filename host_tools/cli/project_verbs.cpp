// Verbs that take PROJECT and --out: stages of the pipeline and what continues from it.

#include <fmt/format.h>

#include "host_tools/cli/verb.hpp"
#include "host_tools/compare/compare.hpp"
#include "host_tools/compare/efficiency.hpp"
#include "host_tools/exchange/exchange.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/update/update.hpp"
#include "host_tools/vibration/vibration.hpp"

namespace fxdyn::cli {
namespace {

/// A stage, then the table of all that DIR holds.
Action stage(CLI::App& verb, void (*make)(Pipeline&)) {
  const auto options = add_project(verb);
  return [options, make] {
    Pipeline pipeline(options->project, options->out);
    make(pipeline);
    fmt::print("{}", summary_table(pipeline.directory()));
  };
}

/// A verb that makes its own pipeline; `table`: what it says at the end.
Action study(CLI::App& verb, std::string (*table)(const ProjectOptions&)) {
  const auto options = add_project(verb);
  return [options, table] { fmt::print("{}", table(*options)); };
}

}  // namespace

std::shared_ptr<ProjectOptions> add_project(CLI::App& verb) {
  auto options = std::make_shared<ProjectOptions>();
  verb.add_option("PROJECT", options->project, "project file (TOML)")->required();
  verb.add_option("--out", options->out, "directory for the results")->required();
  return options;
}

Action add_run(CLI::App& verb) {
  const auto options = add_project(verb);
  return [options] {
    Pipeline pipeline(options->project, options->out);
    pipeline.run();
    if (pipeline.project().compare.enabled) {
      fmt::print("{}", compare_table(compare(options->project, options->out)));
      pipeline.report();
    }
    fmt::print("{}", summary_table(pipeline.directory()));
  };
}
Action add_identify(CLI::App& verb) {
  return stage(verb, [](Pipeline& pipeline) { pipeline.identify(); });
}
Action add_diagnose(CLI::App& verb) {
  return stage(verb, [](Pipeline& pipeline) { pipeline.diagnose(); });
}
Action add_train(CLI::App& verb) {
  return stage(verb, [](Pipeline& pipeline) { pipeline.train(); });
}
Action add_export(CLI::App& verb) {
  const auto options = add_project(verb);
  const auto formats = std::make_shared<std::vector<std::string>>();
  verb.add_option("--to", *formats,
                  "no tables, but files for simulators and what each can't say: " + export_format_names())
      ->delimiter(',')
      ->allow_extra_args(false);
  return [options, formats] {
    Pipeline pipeline(options->project, options->out);
    if (!formats->empty()) {
      fmt::print("{}", export_for_simulators(pipeline, *formats));
      return;
    }
    pipeline.export_tables();
    fmt::print("{}", summary_table(pipeline.directory()));
  };
}
Action add_report(CLI::App& verb) {
  return stage(verb, [](Pipeline& pipeline) { pipeline.report(); });
}

Action add_compare(CLI::App& verb) {
  return study(verb, [](const ProjectOptions& o) { return compare_table(compare(o.project, o.out)); });
}
Action add_efficiency(CLI::App& verb) {
  return study(verb, [](const ProjectOptions& o) { return efficiency_table(efficiency(o.project, o.out)); });
}
Action add_vibration(CLI::App& verb) {
  return study(verb, [](const ProjectOptions& o) { return vibration_table(vibration(o.project, o.out)); });
}

Action add_update(CLI::App& verb) {
  const auto options = add_project(verb);
  const auto session = std::make_shared<UpdateSettings>();
  verb.add_option("--log", session->log, "log (CSV) of a new session")->required();
  verb.add_option("--forgetting", session->forgetting,
                  "what was known a second ago counts, 1: all (default: the project's identify.forgetting)");
  verb.add_flag("--rebuild", session->rebuild, "choose formats anew: the firmware needs a rebuild");
  return [options, session] {
    Pipeline pipeline(options->project, options->out);
    const Update done = update(pipeline, *session);
    fmt::print("{}", done.table);
    if (!done.accepted) throw DataError("the new coefficients are worse on the log's last third: nothing was replaced");
    fmt::print("updated: {0}/tables.bin, the page before is {0}/tables.previous.bin\n", options->out);
  };
}

}  // namespace fxdyn::cli

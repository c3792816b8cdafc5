#include "host_tools/update/update.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/identify/plausible.hpp"
#include "host_tools/pipeline/one_log.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/train/kept_effects.hpp"
#include "host_tools/train/stored_information.hpp"
#include "host_tools/update/update_result.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

/// The new log in two parts, and the logs that the fit never saw.
struct NewSession {
  LogReference reference;
  std::vector<ProcessedLog> refit;  ///< one
  ProcessedLog held_out;
  std::vector<ProcessedLog> test;
  double refit_s = 0, held_out_s = 0;
};

NewSession read_session(const Pipeline& pipeline, const IdentifiedModel& model, double row_interval_s,
                        const fs::path& file, const UpdateOptions& options) {
  const Project& project = pipeline.project();
  NewSession out;
  out.reference = {file.filename().string(), "update", hash_of_file(file), 0, 0};
  const auto used = [&](const std::string& as) {
    return InputError(
        fmt::format("{}: this model knows it already, as {} log: update with a new one", file.string(), as));
  };
  for (const auto* logs : {&model.logs, &model.updates}) {
    for (const LogReference& log : *logs) {
      if (log.hash == out.reference.hash) throw used(log.role);
    }
  }
  for (Log& log : read_logs(project, Role::test, pipeline.directory())) {
    if (hash_of_file(log.file) == out.reference.hash) throw used("test");
    out.test.push_back(process(std::move(log), model.filter));
  }
  double cut_s = 0;
  {
    const Log whole = read_log_for(model, file, {}, {});
    const double from = whole.t[0], to = whole.t[whole.samples() - 1];
    if (to - from < options.shortest_s)
      throw DataError(
          fmt::format("{}: {:.1f} s are too short to refit from two thirds and judge by the rest; record {:g} s "
                      "at least",
                      file.string(), to - from, options.shortest_s));
    check_torque(whole, model.robot);
    cut_s = from + options.refit_share * (to - from);
    out.refit_s = cut_s - from;
    out.held_out_s = to - cut_s;
    out.reference.from_s = from;
    out.reference.to_s = cut_s;
  }
  Log refit = read_log_for(model, file, {}, cut_s), held_out = read_log_for(model, file, cut_s, {});
  refit.role = Role::train;
  held_out.role = Role::test;
  ProcessSettings settings;
  settings.torque_limits = project.limits.torque;
  settings.shortest_interval_s = row_interval_s;  // a second of it counts what a second of the train logs does
  out.refit.push_back(process(std::move(refit), model.filter, settings));
  out.held_out = process(std::move(held_out), model.filter);
  require_log_of(model, file, out.refit.front(), predict(model, out.refit.front()));
  const std::vector<bool> moving = moving_joints(out.refit);
  for (std::size_t j = 0; j < moving.size(); ++j) {
    if (!moving[j])
      throw DataError(
          fmt::format("{}: joint {} ({}) never moves in its first two thirds: record a log in which it does",
                      file.string(), j + 1, model.robot.joints[j].name));
  }
  for (const Suspicion& suspicion : check_plausible(project.robot, out.refit, model.joints)) {
    if (suspicion.severity == Severity::error) throw DataError(fmt::format("{}: {}", file.string(), suspicion.text));
  }
  return out;
}

/// Base parameters that the tables do not compute: they stay zero.
std::vector<Index> zeros_of(const IdentifiedModel& model) {
  std::vector<Index> zeros;
  for (std::size_t i = 0; i < model.base.size(); ++i) {
    const std::size_t link = model.base[i].column / parameters_per_link, k = model.base[i].column % parameters_per_link;
    if ((model.layout->parameters[link] >> k & 1U) == 0) zeros.push_back(static_cast<Index>(i));
  }
  return zeros;
}

/// Standard deviations in the order of coefficients_of().
VectorXd deviations_of(IdentifiedModel model, std::vector<JointFit> design) {
  for (BaseParameter& parameter : model.base) parameter.value = parameter.std;
  for (JointFit& joint : design) {
    for (EffectFit& fit : joint.effects) {
      fit.linear_std.resize(fit.linear.size(), 0.0);
      fit.linear = fit.linear_std;
    }
    if (joint.bls) joint.bls->coefficients.setZero();
  }
  return coefficients_of(model, design);
}

struct Refit {
  IdentifiedModel model;
  StoredInformation stored;
};

Refit refit(const Project& project, const IdentifiedModel& old, const StoredInformation& stored,
            std::vector<ProcessedLog>& logs, double forgetting) {
  const KeptEffects kept(old, logs, !stored.fits_drift);
  std::vector<JointFit> design = kept.design();
  kept.mark_hidden(logs);
  Fitter fitter(project.robot, logs, design);
  fitter.set_structural(structural_torque(old, logs));  // a BLS may have it among its inputs
  for (std::size_t j = 0; j < design.size(); ++j) design[j].bls = old.joints[j].bls;
  fitter.set_designs(design);
  if (fitter.unknowns() != stored.unknowns)
    throw InputError(
        "information.cbor: about other coefficients than this log refits: run `fxdyn run` with the log in the project");
  fitter.set_weights(stored.weights);

  const std::vector<Index> zeros = zeros_of(old);
  const VectorXd std_before = deviations_of(old, design), known_before = stored.information.deviations();
  Refit out{old, stored};
  std::vector<MatrixXd> torque;
  // The kept effects follow the rigid body that is fitted beside them.
  for (int round = 0; round < 2; ++round) {
    std::vector<MatrixXd> now = kept.torque(out.model, logs);
    if (round > 0 && now == torque) break;
    torque = std::move(now);
    fitter.set_torque_lead(old.filter.torque_lead_s, torque);
    out.stored.information = fitter.recursive(forgetting, 0, stored.information).information;
    const SquareRootInformation& known = out.stored.information;
    VectorXd x = known.solve_without(zeros);
    if (project.identify.physical && !project.identify.essential) {
      const PhysicalFit possible =
          fit_physical(fitter, project.robot, known.information(), known.projection(), known.variance_of_row());
      if (possible.constrained) x << possible.beta, possible.theta;
      for (const Index i : zeros) x[i] = 0;
    }
    Solution solution = fitter.split(x);
    for (const BaseParameter& parameter : old.base) solution.essential.push_back(parameter.essential);
    // What the noise's correlation makes of them is as it was; what is known has changed.
    const VectorXd known_now = known.deviations();
    const Solution std = fitter.split(
        (known_before.array() > 0).select(std_before.array() * known_now.array() / known_before.array(), 0).matrix());
    solution.beta_std = std.beta;
    solution.theta_std = std.theta;
    IdentifiedModel fitted = kept.restore(fitter.to_model(solution));
    out.model.inertia = std::move(fitted.inertia);
    out.model.base = std::move(fitted.base);
    out.model.joints = std::move(fitted.joints);
  }
  return out;
}

/// Errors of a model over some logs, pooled.
struct Errors {
  explicit Errors(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs) {
    std::vector<LogErrors> errors;
    for (const ProcessedLog* log : logs) errors.push_back(errors_of(*log, model.robot, predict(model, *log)));
    for (std::size_t j = 0; j < model.joints.size(); ++j) rmse.push_back(pooled_error(errors, Role::test, j).rmse);
  }
  std::vector<double> rmse;  ///< of each joint [N*m | N]
};

struct Judged {
  Errors before, after;
};

Judged judged(const IdentifiedModel& before, const IdentifiedModel& after,
              const std::vector<const ProcessedLog*>& logs) {
  return {Errors(before, logs), Errors(after, logs)};
}

/// Mean over the joints of log(after / before).
double mean_log_ratio(const Judged& judged) {
  double sum = 0;
  const std::size_t n = judged.before.rmse.size();
  for (std::size_t j = 0; j < n; ++j)
    sum += std::log(std::max(judged.after.rmse[j], 1e-300) / std::max(judged.before.rmse[j], 1e-300));
  return sum / static_cast<double>(n);
}

std::string change_text(const Judged& judged, std::size_t joint, double rated) {
  const double before = judged.before.rmse[joint], after = judged.after.rmse[joint];
  return fmt::format("{:>10.4g} ({:5.2f}%) -> {:>9.4g} ({:5.2f}%) {:>+5.0f} %", before, 100 * before / rated, after,
                     100 * after / rated, before > 0 ? 100 * (after / before - 1) : 0.0);
}

std::string table_of(const IdentifiedModel& model, const NewSession& session, const Judged& held_out,
                     const std::optional<Judged>& test, double forgetting) {
  std::size_t width = 8;
  for (const Joint& joint : model.robot.joints) width = std::max(width, joint.name.size() + 2);
  std::string out = fmt::format(
      "\n{:.1f} s of {} refitted, what was known a second ago counts {:g}; {:.1f} s judge\n"
      "RMSE before -> after (in parentheses: share of the rated torque)\n{:<{}}{:<6}{:>49}",
      session.refit_s, session.reference.file, forgetting, session.held_out_s, "joint", width, "unit",
      "last third of the log");
  if (test) out += fmt::format("{:>51}", "test logs of the project");
  out += "\n";
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const double rated = model.joints[j].rated_torque;
    out += fmt::format("{:<{}}{:<6}{}", model.robot.joints[j].name, width, model.robot.joints[j].torque_unit(),
                       change_text(held_out, j, rated));
    if (test) out += "  " + change_text(*test, j, rated);
    out += "\n";
  }
  return out;
}

UpdateResult result_of(const IdentifiedModel& before, const NewSession& session, const Judged& held_out,
                       const std::optional<Judged>& test, double forgetting) {
  UpdateResult out;
  out.log = session.reference.file;
  out.hash = session.reference.hash;
  out.refit_s = session.refit_s;
  out.held_out_s = session.held_out_s;
  out.forgetting = forgetting;
  const auto change = [](const Judged& judged, std::size_t j) {
    return UpdateResult::Change{judged.before.rmse[j], judged.after.rmse[j]};
  };
  for (std::size_t j = 0; j < before.joints.size(); ++j) {
    const Joint& joint = before.robot.joints[j];
    out.joints.push_back({joint.name, joint.torque_unit(), before.joints[j].rated_torque, change(held_out, j),
                          test ? std::optional(change(*test, j)) : std::nullopt});
  }
  out.mean_log_ratio = mean_log_ratio(held_out);
  out.tables_crc.before = before.tables_crc;
  out.sequence.before = before.lineage.sequence;
  return out;
}

/// A folder for files that replace those of `directory` together; gone with the object.
class Staging {
 public:
  explicit Staging(const fs::path& directory) : directory_(directory), staged_(directory / "update.tmp") {
    fs::remove_all(staged_);
    fs::create_directories(staged_);
  }
  ~Staging() {
    std::error_code ignored;
    fs::remove_all(staged_, ignored);
  }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  const fs::path& path() const { return staged_; }
  /// Keeps every tables.bin as tables.previous.bin; `last` comes when all others are in place.
  void replace(const fs::path& last) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(staged_)) {
      if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), staged_));
    }
    std::sort(files.begin(), files.end(),
              [&](const fs::path& a, const fs::path& b) { return std::pair(a == last, a) < std::pair(b == last, b); });
    for (const fs::path& file : files) {
      const fs::path place = directory_ / file;
      if (file.filename() == "tables.bin" && fs::exists(place))
        write_file(place.parent_path() / "tables.previous.bin", read_file(place));
    }
    for (const fs::path& file : files) {
      fs::create_directories((directory_ / file).parent_path());
      fs::rename(staged_ / file, directory_ / file);
    }
  }

 private:
  fs::path directory_, staged_;
};

}  // namespace

Update update(Pipeline& pipeline, const UpdateSettings& settings, const UpdateOptions& options) {
  const Project& project = pipeline.project();
  const fs::path& directory = pipeline.directory();
  const double forgetting = settings.forgetting.value_or(project.identify.forgetting);
  if (!(forgetting > 0 && forgetting <= 1))
    throw InputError(fmt::format("--forgetting {:g}: more than 0, at most 1 (1 forgets nothing)", forgetting));
  const IdentifiedModel old = pipeline.exported();
  const StoredInformation stored = read_information(old, directory);

  Progress progress;
  progress.stage("refitting, judging", 3);
  NewSession session = read_session(pipeline, old, stored.row_interval_s, settings.log, options);
  progress.step();
  auto [updated, known] = refit(project, old, stored, session.refit, forgetting);
  progress.step();
  const Judged held_out = judged(old, updated, {&session.held_out});
  std::optional<Judged> test;
  if (!session.test.empty()) {
    std::vector<const ProcessedLog*> logs;
    for (const ProcessedLog& log : session.test) logs.push_back(&log);
    test = judged(old, updated, logs);
  }
  progress.step();
  progress.done();
  UpdateResult result = result_of(old, session, held_out, test, forgetting);
  Update out{result.mean_log_ratio < 0, table_of(old, session, held_out, test, forgetting)};
  if (!out.accepted) {
    write_file(directory / "update.json", to_json(result).dump(1) + "\n");
    return out;
  }

  Formats formats = *old.formats;
  if (settings.rebuild) {
    updated.drop_formats();
    formats = choose_formats(updated);
  } else if (const std::string why = why_not_in_layout(updated, formats); !why.empty()) {
    throw DataError(
        fmt::format("{}: the new coefficients do not fit the tables that the firmware was built for ({}): it needs a "
                    "rebuild; add --rebuild and build it from the new tables.hpp",
                    settings.log.string(), why));
  }
  ++updated.lineage.sequence;
  updated.updates.push_back(session.reference);
  updated.notes.push_back(fmt::format("coefficients updated with {:.1f} s of {}, forgetting {:g}", session.refit_s,
                                      session.reference.file, forgetting));
  const Staging staging(directory);
  pipeline.write_export(updated, formats, staging.path());
  if (const PageHeader now = header_of(directory / "tables.bin"), next = header_of(staging.path() / "tables.bin");
      !settings.rebuild && (now.layout_hash != next.layout_hash || now.words != next.words)) {
    throw DataError(fmt::format("{}: the tables' layout has changed: it needs a rebuild; add --rebuild",
                                (directory / "tables.bin").string()));
  }
  write_file(staging.path() / "model.json", to_json(updated).dump(1) + "\n");
  write_information(known, read_model(staging.path() / "model.json"), staging.path());
  if (const fs::path file = directory / "metrics.json"; fs::exists(file)) {
    MetricsResult metrics = metrics_of(json::parse(read_file(file)));
    metrics.logs = pipeline.stage_errors(updated, "update").logs;
    metrics.notes.push_back(updated.notes.back());
    write_file(staging.path() / "metrics.json", to_json(metrics).dump(1) + "\n");
  }
  result.accepted = true;
  result.tables_crc.after = updated.tables_crc;
  result.sequence.after = updated.lineage.sequence;
  write_file(staging.path() / "update.json", to_json(result).dump(1) + "\n");
  staging.replace("model.json");
  return out;
}

}  // namespace fxdyn

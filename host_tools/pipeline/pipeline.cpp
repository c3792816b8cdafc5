#include "host_tools/pipeline/pipeline.hpp"

#include <fmt/format.h>
#include <algorithm>

#include <chrono>
#include <nlohmann/json.hpp>

#include "host_tools/check/check.hpp"
#include "host_tools/diagnose/diagnose.hpp"
#include "host_tools/diagnose/evidence.hpp"
#include "host_tools/diagnose/plots.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/pipeline/fit_metrics.hpp"
#include "host_tools/pipeline/possible_model.hpp"
#include "host_tools/pipeline/tables_export.hpp"
#include "host_tools/pipeline/training.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/project/seal.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/robot/write_urdf.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/heap.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

}  // namespace

Pipeline::Pipeline(const fs::path& project, fs::path directory)
    : project_(read_project(project)), directory_(std::move(directory)) {
  check_writable(directory_);
}

Pipeline::~Pipeline() = default;

GateData& Pipeline::data() {
  if (!data_) {
    progress_.stage("reading and filtering the logs", 1);
    const std::vector<LogFacts> of_train = facts_of_train_logs(project_, directory_);
    data_ = std::make_unique<GateData>(read_gate_data(project_, directory_));
    data_notes_ = data_->notes;
    progress_.step();
    progress_.stage("checking the logs", 1);
    for (std::string& note : check_before_fit(project_, directory_, *data_, of_train))
      data_notes_.push_back(std::move(note));
    data_->rows = {};  // every log has been compared with the others
    give_back_memory();
    progress_.step();
    progress_.done();
  }
  return *data_;
}

const std::vector<LogReference>& Pipeline::diagnosed_logs() {
  if (!diagnosed_logs_) {
    diagnosed_logs_ = data().references;
    for (const Log& log : read_logs(project_, Role::baseline, directory_))
      diagnosed_logs_->push_back(
          {log.file.filename().string(), to_string(log.role), hash_of_file(log.file), log.from_s, log.to_s});
  }
  return *diagnosed_logs_;
}

bool Pipeline::is_current(const IdentifiedModel& model) {
  if (model.project_hash != project_hash(project_)) return false;
  const auto& made_from = model.stage == "identified" ? data().references : diagnosed_logs();
  return std::equal(model.logs.begin(), model.logs.end(), made_from.begin(), made_from.end(),
                    [](const LogReference& a, const LogReference& b) { return a.hash == b.hash; });
}

std::optional<IdentifiedModel> Pipeline::written(std::initializer_list<std::string_view> stages) {
  const fs::path file = directory_ / "model.json";
  if (!fs::exists(file)) return {};
  IdentifiedModel model = read_model(file);
  const bool wanted = std::find(stages.begin(), stages.end(), model.stage) != stages.end();
  return wanted && is_current(model) ? std::optional(std::move(model)) : std::nullopt;
}

void Pipeline::check_motion() {
  const std::vector<bool> moving = moving_joints(data().logs);
  for (std::size_t j = 0; j < moving.size(); ++j) {
    if (moving[j]) continue;
    throw DataError(fmt::format("joint {} ({}) never moves in the train logs: record a log in which it does", j + 1,
                                project_.robot.joints[j].name));
  }
}

std::optional<std::pair<int, std::string>> Pipeline::not_excited() const {
  const fs::path file = directory_ / "diagnosis.json";
  if (!fs::exists(file)) return {};
  for (const JointDiagnosis& joint : diagnosis_of(json::parse(read_file(file))).joints) {
    if (joint.verdict == Verdict::not_excited) return {{static_cast<int>(joint.index), joint.joint}};
  }
  return {};
}

void Pipeline::check_excited() const {
  const auto joint = not_excited();
  if (!joint) return;
  throw DataError(fmt::format(
      "joint {} ({}) is not_excited: it moves no more than its encoder's noise, and its friction is not in the "
      "model; record a log in which it moves",
      joint->first, joint->second));
}

std::vector<ProcessedLog> Pipeline::logs(Role role) {
  std::vector<ProcessedLog> out;
  for (Log& log : read_logs(project_, role, directory_)) {
    check_torque(log, project_.robot);
    out.push_back(process(std::move(log), data().filter));
  }
  return out;
}

StageErrors Pipeline::stage_errors(const IdentifiedModel& model, const std::string& stage) {
  StageErrors out{stage, {}};
  for (const ProcessedLog& log : data().logs) out.logs.push_back(errors_of(log, model.robot, predict(model, log)));
  for (const ProcessedLog& log : logs(Role::test)) out.logs.push_back(errors_of(log, model.robot, predict(model, log)));
  return out;
}

std::function<StageErrors(const IdentifiedModel&, const std::string&)> Pipeline::stage_errors() {
  return [this](const IdentifiedModel& model, const std::string& stage) { return stage_errors(model, stage); };
}

void Pipeline::write_possible_bodies(const std::optional<PhysicalFit>& bodies) const {
  if (!bodies) return;
  write_urdf(project_.urdf, directory_ / "identified.urdf", project_.robot, to_dh(project_.robot), bodies->inertia,
             share_comments(*bodies));
}

void Pipeline::identify() {
  const ThreadLimit limit(data().threads);
  data().notes = data_notes_;
  const auto fitter = fxdyn::identify(project_, data(), progress_);
  progress_.stage("fit, standard deviations, possible bodies", 1);
  Estimate estimate = finish_model(*fitter, project_, data());
  progress_.step();
  IdentifiedModel& model = estimate.model;
  if (const std::string weak = weak_note(estimate.weak, project_.robot); !weak.empty()) model.notes.push_back(weak);
  data().notes = model.notes;
  progress_.stage("errors on all logs", 2);
  std::vector<StageErrors> stages{rigid_errors(*fitter, project_, data().filter, stage_errors())};
  progress_.step();
  stages.push_back(stage_errors(model, "friction"));
  progress_.step();
  progress_.done();
  const MetricsResult metrics = fit_metrics(project_, *fitter, estimate, data().notes, stages);
  write_possible_bodies(estimate.physical);
  write_file(directory_ / "model.json", to_json(model).dump(1) + "\n");
  write_file(directory_ / "metrics.json", to_json(metrics).dump(1) + "\n");
  for (const std::string& note : data().notes) fmt::print(stderr, "note: {}\n", note);
}

void Pipeline::diagnose() {
  const auto start = Clock::now();
  const ThreadLimit limit(data().threads);
  data().notes = data_notes_;
  std::vector<ProcessedLog> baseline;
  for (Log& log : read_logs(project_, Role::baseline, directory_)) {
    log.role = Role::train;  // what the healthy session is fitted on
    check_torque(log, project_.robot);
    baseline.push_back(process(std::move(log), data().filter));
  }
  std::optional<PhysicalFit> bodies;  // of the model that was finished last: the one with what was found
  FinishModel finish;
  if (project_.identify.physical) {
    finish = [&](const IdentifiedModel& found, const std::vector<ProcessedLog>& made_from) {
      PossibleModel possible = possible_model(project_, found, made_from);
      bodies = std::move(possible.bodies);
      return std::move(possible.model);
    };
  }
  const Diagnosis diagnosis = fxdyn::diagnose(project_, data(), baseline, logs(Role::test), progress_, {}, finish);
  IdentifiedModel model = diagnosis.model;
  model.stage = "diagnosed";
  model.notes = data().notes;
  IdentifiedModel nominal = diagnosis.nominal;
  model.logs = nominal.logs = diagnosed_logs();
  progress_.stage("errors on all logs, fixed point, closed loop, plots", 4);
  std::vector<StageErrors> stages{stage_errors(nominal, "friction")};
  progress_.step();
  stages.push_back(stage_errors(model, "diagnosed"));
  progress_.step();
  std::vector<ProcessedLog> held_out = logs(Role::test);
  if (held_out.empty()) held_out = logs(Role::validate);
  DiagnosisResult report = diagnosis.report;
  report.evidence = held_out_evidence(nominal, model, held_out, diagnosis.still);
  progress_.step();
  const MetricsResult metrics{.logs = stages.back().logs,
                              .gate = report.gate,
                              .base_parameters = model.base.size(),
                              .notes = data().notes,
                              .stages = stages};
  write_possible_bodies(bodies);
  write_file(directory_ / "nominal.json", to_json(nominal).dump(1) + "\n");
  write_file(directory_ / "metrics.json", to_json(metrics).dump(1) + "\n");
  write_file(directory_ / "diagnosis.json", to_json(report).dump(1) + "\n");
  write_file(directory_ / "model.json", to_json(model).dump(1) + "\n");
  std::string no_plots;
  try {
    write_diagnosis_plots(nominal, model, held_out, report, directory_);
  } catch (const InputError& error) {
    no_plots = error.what();  // the answer stands without them
  }
  progress_.step();
  progress_.done();
  for (const std::string& note : data().notes) fmt::print(stderr, "note: {}\n", note);
  if (!no_plots.empty()) fmt::print(stderr, "note: no plots of the diagnosis: {}\n", no_plots);
  note_seconds(directory_, "diagnose", seconds_since(start));
}

std::vector<StageErrors> Pipeline::diagnosed_stages() const {
  std::vector<StageErrors> out;
  const fs::path file = directory_ / "metrics.json";
  if (!fs::exists(file)) return out;
  for (StageErrors& stage : metrics_of(json::parse(read_file(file))).stages) {
    if (stage.stage == "friction" || stage.stage == "diagnosed") out.push_back(std::move(stage));
  }
  return out;
}

void Pipeline::train() {
  const TrainSettings& settings = project_.train;
  const ThreadLimit limit(data().threads);
  check_motion();
  std::string inputs = project_hash(project_);
  for (const LogReference& log : data().references) inputs += log.hash;
  ResumeFile resume{directory_ / "train.pso.json", {}, hash_of(inputs)};
  if (settings.enabled && settings.pso) resume.check_inputs();
  // An updated model is not what diagnosis left.
  if (const auto before = written({"diagnosed", "trained"}); !before || !before->updates.empty()) diagnose();
  // Always from the files: `fxdyn run` gives the same bytes as the verbs one by one.
  const auto start = Clock::now();
  const IdentifiedModel diagnosed = read_model(directory_ / "model.json");
  check_excited();
  std::vector<StageErrors> stages = diagnosed_stages();
  data().notes = diagnosed.notes;
  if (const std::string note = unused_settings(settings); !note.empty()) {
    if (std::find(data().notes.begin(), data().notes.end(), note) == data().notes.end()) data().notes.push_back(note);
  }
  Trainer trainer(project_, data(), diagnosed, stage_errors(), progress_);
  const Training training = trainer.run(resume);
  stages.insert(stages.begin(), training.rigid);
  stages.push_back(training.trained);
  MetricsResult metrics = fit_metrics(project_, trainer.fitter(), training.estimate, data().notes, stages);
  metrics.training = trained_joints(training.outcomes, project_.robot);
  metrics.gate_errors = training.gate_errors;
  add_friction_errors(metrics.gate_errors, trainer.fitter(), stages, directory_ / "nominal.json");
  write_possible_bodies(training.estimate.physical);
  write_file(directory_ / "metrics.json", to_json(metrics).dump(1) + "\n");
  write_file(directory_ / "model.json", to_json(training.model).dump(1) + "\n");
  write_information(training.stored, read_model(directory_ / "model.json"), directory_);
  fs::remove(resume.path);  // a search can take hours: not before its outcome is written
  note_seconds(directory_, "train", seconds_since(start));
}

IdentifiedModel Pipeline::model() {
  if (auto model = written({"trained"})) return *std::move(model);
  train();
  return read_model(directory_ / "model.json");
}

std::optional<IdentifiedModel> Pipeline::trained() { return written({"trained"}); }

IdentifiedModel Pipeline::exported() {
  const fs::path file = directory_ / "model.json";
  const auto refuse = [&](const std::string& why, const char* verb) {
    return InputError(fmt::format("{}: {}: run `fxdyn {} {} --out {}` first", file.string(), why, verb,
                                  project_.file.string(), directory_.string()));
  };
  if (!fs::exists(file)) throw refuse("there is no model", "run");
  std::optional<IdentifiedModel> model = trained();
  if (!model) throw refuse("not a trained model of this project and its logs as they are now", "run");
  const fs::path page = directory_ / "tables.bin";
  if (!model->formats || !model->layout || model->lineage.sequence == 0 || !fs::exists(page) ||
      header_of(page).crc32 != model->tables_crc)
    throw refuse("its tables are not exported", "export");
  return *std::move(model);
}

void Pipeline::export_tables() {
  IdentifiedModel model = this->model();
  model.drop_formats();
  const Formats formats = choose_formats(model);
  write_export(model, formats, directory_);
  write_file(directory_ / "model.json", to_json(model).dump(1) + "\n");
}

void Pipeline::write_export(IdentifiedModel& model, const Formats& formats, const fs::path& directory) {
  ExportResult result;
  try {
    result = fxdyn::export_tables(model, formats, project_.target, data().logs, directory, directory_ / "model.json",
                                  progress_);
  } catch (const DataError&) {
    // Those of a model before this one would be taken for its own.
    for (const char* name : {"tables.hpp", "tables.bin", "export.json"}) fs::remove(directory / name);
    throw;
  }
  std::vector<std::string> files{"tables.bin", "tables.hpp"};
  for (const ExportResult::Drive& drive : result.drives) {
    for (const char* name : {"tables.bin", "tables.hpp"})
      files.push_back(fmt::format("joint_{}/{}", drive.joint + 1, name));
  }
  json content = to_json(result);
  content["of"] = belongings(project_, directory_, directory, files);
  content["of"]["files"]["model.json"] = hash_of(to_json(model).dump(1) + "\n");  // as the caller writes it
  write_file(directory / "export.json", sealed(std::move(content)));
}

void Pipeline::report() {
  // A diagnosis that training refuses is drawn as it is.
  const auto diagnosed = written({"diagnosed"});
  IdentifiedModel model = diagnosed && not_excited() ? *diagnosed : this->model();
  std::optional<DataError> refused;  // drawn all the same: it shows why
  if (model.stage == "trained" && (!model.formats || !fs::exists(directory_ / "export.json"))) {
    try {
      export_tables();
      model = this->model();
    } catch (const DataError& error) {
      refused = error;
    }
  }
  progress_.stage("drawing the report", 1);
  std::vector<ProcessedLog> shown = logs(Role::test);
  if (shown.empty()) shown = logs(Role::validate);
  if (shown.empty()) shown = logs(Role::train);
  write_report(model, shown, directory_, project_.report);
  progress_.step();
  progress_.done();
  if (refused) throw DataError(*refused);
}

void Pipeline::run() {
  check_motion();
  diagnose();
  train();
  report();  // after the export that it needs
}

}  // namespace fxdyn

#include "host_tools/pipeline/pipeline.hpp"

#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "host_tools/diagnose/diagnose.hpp"
#include "host_tools/diagnose/evidence.hpp"
#include "host_tools/diagnose/plots.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/proof.hpp"
#include "host_tools/identify/payload.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/report/report.hpp"
#include "host_tools/robot/write_urdf.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/train/kept_effects.hpp"
#include "host_tools/train/stored_information.hpp"
#include "host_tools/train/train.hpp"

namespace fxdyn {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

/// |fixed - double| on the logs beyond which tables are refused, of rated torque.
constexpr double largest_error = 1e-3;
/// The proven range of the rigid body's torque is refined until it is no more than this times what is attained ...
constexpr double tight_enough = 2;
/// ... or this many boxes were looked at.
constexpr int proof_boxes = 40'000;
constexpr Eigen::Index random_states = 20'000;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Settings of [train] that the others leave without effect, and why; empty: none. Sparse features have windows of
/// nodes of their own, whatever searches.
std::string unused_settings(const TrainSettings& settings) {
  if (!settings.enabled) return {};
  const bool sparse = settings.features == "sparse", swarm = settings.pso.has_value();
  std::string names;
  const auto add = [&](bool unused, const char* key) {
    if (unused) names += (names.empty() ? "" : ", ") + std::string(key);
  };
  const bool sized = swarm || settings.enhancement;
  add(settings.windows && !sparse && (sized || !settings.nodes), "windows");
  add(settings.nodes && !sparse && sized, "nodes");
  add(settings.enhancement && swarm, "enhancement");
  add(settings.ridge && swarm, "ridge");
  if (names.empty()) return {};
  return fmt::format("train.{}: not used, {}", names,
                     swarm                  ? "the swarm of [train.pso] chooses within its bounds"
                     : settings.enhancement ? "enhancement says how many nodes there are"
                                            : "the number of nodes is searched; give nodes too to set it");
}

std::string weak_note(const std::vector<WeakParameter>& weak, const Robot& robot) {
  if (weak.empty()) return {};
  std::string names;
  for (const WeakParameter& one : weak) names += (names.empty() ? "" : ", ") + one.name;
  const auto worst =
      std::max_element(weak.begin(), weak.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
  return fmt::format(
      "these logs tell {} poorly (at the limits up to {:.0f} % of rated torque): move joint {} ({}) more and faster",
      names, 100 * worst->error, worst->joint + 1, robot.joints[static_cast<std::size_t>(worst->joint)].name);
}

/// Mean logarithm of the errors on the validate logs; NaN where there are none.
double gate_error(const json& stage) {
  double sum = 0, count = 0;
  for (const json& log : stage.at("logs")) {
    if (log.at("role") != "validate") continue;
    for (const json& joint : log.at("joints")) {
      sum += std::log(std::max(joint.at("rmse").get<double>(), 1e-300));
      ++count;
    }
  }
  return sum / count;
}

/// Estimates on the way through the logs: one row a moment, base parameters first, then each joint's coefficients.
json recursion_json(const Fitter::Recursion& recursion, double forgetting) {
  json trace = json::array();
  for (Eigen::Index k = 0; k < recursion.trace.rows(); ++k) {
    const Eigen::VectorXd row = recursion.trace.row(k);
    trace.push_back(std::vector<double>(row.begin(), row.end()));
  }
  return {{"forgetting", forgetting},
          {"t", std::vector<double>(recursion.t.begin(), recursion.t.end())},
          {"estimates", trace}};
}

}  // namespace

Pipeline::Pipeline(const fs::path& project, fs::path directory)
    : project_(read_project(project)), directory_(std::move(directory)) {
  check_writable(directory_);
}

GateData& Pipeline::data() {
  if (!data_) {
    progress_.stage("reading and filtering the logs", 1);
    data_ = std::make_unique<GateData>(read_gate_data(project_, directory_));
    data_notes_ = data_->notes;
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
  const json report = json::parse(read_file(file));
  for (const json& joint : report.at("joints")) {
    if (joint.at("verdict") == "not_excited") return {{joint.at("index"), joint.at("joint")}};
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

json Pipeline::stage_metrics(const IdentifiedModel& model, const std::string& stage) {
  json list = json::array();
  const auto add = [&](const ProcessedLog& log) {
    list.push_back(metrics_json(log, model.robot, judge(log, predict(model, log))));
  };
  for (const ProcessedLog& log : data().logs) add(log);
  for (const ProcessedLog& log : logs(Role::test)) add(log);
  return {{"stage", stage}, {"logs", list}};
}

/// The same structure without effects and BLS, refitted.
json Pipeline::rigid_metrics(Fitter fitter) {
  for (std::size_t j = 0; j < fitter.joints(); ++j) {
    JointFit design = fitter.design(j);
    design.bls.reset();
    design.effects.clear();
    fitter.set_design(j, design);
  }
  weigh(fitter, project_.identify);
  IdentifiedModel rigid = fitter.to_model(fitter.estimate());
  rigid.filter = data().filter;
  rigid.filter.torque_lead_s = fitter.torque_lead_s();
  return stage_metrics(rigid, "rigid");
}

json Pipeline::fit_metrics(const Fitter& fitter, const Estimate& estimate, const json& stages) {
  json metrics = {
      {"schema", "fxdyn.metrics/1"}, {"gate", fitter.gate()},         {"base_parameters", fitter.base().columns.size()},
      {"notes", data().notes},       {"logs", stages.back()["logs"]}, {"stages", stages}};
  metrics["method"] = project_.identify.method;
  metrics["condition_number"] = std::isfinite(estimate.condition) ? json(estimate.condition) : json(nullptr);
  metrics["weak_parameters"] = json::array();
  for (const WeakParameter& one : estimate.weak) {
    metrics["weak_parameters"].push_back(
        {{"parameter", one.name},
         {"share_of_rated", one.error},
         {"joint_to_move", project_.robot.joints[static_cast<std::size_t>(one.joint)].name}});
  }
  const std::vector<Eigen::Index> saturated = fitter.saturated_rows();
  metrics["saturated_rows"] = std::vector<std::int64_t>(saturated.begin(), saturated.end());
  if (estimate.physical) {
    metrics["physical"] = physical_json(project_.robot, to_dh(project_.robot), *estimate.physical);
    write_urdf(project_.urdf, directory_ / "identified.urdf", project_.robot, to_dh(project_.robot),
               estimate.physical->inertia);
  }
  if (estimate.recursion) metrics["recursive"] = recursion_json(*estimate.recursion, project_.identify.forgetting);
  return metrics;
}

void Pipeline::identify() {
  data().notes = data_notes_;
  const auto fitter = fxdyn::identify(project_, data(), progress_);
  progress_.stage("fit, standard deviations, possible bodies", 1);
  Estimate estimate = finish_model(*fitter, project_, data());
  progress_.step();
  IdentifiedModel& model = estimate.model;
  if (const std::string weak = weak_note(estimate.weak, project_.robot); !weak.empty()) model.notes.push_back(weak);
  data().notes = model.notes;
  progress_.stage("errors on all logs", 2);
  json stages = json::array({rigid_metrics(*fitter)});
  progress_.step();
  stages.push_back(stage_metrics(model, "friction"));
  progress_.step();
  progress_.done();
  const json metrics = fit_metrics(*fitter, estimate, stages);
  write_file(directory_ / "model.json", to_json(model).dump(1) + "\n");
  write_file(directory_ / "metrics.json", metrics.dump(1) + "\n");
  for (const std::string& note : data().notes) fmt::print(stderr, "note: {}\n", note);
}

void Pipeline::diagnose() {
  const auto start = Clock::now();
  data().notes = data_notes_;
  std::vector<ProcessedLog> baseline;
  for (Log& log : read_logs(project_, Role::baseline, directory_)) {
    log.role = Role::train;  // what the healthy session is fitted on
    check_torque(log, project_.robot);
    baseline.push_back(process(std::move(log), data().filter));
  }
  const Diagnosis diagnosis = fxdyn::diagnose(project_, data(), baseline, logs(Role::test), progress_);
  IdentifiedModel model = diagnosis.model;
  model.stage = "diagnosed";
  model.notes = data().notes;
  IdentifiedModel nominal = diagnosis.nominal;
  model.logs = nominal.logs = diagnosed_logs();
  progress_.stage("errors on all logs, fixed point, closed loop, plots", 4);
  json stages = json::array({stage_metrics(nominal, "friction")});
  progress_.step();
  stages.push_back(stage_metrics(model, "diagnosed"));
  progress_.step();
  std::vector<ProcessedLog> held_out = logs(Role::test);
  if (held_out.empty()) held_out = logs(Role::validate);
  json report = diagnosis.report;
  report["evidence"] = evidence_json(nominal, model, held_out, diagnosis.still);
  progress_.step();
  const json metrics = {{"schema", "fxdyn.metrics/1"},          {"gate", diagnosis.report.at("gate")},
                        {"base_parameters", model.base.size()}, {"notes", data().notes},
                        {"logs", stages.back()["logs"]},        {"stages", stages}};
  write_file(directory_ / "nominal.json", to_json(nominal).dump(1) + "\n");
  write_file(directory_ / "metrics.json", metrics.dump(1) + "\n");
  write_file(directory_ / "diagnosis.json", report.dump(1) + "\n");
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

void Pipeline::train() {
  const TrainSettings& settings = project_.train;
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
  json stages = json::array();
  if (const fs::path file = directory_ / "metrics.json"; fs::exists(file)) {
    const json before = json::parse(read_file(file));
    for (const json& stage : before.at("stages")) {
      if (stage.at("stage") == "friction" || stage.at("stage") == "diagnosed") stages.push_back(stage);
    }
  }
  data().notes = diagnosed.notes;
  if (const std::string note = unused_settings(settings); !note.empty()) {
    if (std::find(data().notes.begin(), data().notes.end(), note) == data().notes.end()) data().notes.push_back(note);
  }
  const KeptEffects kept(diagnosed, data().logs);
  kept.mark_hidden(data().logs);
  progress_.stage("building the regressor", 1);
  Fitter fitter(project_.robot, data().logs, kept.design());
  fitter.set_torque_lead(diagnosed.filter.torque_lead_s);
  weigh(fitter, project_.identify);
  progress_.step();
  const json rigid = rigid_metrics(fitter);
  // The kept effects, and the load that a BLS sees, follow the rigid body that is fitted beside them.
  const auto follow = [&](const IdentifiedModel& model) {
    if (settings.enabled && settings.inputs == ExtendedInputs::name)
      fitter.set_structural(structural_torque(model, data().logs));
    fitter.set_torque_lead(diagnosed.filter.torque_lead_s, kept.torque(model, data().logs));
    weigh(fitter, project_.identify);
  };
  follow(diagnosed);
  json training = json::array();
  if (settings.enabled) {
    // The model holds the hashes of project and logs: all that the outcome depends on.
    resume.identity = hash_of(to_json(diagnosed).dump());
    // Where the model is the outcome already, a run was stopped between writing it and removing the search.
    if (settings.pso && diagnosed.stage == "trained") resume.drop_finished();
    const auto outcomes = fxdyn::train(fitter, settings, progress_, resume);
    for (std::size_t j = 0; j < outcomes.size(); ++j) {
      training.push_back({{"joint", project_.robot.joints[j].name},
                          {"index", j + 1},
                          {"unit", project_.robot.joints[j].torque_unit()},
                          {"held_out_without", outcomes[j].error_without},
                          {"held_out_with", outcomes[j].error_with},
                          {"kept", outcomes[j].kept},
                          {"evaluations", outcomes[j].evaluations},
                          {"choice", choice_json(outcomes[j])}});
    }
  }
  progress_.stage("fit, standard deviations, possible bodies", 2);
  IdentifiedModel fitted = kept.restore(fitter.to_model(fitter.estimate()));
  fitted.filter = diagnosed.filter;
  follow(fitted);
  progress_.step();
  Estimate estimate = finish_model(fitter, project_, data());
  IdentifiedModel& model = estimate.model;
  model = kept.restore(std::move(model));
  progress_.step();
  progress_.stage("errors on all logs", 2);
  json trained = stage_metrics(model, "bls");
  StoredInformation stored = stored_information(fitter);
  progress_.step();
  // A baseline taught the diagnosed model what the train logs alone may not: where validation says so, it stays.
  IdentifiedModel before = diagnosed;
  for (JointFit& joint : before.joints) joint.bls.reset();
  const bool possible = !estimate.physical || !estimate.physical->constrained;
  if (json unchanged = stage_metrics(before, "bls"); possible && gate_error(unchanged) < gate_error(trained)) {
    const std::string note = "training: the diagnosed model stays as it was, a new fit is worse on the validate logs";
    if (std::find(before.notes.begin(), before.notes.end(), note) == before.notes.end()) before.notes.push_back(note);
    data().notes = before.notes;
    model = std::move(before);
    model.drop_tables();  // they are another model's now
    trained = std::move(unchanged);
    // What the train logs tell holds around what this model has from a baseline too.
    fitter.set_designs(kept.design());
    follow(model);
    stored = stored_information(fitter);
    stored.information.recentre(coefficients_of(model, kept.design()));
    for (json& joint : training) joint["kept"] = false;
  }
  model.stage = "trained";
  stages.insert(stages.begin(), rigid);
  stages.push_back(trained);
  progress_.step();
  progress_.done();
  json metrics = fit_metrics(fitter, estimate, stages);
  metrics["training"] = training;
  write_file(directory_ / "metrics.json", metrics.dump(1) + "\n");
  write_file(directory_ / "model.json", to_json(model).dump(1) + "\n");
  write_information(stored, read_model(directory_ / "model.json"), directory_);
  fs::remove(resume.path);  // a search can take hours: not before its outcome is written
  note_seconds(directory_, "train", seconds_since(start));
}

IdentifiedModel Pipeline::model() {
  if (auto model = written({"trained"})) return *std::move(model);
  train();
  return read_model(directory_ / "model.json");
}

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
  progress_.stage("proving ranges and errors, writing tables", 4);
  model.formats = formats;
  model.layout = layout_of(model, formats);
  if (model.lineage.sequence == 0) model.lineage = {FixedModel(model, formats).crc(), 1};
  model.lineage.sequence = std::max(model.lineage.sequence, project_.target.sequence);
  const Proof proof = prove(model, &formats);
  progress_.step();
  const Attained attained = attain(model);
  const Eigen::VectorXd structural = prove_structural(model, attained.structural, tight_enough, proof_boxes);
  progress_.step();
  std::vector<TickStates> states, judged;
  for (const ProcessedLog& log : data().logs) states.push_back(at_ticks(log, model.tick_s));
  judged = states;
  for (std::size_t i = 0; i < states.size(); ++i) judged.push_back(perturbed(states[i], model, 1000 + i));
  judged.push_back(within_limits(model, random_states, 77));
  judged.push_back(creeping(model, formats));
  const QuantisationError clean = quantisation_error(model, formats, states);
  const QuantisationError error = quantisation_error(model, formats, judged);
  progress_.step();
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    if (error.largest[k] > proof.error[k]) {
      throw DataError(fmt::format(
          "joint {} ({}): fixed point is off by {:.3g}, more than the {:.3g} that were proven: please "
          "report this with {}",
          j + 1, model.robot.joints[j].name, error.largest[k], proof.error[k], (directory_ / "model.json").string()));
    }
    const double share = clean.largest[static_cast<Eigen::Index>(j)] / model.joints[j].rated_torque;
    if (!(share <= largest_error)) {
      throw DataError(fmt::format(
          "joint {} ({}): fixed point is off by {:.1g} of rated torque on the logs, more than {:.0g}: narrow the "
          "project's limits to what the robot does",
          j + 1, model.robot.joints[j].name, share, largest_error));
    }
  }
  const auto n = model.joints.size();
  model.tables_crc = write_tables(model, formats, error, proof.error, all_joints(model), directory);
  // Tables of drives that the project no longer asks for would be of another model.
  for (std::size_t j = 0; j < n; ++j) {
    for (const char* name : {"tables.hpp", "tables.bin", "replay.json"})
      fs::remove(directory / fmt::format("joint_{}", j + 1) / name);
  }
  json drives = json::array();
  for (const std::size_t j : project_.target.joints) {
    const fs::path own = directory / fmt::format("joint_{}", j + 1);
    fs::create_directories(own);
    const std::uint32_t crc = write_tables(model, formats, error, proof.error, 1U << j, own);
    drives.push_back({{"index", j + 1}, {"tables_crc", crc}, {"table_bytes", fs::file_size(own / "tables.bin")}});
  }
  json joints = json::array();
  for (std::size_t j = 0; j < n; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    joints.push_back({{"joint", model.robot.joints[j].name},
                      {"index", j + 1},
                      {"unit", model.robot.joints[j].torque_unit()},
                      {"rated_torque", model.joints[j].rated_torque},
                      {"formats", formats_json(formats)},
                      {"proven_bound", proof.error[k]},
                      {"proven_bound_of_rated", proof.error[k] / model.joints[j].rated_torque},
                      {"observed_max", error.largest[k]},
                      {"observed_max_of_rated", error.largest[k] / model.joints[j].rated_torque},
                      {"quantisation_rms", error.rms[k]},
                      {"torque_range",
                       {{"proven", std::min(proof.torque[k], structural[k] + proof.effects[k])},
                        {"proven_structural", structural[k]},
                        {"attained", attained.total[k]},
                        {"attained_structural", attained.structural[k]}}}});
  }
  const json document = {{"schema", "fxdyn.export/1"},
                         {"tick_s", model.tick_s},
                         {"board", project_.target.board},
                         {"tables_crc", model.tables_crc},
                         {"origin", model.lineage.origin},
                         {"sequence", model.lineage.sequence},
                         {"formats", formats_json(formats)},
                         {"joints", joints},
                         {"drives", drives},
                         {"saturations_on_logs", clean.saturations},
                         {"table_bytes", fs::file_size(directory / "tables.bin")}};
  write_file(directory / "export.json", document.dump(1) + "\n");
  progress_.step();
  progress_.done();
}

void Pipeline::report() {
  // A diagnosis that training refuses is drawn as it is.
  const auto diagnosed = written({"diagnosed"});
  IdentifiedModel model = diagnosed && not_excited() ? *diagnosed : this->model();
  if (model.stage == "trained" && (!model.formats || !fs::exists(directory_ / "export.json"))) {
    export_tables();
    model = this->model();
  }
  progress_.stage("drawing the report", 1);
  std::vector<ProcessedLog> shown = logs(Role::test);
  if (shown.empty()) shown = logs(Role::validate);
  if (shown.empty()) shown = logs(Role::train);
  write_report(model, shown, directory_);
  progress_.step();
  progress_.done();
}

void Pipeline::run() {
  fs::create_directories(directory_);  // fails now rather than after the work
  check_motion();
  diagnose();
  train();
  export_tables();
  report();
}

Log read_log_for(const IdentifiedModel& model, const fs::path& file, std::optional<double> from_s,
                 std::optional<double> to_s, bool torque_required) {
  std::vector<bool> revolute;
  for (const Joint& joint : model.robot.joints) revolute.push_back(joint.type == JointType::revolute);
  for (const std::string& name : {file.filename().string(), std::string()}) {
    if (const auto found = model.log_formats.find(name); found != model.log_formats.end())
      return read_log(file, model.robot.size(), revolute, found->second, from_s, to_s, torque_required);
  }
  throw InputError(fmt::format(
      "{}: the project's logs have different columns or gains, and this one is none of them; name it like one",
      file.string()));
}

void identify_payload(const fs::path& model_file, const fs::path& log_file, const fs::path& directory) {
  IdentifiedModel model = read_model(model_file);
  std::error_code ignored;
  if (fs::equivalent(directory / "model.json", model_file, ignored)) {
    throw InputError(
        fmt::format("{}: would be overwritten by the model with load; choose another --out", model_file.string()));
  }
  const Log log = read_log_for(model, log_file, {}, {});
  const LoadFit fit = identify_load(model, process(log, model.filter));
  model.body.push_back(fit.effect);
  model.drop_tables();  // they are another model's now
  const json report = load_json(fit, model.robot);
  write_file(directory / "model.json", to_json(model).dump(1) + "\n");
  write_file(directory / "payload.json", report.dump(1) + "\n");
}

void predict_log(const fs::path& model_file, const fs::path& log_file, bool fixed, const fs::path& directory) {
  const IdentifiedModel model = read_model(model_file);
  const Robot& robot = model.robot;
  // The run's own metrics.json must survive.
  if (fs::exists(directory / "model.json")) {
    throw InputError(fmt::format("{}: holds a model and its metrics; choose another --out", directory.string()));
  }
  Log log = read_log_for(model, log_file, {}, {}, false);
  log.role = Role::test;
  const bool resampled = log.resampled;
  const Eigen::VectorXd stamps = std::move(log.stamps);
  const ProcessedLog processed = process(std::move(log), model.filter);

  Eigen::MatrixXd torque;
  if (fixed) {
    if (!model.formats)
      throw InputError(fmt::format("{}: has no fixed-point formats; run `fxdyn export` first", model_file.string()));
    // At the drive's ticks, as the firmware computes; then back to the log's samples.
    const TickStates ticks = at_ticks(processed, model.tick_s, true);
    torque = at_other_times(
        interpolate(predict_fixed(model, *model.formats, ticks, age_of(model, processed)), ticks.t, processed.t),
        model.filter.torque_lead_s / processed.step_s);
  } else {
    torque = predict(model, processed);
  }
  const fs::path out = directory / log_file.filename();
  std::error_code ignored;
  if (fs::equivalent(out, log_file, ignored)) {
    throw InputError(fmt::format("{}: would be overwritten by its prediction; choose another --out", out.string()));
  }
  Log result;
  result.t = resampled ? stamps : processed.t;
  result.tau = resampled ? interpolate(torque, processed.t, stamps) : torque;
  write_log(out, result);
  json logs = json::array();
  if (processed.tau.size() > 0) logs.push_back(metrics_json(processed, robot, judge(processed, torque)));
  write_file(directory / "metrics.json",
             json{{"schema", "fxdyn.metrics/1"}, {"numbers", fixed ? "fixed" : "real"}, {"logs", logs}}.dump(1) + "\n");
}

}  // namespace fxdyn

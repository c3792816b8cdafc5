#include "host_tools/compare/compare.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "host_tools/check/check.hpp"
#include "host_tools/compare/figures.hpp"
#include "host_tools/compare/known_shapes.hpp"
#include "host_tools/compare/mlp.hpp"
#include "host_tools/compare/named_model.hpp"
#include "host_tools/compare/state_bls.hpp"
#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/estimate.hpp"
#include "host_tools/identify/structure.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/readers/truth.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/train/ridge.hpp"
#include "host_tools/train/search.hpp"
#include "host_tools/train/swarm.hpp"
#include "host_tools/train/train.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr Index mlp_nodes = 32;
/// Of one joint's share of the rigid body: the PUMA's (852 for six joints, counted in the generated code) for every
/// robot.
constexpr double rnea_multiplications = 142;

/// A test log and what it is judged against.
struct TestLog {
  ProcessedLog log;
  MatrixXd reference;                    ///< full rate, unfiltered
  std::optional<IdentifiedModel> truth;  ///< of its scenario
};

using Torque = std::function<MatrixXd(const ProcessedLog&)>;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// What the state alone says, one row a sample: x = [q, dq, ddq] (paper Eq. 22).
MatrixXd states(const ProcessedLog& log, std::size_t joint) {
  const MotionRows m = log.joint_motion(static_cast<Index>(joint));
  MatrixXd x(m.q.rows(), 3);
  x << m.q, m.dq, m.ddq;
  return x;
}

/// Methods whose swarms can take long enough to be worth going on with.
constexpr const char* searched[] = {"bls_pso", "bls_pso_friction", "bls_pso_physical"};

class Comparison {
 public:
  /// @param resumable a verb's own: the logs are checked, swarms keep their last generation in `directory`
  Comparison(const Project& project, const fs::path& directory, bool resumable)
      : project_(project), directory_(directory), data_(read_gate_data(project_, directory)), resumable_(resumable) {
    // "named_bls" tells its notes.
    if (resumable) check_before_fit(project_, directory_, data_, facts_of_train_logs(project_, directory_));
    for (const char* name : searched) {
      if (const auto resume = resume_file(name)) resume->check_inputs();
    }
    for (const JointFit& joint : initial_joints(project_, data_)) rated_.push_back(joint.rated_torque);
    for (Log& log : read_logs(project_, Role::test, directory)) {
      const fs::path file = log.file;
      fs::path clean = file;
      clean.replace_extension(".truth.csv");
      TestLog test{process(std::move(log), data_.filter), {}, {}};
      if (fs::exists(clean)) {
        test.reference = read_truth(clean, project_.robot.size(), test.log.from_s, test.log.to_s);
        if (test.reference.rows() != test.log.samples())
          throw InputError(fmt::format("{}: {} samples, its log has {}: simulate again", clean.string(),
                                       test.reference.rows(), test.log.samples()));
        test.truth = read_model(file.parent_path() / "truth.json");
      } else {
        against_truth_ = false;
        test.reference = test.log.tau;
      }
      tests_.push_back(std::move(test));
    }
    if (tests_.empty()) throw DataError("compare: no test log; add a [[log]] with role = \"test\"");
    const auto judges = [](const ProcessedLog& log) { return log.role == Role::validate; };
    if (std::none_of(data_.logs.begin(), data_.logs.end(), judges))
      throw DataError("compare: no validate log; add a [[log]] with role = \"validate\", another trajectory");
    if (!against_truth_) {
      for (TestLog& test : tests_) test.reference = test.log.tau;
    }
  }

  ComparisonResult run(const std::vector<std::string>& methods) {
    const ThreadLimit limit(data_.threads);
    const auto wanted = [&](const char* name) {
      return std::find(methods.begin(), methods.end(), name) != methods.end();
    };
    if (wanted("rigid_ls")) structural("rigid_ls", {}, "ls");
    if (wanted("friction_ls")) structural("friction_ls", coulomb_and_viscous, "wls");
    if (wanted("rls")) structural("rls", coulomb_and_viscous, "rls");
    if (wanted("mlp")) mlp();
    if (wanted("bls_default")) state_bls("bls_default", {}, false);
    if (wanted("bls_pso")) state_bls("bls_pso", {}, true);
    if (wanted("bls_pso_friction")) state_bls("bls_pso_friction", coulomb_and_viscous, true);
    if (wanted("bls_physical")) physical_bls("bls_physical", false);
    if (wanted("bls_pso_physical")) physical_bls("bls_pso_physical", true);
    if (wanted("dahl_stribeck")) structural("dahl_stribeck", dahl_stribeck_friction, "wls");
    if (wanted("lugre")) structural("lugre", lugre_friction, "wls");
    if (wanted("lugre_physical")) of_efficiency("lugre_physical", lugre_of_possible_bodies);
    if (wanted("named")) of_efficiency("named", named_model);
    if (wanted("named_trained")) of_efficiency("named_trained", named_and_trained_model);
    if (wanted("known_shapes")) known_shapes("known_shapes", {0});
    if (wanted("bound")) known_shapes("bound", {1, 2, 3, 4, 5, 6, 7, 8});
    if (wanted("named_bls")) named_bls();
    if (against_truth_ && wanted("oracle")) oracle();
    if (against_truth_ && wanted("noise_floor")) noise_floor();
    progress_.done();
    return {against_truth_, project_hash(project_), made_from(project_, directory_, true), project_.compare.paper,
            methods_};
  }

  /// The outcome is written down.
  void drop_searches() const {
    for (const char* name : searched) {
      if (const auto resume = resume_file(name)) fs::remove(resume->path);
    }
  }

  /// What the first test log shows of the methods that were run.
  ComparedLog shown() const {
    const TestLog& test = tests_.front();
    const ProcessedLog& log = test.log;
    const Index inside = log.last - log.first;
    const auto filtered = [&](const MatrixXd& torque) {
      return MatrixXd(log.filter_columns(torque).middleRows(log.first, inside));
    };
    ComparedLog out;
    out.log = log.name;
    out.robot = &project_.robot;
    out.t = log.t.segment(log.first, inside);
    out.measured = log.tau.middleRows(log.first, inside);
    out.reference = filtered(test.reference);
    out.reference_name = against_truth_ ? "true" : "measured";
    out.torque = torque_;
    out.rated = rated_;
    const auto train =
        std::find_if(data_.logs.begin(), data_.logs.end(), [](const ProcessedLog& l) { return l.role == Role::train; });
    out.train_t = train->t;
    out.train_q = train->q;
    if (test.truth && learned_) {
      out.rigid = filtered(predict(rigid_part(*test.truth), log));
      out.learned_friction = filtered(predict(*learned_, log) - predict(rigid_part(*learned_), log));
    }
    return out;
  }

 private:
  std::optional<ResumeFile> resume_file(const std::string& name) const {
    if (!resumable_) return {};
    std::string inputs = project_hash(project_);
    for (const LogReference& log : data_.references) inputs += log.hash;
    return ResumeFile{directory_ / ("compare." + name + ".pso.json"), hash_of(inputs + name), hash_of(inputs)};
  }

  /// Wall time of a search; that of the last of its runs says nothing.
  static std::optional<double> seconds_of(std::chrono::steady_clock::time_point start, bool went_on) {
    return went_on ? std::nullopt : std::optional(seconds_since(start));
  }

  void stage(const std::string& name) { progress_.stage("compare: " + name, 1); }

  /// Judges a method. @param model where it is one that firmware could have
  void add(const std::string& name, const Torque& torque, double multiplications, std::optional<double> train_s,
           const IdentifiedModel* model) {
    const auto n = static_cast<Index>(project_.robot.size());
    VectorXd square = VectorXd::Zero(n), peak = VectorXd::Zero(n), rough = VectorXd::Zero(n), rough_ref = rough;
    double count = 0, samples = 0, predict_s = 0;
    for (const TestLog& test : tests_) {
      const ProcessedLog& log = test.log;
      const auto start = std::chrono::steady_clock::now();
      const MatrixXd raw = torque(log);
      predict_s += seconds_since(start);
      samples += static_cast<double>(raw.rows());
      const Index inside = log.last - log.first;
      const MatrixXd ours = log.filter_columns(raw).middleRows(log.first, inside),
                     theirs = log.filter_columns(test.reference).middleRows(log.first, inside), error = ours - theirs;
      if (&test == &tests_.front()) torque_[name] = ours;
      square += error.colwise().squaredNorm().transpose();
      peak = peak.cwiseMax(error.cwiseAbs().colwise().maxCoeff().transpose());
      rough += (ours.bottomRows(inside - 1) - ours.topRows(inside - 1)).colwise().squaredNorm().transpose();
      rough_ref += (theirs.bottomRows(inside - 1) - theirs.topRows(inside - 1)).colwise().squaredNorm().transpose();
      count += static_cast<double>(inside);
    }
    MethodResult result;
    result.name = name;
    for (Index j = 0; j < n; ++j) {
      const double value = std::sqrt(square[j] / count), share = 100 * value / rated_[static_cast<std::size_t>(j)];
      result.rmse.push_back(value);
      result.percent_rated.push_back(share);
      result.peak.push_back(peak[j]);
      result.mean_percent_rated += share / static_cast<double>(n);
      result.smoothness += std::sqrt(rough[j] / std::max(rough_ref[j], 1e-300)) / static_cast<double>(n);
    }
    result.macs_per_tick = multiplications;
    result.train_s = train_s;
    result.predict_us = 1e6 * predict_s / std::max(samples, 1.0);
    if (model != nullptr) result.fixed_error = fixed_error(*model);
    methods_.push_back(std::move(result));
    progress_.step();
  }

  std::optional<double> fixed_error(const IdentifiedModel& model) const {
    try {
      const Formats formats = choose_formats(model);
      std::vector<TickStates> states;
      for (const TestLog& test : tests_) states.push_back(at_ticks(test.log, model.tick_s));
      const QuantisationError error = quantisation_error(model, formats, states);
      double worst = 0;
      for (std::size_t j = 0; j < model.joints.size(); ++j)
        worst = std::max(worst, error.largest[static_cast<Index>(j)] / rated_[j]);
      return worst;
    } catch (const DataError&) {
      return {};  // a model that fixed point can't hold is still a method
    }
  }

  static double multiplications(const IdentifiedModel& model) {
    double sum = rnea_multiplications * static_cast<double>(model.joints.size());
    for (const JointFit& joint : model.joints) {
      for (const EffectFit& fit : joint.effects) sum += static_cast<double>(fit.linear.size() + fit.shape.size());
      if (joint.bls) sum += static_cast<double>(fxdyn::multiplications(*joint.bls));
    }
    return sum;
  }

  void add_model(const std::string& name, std::optional<double> train_s) {
    add(
        name, [&](const ProcessedLog& log) { return predict(*last_, log); }, multiplications(*last_), train_s, &*last_);
  }

  void structural(const std::string& name, const std::vector<std::string>& effects, const std::string& method) {
    const auto start = std::chrono::steady_clock::now();
    last_ = identify_structure(project_, data_, effects, method, progress_);
    const double spent = seconds_since(start);
    stage(name);
    add_model(name, spent);
  }

  /// What a structure leaves of a log, filtered and decimated.
  static VectorXd left(const ProcessedLog& log, const MatrixXd& missing, std::size_t joint) {
    return log.decimate(log.filter_columns(missing.col(static_cast<Index>(joint)))).col(0);
  }

  std::vector<MatrixXd> missing(const IdentifiedModel& structure) const {
    std::vector<MatrixXd> out(data_.logs.size());
    parallel_for(out.size(), [&](std::size_t l) { out[l] = data_.logs[l].tau - predict(structure, data_.logs[l]); });
    return out;
  }

  void mlp() {
    const auto start = std::chrono::steady_clock::now();
    const IdentifiedModel structure = identify_structure(project_, data_, coulomb_and_viscous, "wls", progress_);
    stage("mlp");
    const std::vector<MatrixXd> rest = missing(structure);
    const std::size_t n = project_.robot.size();
    std::vector<std::optional<Mlp>> nets(n);
    parallel_for(n, [&](std::size_t j) {
      Examples train, judge;
      for (std::size_t l = 0; l < data_.logs.size(); ++l) {
        const ProcessedLog& log = data_.logs[l];
        Examples& to = log.role == Role::train ? train : judge;
        const MatrixXd x = log.decimate(states(log, j));
        const Index at = to.y.size();
        to.x.conservativeResize(at + x.rows(), x.cols());
        to.x.bottomRows(x.rows()) = x;
        to.y.conservativeResize(at + x.rows());
        to.y.tail(x.rows()) = left(log, rest[l], j);
      }
      nets[j].emplace(train, judge, mlp_nodes, project_.train.seed * 100 + j);
    });
    const double spent = seconds_since(start);
    double macs = multiplications(structure);
    for (const auto& net : nets) macs += static_cast<double>(net->multiplications());
    last_ = structure;
    add(
        "mlp",
        [&](const ProcessedLog& log) {
          MatrixXd torque = predict(structure, log);
          for (std::size_t j = 0; j < n; ++j) torque.col(static_cast<Index>(j)) += (*nets[j])(states(log, j));
          return torque;
        },
        macs, spent, nullptr);
  }

  struct StateFit {
    std::optional<StateBls> net;
    VectorXd weights;
    double judged = 1e300;
  };

  StateFit fit_state(const StateBlsShape& shape, std::size_t j, const std::vector<MatrixXd>& x,
                     const std::vector<VectorXd>& y) const {
    StateFit fit;
    MatrixXd examples;
    for (std::size_t l = 0; l < x.size(); ++l) {
      if (data_.logs[l].role != Role::train) continue;
      examples.conservativeResize(examples.rows() + x[l].rows(), 3);
      examples.bottomRows(x[l].rows()) = x[l];
    }
    fit.net.emplace(shape, examples, project_.train.seed * 100 + j);
    std::optional<Moments> train, judge;
    for (std::size_t l = 0; l < x.size(); ++l) {
      const ProcessedLog& log = data_.logs[l];
      const MatrixXd rows = log.decimate(log.filter_columns(fit.net->columns(x[l])));
      auto& to = log.role == Role::train ? train : judge;
      if (!to) to.emplace(rows.cols());
      to->add(rows, y[l]);
    }
    GrowingRidge ridge(*train, shape.ridge);
    fit.weights = ridge.solve(train->gram.rows());
    fit.judged = judge->mean_square(fit.weights);
    return fit;
  }

  /// The paper's: what a structure leaves, as a function of the state. Without effects that is the rigid body of its
  /// section 3; Eq. 8 has viscous and Coulomb friction in it as well.
  void state_bls(const std::string& name, const std::vector<std::string>& effects, bool by_swarm) {
    const std::size_t n = project_.robot.size();
    const auto start = std::chrono::steady_clock::now();
    const IdentifiedModel structure =
        identify_structure(project_, data_, effects, effects.empty() ? "ls" : "wls", progress_);
    const std::vector<MatrixXd> rest = missing(structure);
    PsoSettings pso;
    pso.particles = 12;
    pso.iterations = 15;
    if (project_.train.pso) pso = *project_.train.pso;
    std::vector<std::vector<MatrixXd>> x(n);
    std::vector<std::vector<VectorXd>> y(n);
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t l = 0; l < data_.logs.size(); ++l) {
        x[j].push_back(states(data_.logs[l], j));
        y[j].push_back(left(data_.logs[l], rest[l], j));
      }
    }
    std::vector<StateBlsShape> shapes(n);
    const auto resume = by_swarm ? resume_file(name) : std::nullopt;
    const bool went_on = resume && fs::exists(resume->path);
    if (by_swarm) {
      VectorXd lower(6), upper(6);
      lower << 1, 1, pso.nodes[0], std::log10(pso.ridge[0]), -1, 0;
      upper << 8, 8, pso.nodes[1], std::log10(pso.ridge[1]), 1, 4;
      std::vector<Swarm> swarms;
      for (std::size_t j = 0; j < n; ++j) {
        SwarmSettings settings;
        settings.particles = pso.particles;
        settings.iterations = pso.iterations;
        settings.stall = pso.stall;
        settings.seed = project_.train.seed * 1000 + j;
        swarms.emplace_back(lower, upper, settings);
      }
      progress_.stage("compare: " + name + ", by particle swarm", n * (static_cast<std::size_t>(pso.iterations) + 1));
      search(
          swarms,
          [&](std::size_t j, const VectorXd& at) { return fit_state(state_bls_shape(at), j, x[j], y[j]).judged; },
          progress_, resume);
      for (std::size_t j = 0; j < n; ++j) shapes[j] = state_bls_shape(swarms[j].best());
    }
    stage(name);
    std::vector<StateFit> fits(n);
    parallel_for(n, [&](std::size_t j) { fits[j] = fit_state(shapes[j], j, x[j], y[j]); });
    const std::optional<double> spent = seconds_of(start, went_on);
    double macs = multiplications(structure);
    for (const StateFit& fit : fits) macs += static_cast<double>(fit.net->multiplications());
    last_ = structure;
    add(
        name,
        [&](const ProcessedLog& log) {
          MatrixXd torque = predict(structure, log);
          for (std::size_t j = 0; j < n; ++j)
            torque.col(static_cast<Index>(j)) += fits[j].net->columns(states(log, j)) * fits[j].weights;
          return torque;
        },
        macs, spent, nullptr);
  }

  void physical_bls(const std::string& name, bool by_swarm) {
    const auto start = std::chrono::steady_clock::now();
    const Project project = with_structure(project_, coulomb_and_viscous, "wls");
    GateData data = data_;
    const auto fitter = identify(project, data, progress_);
    TrainSettings settings = project_.train;
    // The state alone is what the methods above have; this one has memory.
    if (settings.inputs == StateInputs::name) settings.inputs = PhysicalInputs::name;
    if (!by_swarm) settings.pso.reset();
    if (by_swarm && !settings.pso) settings.pso = PsoSettings{.particles = 12, .iterations = 15};
    const auto resume = by_swarm ? resume_file(name) : std::nullopt;
    const bool went_on = resume && fs::exists(resume->path);
    train(*fitter, settings, progress_, resume);
    last_ = learned_ = finish_model(*fitter, project, data).model;
    const std::optional<double> spent = seconds_of(start, went_on);
    stage(name);
    add_model(name, spent);
  }

  void of_efficiency(const std::string& name, IdentifiedModel (*make)(const Project&, GateData, Progress&)) {
    const auto start = std::chrono::steady_clock::now();
    last_ = make(project_, data_, progress_);
    const double spent = seconds_since(start);
    stage(name);
    add_model(name, spent);
  }

  /// Several draws: percent_rated and its mean are root mean squares over them, all else is of the last one.
  void known_shapes(const std::string& name, const std::vector<std::uint64_t>& draws) {
    if (!tests_.front().truth) throw DataError(name + ": no test log comes from a scenario, so no truth is known");
    const auto start = std::chrono::steady_clock::now();
    VectorXd squares = VectorXd::Zero(static_cast<Index>(rated_.size()));
    for (const std::uint64_t draw : draws) {
      if (draw != draws.front()) methods_.pop_back();
      last_ = with_known_shapes(project_, data_, *tests_.front().truth, draw);
      add_model(name, seconds_since(start));
      squares += Eigen::Map<const VectorXd>(methods_.back().percent_rated.data(), squares.size()).cwiseAbs2();
    }
    const VectorXd rms = (squares / static_cast<double>(draws.size())).cwiseSqrt();
    methods_.back().percent_rated.assign(rms.begin(), rms.end());
    methods_.back().mean_percent_rated = rms.mean();
  }

  void named_bls() {
    last_ = Pipeline(project_.file, directory_).model();
    stage("named_bls");
    add_model("named_bls", training_seconds(directory_));
  }

  void oracle() {
    stage("oracle");
    const auto torque = [&](const ProcessedLog& log) {
      const auto test = std::find_if(tests_.begin(), tests_.end(), [&](const TestLog& t) { return &t.log == &log; });
      return predict(*test->truth, log);
    };
    add("oracle", torque, multiplications(*tests_.front().truth), 0, nullptr);
  }

  /// The measurement itself against the truth.
  void noise_floor() {
    stage("noise_floor");
    add(
        "noise_floor", [](const ProcessedLog& log) { return log.tau; }, 0, 0, nullptr);
  }

  Project project_;
  fs::path directory_;
  GateData data_;
  bool resumable_;
  std::vector<double> rated_;  ///< [N*m | N]
  std::vector<TestLog> tests_;
  bool against_truth_ = true;
  std::optional<IdentifiedModel> last_, learned_;
  std::map<std::string, MatrixXd> torque_;  ///< of the first test log, filtered
  Progress progress_;
  std::vector<MethodResult> methods_;
};

}  // namespace

ComparisonResult compare_methods(const Project& project, const fs::path& directory,
                                 const std::vector<std::string>& methods) {
  return Comparison(project, directory, false).run(methods);
}

ComparisonResult compare(const fs::path& project, const fs::path& directory) {
  Comparison comparison(read_project(project), directory, true);
  const ComparisonResult result =
      comparison.run({"rigid_ls", "friction_ls", "rls", "mlp", "bls_default", "bls_pso", "bls_pso_friction",
                      "bls_pso_physical", "dahl_stribeck", "lugre", "named_bls", "oracle", "noise_floor"});
  write_comparison_plots(comparison.shown(), directory);
  write_file(directory / "compare.json", to_json(result).dump(1) + "\n");
  comparison.drop_searches();
  return result;
}

}  // namespace fxdyn

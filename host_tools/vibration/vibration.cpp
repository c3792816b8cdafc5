#include "host_tools/vibration/vibration.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/structure.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/vibration/motor_reference.hpp"
#include "host_tools/vibration/moves.hpp"
#include "model/effects/elasticity.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::array<double, 8> bandwidths{4, 8, 16, 24, 32, 48, 64, 96};  // Hz
/// Less than 0.3 is a loop that rings by itself (about 30 degrees of phase margin): nobody tunes a drive like that.
constexpr std::array<double, 5> dampings{0.3, 0.5, 0.7, 1, 1.4};
constexpr double encoder_step = 2 * std::numbers::pi / (1 << 22);
constexpr double still = 0.25;  ///< of the residual of the PD alone
/// Feedforward "model" at the model's motor_reference().
constexpr const char* elastic = "model_elastic";
constexpr std::uint64_t tuning_moves = 1, judged_moves = 2;

/// What one move comes to.
struct Outcome {
  double motor = 0, link = 0;  ///< mean squares of the error while it moves [rad^2 | m^2]
  double with_rest = 0;        ///< the link's, to the end
  double residual = 0;         ///< [rad | m]
  double settling_s = 0, roughness = 0;
  MatrixXd q;  ///< of the motors
};

/// One row of the result.
struct Method {
  std::string name, numbers, off;          ///< feedforward, computed in, parameters off
  const IdentifiedModel* model = nullptr;  ///< none: PD alone
  bool motor_side = false;                 ///< the motors' reference is the model's, not the links'
};

class Experiment {
 public:
  Experiment(const fs::path& project, const fs::path& directory)
      : pipeline_(project, directory), model_(with_tables()), plant_(scenario_plant()) {}

  /// @param known vibration.json, whose controller it takes
  json with_drive(const json& known, const Feedforward& drive) {
    const json& control = known.at("control");
    ClosedLoopSettings settings = loop(control.at("bandwidth_hz"), control.at("damping"));
    band_ = control.at("settling_band");
    settings.drive = drive.torque;
    std::vector<Method> driven{{"model", "drive", "none", &model_}};
    if (bends(model_)) driven.push_back({elastic, "drive", "none", &model_, true});
    std::vector<Move> moves = make_moves(model_, model_.tick_s, judged_moves);
    const bool all = drive.most_moves == 0 || drive.most_moves >= moves.size();
    if (!all) moves.erase(moves.begin() + static_cast<std::ptrdiff_t>(drive.most_moves), moves.end());
    progress_.stage("vibration: the drive in the loop", moves.size() * driven.size());
    json methods = json::array();
    for (const json& method : known.at("methods")) {
      const std::string name = method.at("feedforward");
      const bool beside = name == "none" || name == "model" || name == elastic;
      if (beside && method.at("parameters_off") == "none") methods.push_back(method);
    }
    for (const Method& method : driven) {
      std::vector<Outcome> outcomes;
      for (const Move& move : moves) {
        const Reference asked = asked_of(method, move);
        drive.begin(asked);
        outcomes.push_back(play(move, asked, {}, settings));
        progress_.step();
      }
      methods.push_back(summary(method, moves, outcomes));
      if (all) add_ratios(methods.back(), known.at("methods"));  // means over the same moves
    }
    progress_.done();
    return {{"schema", "fxdyn.vibration/1"}, {"control", control}, {"methods", methods}};
  }

  json run() {
    tune();
    const std::vector<Move> moves = make_moves(model_, model_.tick_s, judged_moves);
    json methods = json::array();
    const bool bent = bends(model_);
    progress_.stage("vibration: feedforward in the loop", moves.size() * (bent ? 19 : 13));
    const auto add = [&](const std::string& name, const std::string& numbers, const std::string& error,
                         const IdentifiedModel* model) {
      methods.push_back(judge({name, numbers, error, model, name == elastic}, moves));
    };
    GateData data = read_gate_data(pipeline_.project(), pipeline_.directory());
    Progress quiet;
    const IdentifiedModel friction = identify_structure(pipeline_.project(), data, coulomb_and_viscous, "wls", quiet);
    const IdentifiedModel rigid = rigid_part(friction);
    set_band(moves);
    add("none", "-", "none", nullptr);
    add("rigid", "fixed", "none", &rigid);
    add("friction", "fixed", "none", &friction);
    add("model", "fixed", "none", &model_);
    add("model", "real", "none", &model_);
    json numbers = compare_numbers(moves, false);
    if (bent) {
      add(elastic, "fixed", "none", &model_);
      add(elastic, "real", "none", &model_);
      numbers[elastic] = compare_numbers(moves, true);
    }
    for (const double factor : {0.8, 1.2}) {
      const std::string error = factor < 1 ? "-20 %" : "+20 %";
      for (const auto& [name, model] :
           {std::pair("rigid", &rigid), std::pair("friction", &friction), std::pair("model", &std::as_const(model_))}) {
        const IdentifiedModel wrong = scaled(*model, [&] { return factor; });
        add(name, "fixed", error, &wrong);
        if (model == &model_ && bent) add(elastic, "fixed", error, &wrong);
      }
    }
    Random random(5);
    const IdentifiedModel mixed = scaled(model_, [&] { return random.uniform() < 0.5 ? 0.8 : 1.2; });
    add("model", "fixed", "+-20 %", &mixed);
    if (bent) add(elastic, "fixed", "+-20 %", &mixed);
    progress_.done();
    for (json& method : methods) add_ratios(method, json(methods));
    return {{"schema", "fxdyn.vibration/1"},
            {"project_hash", model_.project_hash},
            {"made_from", made_from(pipeline_.project(), pipeline_.directory(), true)},
            {"control", control_json()},
            {"methods", methods},
            {"fixed_against_double", numbers}};
  }

 private:
  json control_json() const {
    return {{"bandwidth_hz", settings_.bandwidth_hz},
            {"damping", settings_.damping},
            {"tick_s", model_.tick_s},
            {"encoder_step", encoder_step},
            {"settling_band", band_},
            {"grid", {{"bandwidth_hz", bandwidths}, {"damping", dampings}}}};
  }

  static ClosedLoopSettings loop(double bandwidth_hz, double damping) {
    ClosedLoopSettings s;
    s.bandwidth_hz = bandwidth_hz;
    s.damping = damping;
    s.substeps = 1;
    s.encoder_step = encoder_step;
    return s;
  }

  void set_band(const std::vector<Move>& moves) {
    for (const Move& move : moves) band_ = std::max(band_, still * play(move, move.reference, {}, settings_).residual);
  }

  IdentifiedModel with_tables() {
    IdentifiedModel model = pipeline_.model();
    if (model.formats) return model;
    pipeline_.export_tables();
    return pipeline_.model();
  }

  IdentifiedModel scenario_plant() const {
    for (const LogEntry& entry : pipeline_.project().logs) {
      if (entry.role != Role::train || !entry.scenario) continue;
      IdentifiedModel plant = read_scenario(*entry.scenario).plant;
      const bool bends = std::any_of(plant.joints.begin(), plant.joints.end(),
                                     [](const JointFit& joint) { return joint.find(Elasticity::name) != nullptr; });
      if (!bends)
        fmt::print(stderr, "note: no gear of {} bends (effect \"elasticity\"): there is little to vibrate\n",
                   entry.scenario->string());
      return plant;
    }
    throw InputError(fmt::format("{}: vibration needs a robot to move: a train log with scenario = \"x.toml\"",
                                 pipeline_.project().file.string()));
  }

  static Reference asked_of(const Method& method, const Move& move) {
    return method.motor_side ? motor_reference(*method.model, move.reference) : move.reference;
  }

  /// @param reference what the motors get; the links have to be where the move has them
  Outcome play(const Move& move, Reference reference, MatrixXd feedforward, const ClosedLoopSettings& settings) const {
    reference.feedforward = std::move(feedforward);
    const PlantRun run = closed_loop_on_mujoco(plant_, reference, settings);
    const MatrixXd link = run.q - run.deflections;
    const Index n = run.q.cols(), moving = move.stop - move.start, after = run.q.rows() - move.stop;
    Outcome out;
    const auto mean_square = [](const MatrixXd& m) { return m.squaredNorm() / static_cast<double>(m.size()); };
    out.motor = mean_square((run.q - reference.q).middleRows(move.start, moving));
    const MatrixXd error = link - move.reference.q;
    out.link = mean_square(error.middleRows(move.start, moving));
    out.with_rest = mean_square(error.bottomRows(error.rows() - move.start));
    // its place at the end: the mean over the last tenth of a second
    const auto last = static_cast<Index>(std::lround(0.1 / run.step_s));
    const Eigen::RowVectorXd end = link.bottomRows(last).colwise().mean();
    const MatrixXd off = (link.bottomRows(after).rowwise() - end).cwiseAbs();
    out.residual = off.colwise().maxCoeff().mean();
    for (Index k = 0; k < after; ++k) {
      if (off.row(k).maxCoeff() > band_) out.settling_s = run.step_s * static_cast<double>(k + 1);
    }
    for (Index j = 0; j < n; ++j) {
      const VectorXd torque = run.tau.col(j).segment(move.start, moving);
      const VectorXd change = torque.tail(moving - 1) - torque.head(moving - 1);
      out.roughness += std::sqrt(change.squaredNorm() / static_cast<double>(moving - 1)) /
                       plant_.joints[static_cast<std::size_t>(j)].rated_torque / static_cast<double>(n);
    }
    out.q = run.q;
    return out;
  }

  void tune() {
    const std::vector<Move> moves = make_moves(model_, model_.tick_s, tuning_moves, 1);
    progress_.stage("vibration: tuning the PD", bandwidths.size() * dampings.size());
    std::vector<double> cost(bandwidths.size() * dampings.size());
    const auto settings = [&](std::size_t i) {
      return loop(bandwidths[i / dampings.size()], dampings[i % dampings.size()]);
    };
    parallel_for(cost.size(), [&](std::size_t i) {
      try {
        for (const Move& move : moves) cost[i] += play(move, move.reference, {}, settings(i)).with_rest;
      } catch (const RunsAway&) {
        cost[i] = 1e300;
      }
      progress_.step();
    });
    const auto best = std::min_element(cost.begin(), cost.end());
    if (*best >= 1e300) throw DataError("vibration: no PD of the grid holds this robot");
    settings_ = settings(static_cast<std::size_t>(best - cost.begin()));
  }

  /// Every linear parameter, of the rigid body and the effects, times what `factor` says.
  template <class Factor>
  static IdentifiedModel scaled(IdentifiedModel model, Factor factor) {
    for (LinkInertia<Real>& link : model.inertia) {
      for (double* value :
           {&link.m, &link.h.x, &link.h.y, &link.h.z, &link.xx, &link.yy, &link.zz, &link.xy, &link.xz, &link.yz})
        *value *= factor();
    }
    for (JointFit& joint : model.joints) {
      for (EffectFit& fit : joint.effects) {
        for (double& value : fit.linear) value *= factor();
      }
      if (joint.bls) joint.bls->coefficients *= factor();
    }
    return model;
  }

  MatrixXd feedforward(const IdentifiedModel& model, const std::string& numbers, const Reference& r) const {
    if (numbers == "real") return predict(unlimited(model), r.q, r.dq, r.ddq, r.step_s);
    TickStates states{"", VectorXd(), r.q, r.dq, r.ddq};
    states.t = VectorXd::LinSpaced(r.q.rows(), 0, r.step_s * static_cast<double>(r.q.rows() - 1));
    return predict_fixed(model, model.formats ? *model.formats : choose_formats(model), states);
  }

  json judge(const Method& method, const std::vector<Move>& moves) {
    std::vector<Outcome> outcomes(moves.size());
    parallel_for(moves.size(), [&](std::size_t i) {
      const Reference asked = asked_of(method, moves[i]);
      outcomes[i] =
          play(moves[i], asked,
               method.model == nullptr ? MatrixXd() : feedforward(*method.model, method.numbers, asked), settings_);
      progress_.step();
    });
    return summary(method, moves, outcomes);
  }

  static json summary(const Method& method, const std::vector<Move>& moves, const std::vector<Outcome>& outcomes) {
    json kinds = json::object();
    const auto mean = [&](const std::string& kind) {
      Outcome sum;
      double count = 0;
      for (std::size_t i = 0; i < moves.size(); ++i) {
        if (kind != "all" && moves[i].kind != kind) continue;
        ++count;
        sum.motor += outcomes[i].motor;
        sum.link += outcomes[i].link;
        sum.residual += outcomes[i].residual;
        sum.settling_s += outcomes[i].settling_s;
        sum.roughness += outcomes[i].roughness;
      }
      return json{{"tracking_motor", 1e3 * std::sqrt(sum.motor / count)},
                  {"tracking_link", 1e3 * std::sqrt(sum.link / count)},
                  {"residual", 1e3 * sum.residual / count},
                  {"settling_s", sum.settling_s / count},
                  {"roughness", sum.roughness / count}};
    };
    kinds["all"] = mean("all");
    for (const Move& move : moves) {
      if (!kinds.contains(move.kind)) kinds[move.kind] = mean(move.kind);
    }
    return {{"feedforward", method.name},
            {"numbers", method.numbers},
            {"parameters_off", method.off},
            {"reference", method.motor_side ? "motor" : "link"},
            {"moves", kinds}};
  }

  /// Over all moves, against the PD alone and the rigid body.
  static void add_ratios(json& method, const json& methods) {
    for (const json& other : methods) {
      const std::string name = other.at("feedforward");
      if ((name != "none" && name != "rigid") || other.at("parameters_off") != "none") continue;
      for (const char* key : {"tracking_motor", "tracking_link", "residual", "settling_s", "roughness"}) {
        const double base = other.at("moves").at("all").at(key);
        if (base > 0) method["ratios"][name][key] = method.at("moves").at("all").at(key).get<double>() / base;
      }
    }
  }

  /// Of the motors' remaining error (RMS, double in the loop): how much it is another in fixed point, and how far both
  /// paths are apart. Exact encoders: the steps of real ones part any two runs that differ at all.
  json compare_numbers(const std::vector<Move>& moves, bool motor_side) {
    ClosedLoopSettings exact = settings_;
    exact.encoder_step = 0;
    VectorXd error(moves.size()), fixed(moves.size()), apart(moves.size());
    parallel_for(moves.size(), [&](std::size_t i) {
      const Reference asked = asked_of({"", "", "", &model_, motor_side}, moves[i]);
      const MatrixXd real = play(moves[i], asked, feedforward(model_, "real", asked), exact).q;
      const MatrixXd rounded = play(moves[i], asked, feedforward(model_, "fixed", asked), exact).q;
      const auto k = static_cast<Index>(i);
      error[k] = (real - asked.q).squaredNorm();
      fixed[k] = (rounded - asked.q).squaredNorm();
      apart[k] = (rounded - real).squaredNorm();
      progress_.step();
    });
    return {{"error_change", std::fabs(std::sqrt(fixed.sum() / error.sum()) - 1)},
            {"path_difference", std::sqrt(apart.sum() / error.sum())}};
  }

  Pipeline pipeline_;
  IdentifiedModel model_, plant_;
  ClosedLoopSettings settings_;
  double band_ = 0;  ///< within which a link counts as still [rad | m]
  Progress progress_;
};

}  // namespace

json vibration(const fs::path& project, const fs::path& directory) {
  const json result = Experiment(project, directory).run();
  write_file(directory / "vibration.json", result.dump(1) + "\n");
  return result;
}

json vibration_with(const fs::path& project, const fs::path& directory, const Feedforward& drive) {
  const fs::path file = directory / "vibration.json";
  json known = fs::exists(file) ? json::parse(read_file(file)) : json();
  if (known.is_null() || !is_unchanged(known.value("made_from", json()), directory))
    known = vibration(project, directory);
  return Experiment(project, directory).with_drive(known, drive);
}

std::string vibration_table(const json& result) {
  const json& control = result.at("control");
  std::string out = fmt::format("PD of {:.3g} Hz, damping {:.2g} (best alone), tick {:.3g} ms; means over all moves\n",
                                control.at("bandwidth_hz").get<double>(), control.at("damping").get<double>(),
                                1e3 * control.at("tick_s").get<double>());
  out += fmt::format("{:<13} {:<6} {:<7} {:>10} {:>10} {:>9} {:>10} {:>9} | {}\n", "feedforward", "as", "off",
                     "motor mrad", "link mrad", "residual", "settling s", "roughness",
                     "of PD alone: motor, link, residual; of rigid: motor, link");
  for (const json& method : result.at("methods")) {
    const json& all = method.at("moves").at("all");
    const auto value = [&](const char* key) { return all.at(key).get<double>(); };
    const auto ratio = [&](const char* base, const char* key) {
      const json::json_pointer at(fmt::format("/ratios/{}/{}", base, key));
      return method.contains(at) ? fmt::format(" {:>6.3f}", method.at(at).get<double>()) : "      -";
    };
    out += fmt::format("{:<13} {:<6} {:<7} {:>10.4g} {:>10.4g} {:>9.3g} {:>10.3f} {:>9.2g} |{}{}{} {}{}\n",
                       method.at("feedforward").get<std::string>(), method.at("numbers").get<std::string>(),
                       method.at("parameters_off").get<std::string>(), value("tracking_motor"), value("tracking_link"),
                       value("residual"), value("settling_s"), value("roughness"), ratio("none", "tracking_motor"),
                       ratio("none", "tracking_link"), ratio("none", "residual"), ratio("rigid", "tracking_motor"),
                       ratio("rigid", "tracking_link"));
  }
  if (!result.contains("fixed_against_double")) return out;
  const json& numbers = result.at("fixed_against_double");
  out += fmt::format(
      "fixed point against double in the loop, of the remaining error: {:.2g} more or less, paths {:.2g} apart\n",
      numbers.at("error_change").get<double>(), numbers.at("path_difference").get<double>());
  return out;
}

}  // namespace fxdyn

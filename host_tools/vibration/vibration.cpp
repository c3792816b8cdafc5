#include "host_tools/vibration/vibration.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/identify/structure.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/report/vibration_result.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/simulate/scenario.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"
#include "host_tools/vibration/motor_reference.hpp"
#include "host_tools/vibration/moves.hpp"
#include "host_tools/vibration/outcome.hpp"
#include "host_tools/vibration/shaper.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr double encoder_step = 2 * std::numbers::pi / (1 << 22);
/// Feedforward "model" at the model's motor_reference(), and the same of a path that is shaped.
constexpr const char* elastic = "model_elastic";
constexpr const char* elastic_shaped = "model_elastic_shaped";
constexpr std::uint64_t tuning_moves = 1, judged_moves = 2;

/// The links' path: as the move has it, shaped, or in the time that the shaped one takes.
enum class Path { asked, shaped, slower };

/// One row of the result.
struct Method {
  std::string name, numbers = "-", off = "none";  ///< feedforward, computed in, parameters off
  const IdentifiedModel* model = nullptr;         ///< none: PD alone
  bool motor_side = false;                        ///< the motors' reference is the model's, not the links'
  Path path = Path::asked;
  const IdentifiedModel* shaper = nullptr;  ///< whose modes it is shaped by
};

/// A move as a method has it.
struct Plan {
  Move move;
  Reference asked;  ///< of the motors
  double delay_s = 0;
  double cut_short = 0;  ///< of the path [rad | m]
};

class Experiment {
 public:
  Experiment(const fs::path& project, const fs::path& directory, const VibrationOptions& options)
      : pipeline_(project, directory), options_(options), model_(with_tables()), plant_(scenario_plant()) {}

  /// @param known of the host alone, whose controller and encoders it takes
  VibrationResult with_drive(const VibrationResult& known, const Feedforward& drive) {
    const VibrationControl& control = known.control;
    settings_ = loop(control.bandwidth_hz, control.damping);
    settings_.encoder_step = control.encoder_step;
    instants_ = {control.settling_band, control.late_s};
    ClosedLoopSettings settings = settings_;
    settings.drive = drive.torque;
    std::vector<Method> driven{{.name = "model", .numbers = "drive", .model = &model_}};
    if (bends(model_)) {
      driven.push_back({.name = elastic, .numbers = "drive", .model = &model_, .motor_side = true});
      driven.push_back(shaped_row("drive", "none", model_));
    }
    std::vector<Move> moves = make_moves(model_, model_.tick_s, judged_moves);
    const bool all = drive.most_moves == 0 || drive.most_moves >= moves.size();
    if (!all) moves.erase(moves.begin() + static_cast<std::ptrdiff_t>(drive.most_moves), moves.end());
    progress_.stage("vibration: the drive in the loop", moves.size() * (all ? driven.size() : 1 + 3 * driven.size()));
    std::vector<VibrationMethod> methods = all ? host_rows(known, driven) : on_host(driven, moves);
    for (const Method& method : driven) {
      std::vector<Plan> plans;
      std::vector<Outcome> outcomes;
      for (const Move& move : moves) {
        plans.push_back(plan(method, move));
        drive.begin(plans.back().asked);
        outcomes.push_back(play(plans.back(), {}, settings));
        progress_.step();
      }
      methods.push_back(row(method, moves, plans, outcomes));
      if (all) add_ratios(methods.back(), known.methods);  // means over the same moves
    }
    progress_.done();
    return {{}, {}, control, methods, {}};
  }

  VibrationResult run() {
    tune();
    const std::vector<Move> moves = make_moves(model_, model_.tick_s, judged_moves);
    const bool bent = bends(model_);
    GateData data = read_gate_data(pipeline_.project(), pipeline_.directory());
    const ThreadLimit limit(data.threads);
    Progress quiet;
    const IdentifiedModel friction = identify_structure(pipeline_.project(), data, coulomb_and_viscous, "wls", quiet);
    const IdentifiedModel rigid = rigid_part(friction);
    std::vector<Wrong> wrong;
    for (const double factor : {0.8, 1.2}) {
      const auto all = [&] { return factor; };
      wrong.push_back({factor < 1 ? "-20 %" : "+20 %", scaled(model_, all), scaled(rigid, all), scaled(friction, all)});
    }
    Random random(5);
    wrong.push_back({"+-20 %", scaled(model_, [&] { return random.uniform() < 0.5 ? 0.8 : 1.2; }), {}, {}});
    const std::vector<Method> rows = methods(rigid, friction, wrong, bent);
    set_instants(rows, moves);
    progress_.stage("vibration: feedforward in the loop", moves.size() * (rows.size() + (bent ? 3 : 1)));
    std::vector<VibrationMethod> result;
    for (const Method& method : rows) result.push_back(judge(method, moves));
    std::vector<Method> compared{{.name = "model", .model = &model_}};
    if (bent) {
      compared.push_back(elastic_row("real", "none", model_));
      compared.push_back(shaped_row("real", "none", model_));
    }
    std::map<std::string, NumbersCompared> numbers;
    for (const Method& method : compared) numbers[method.name] = compare_numbers(moves, method);
    progress_.done();
    for (VibrationMethod& method : result) add_ratios(method, result);
    return {model_.project_hash, made_from(pipeline_.project(), pipeline_.directory(), true), control(), result,
            numbers};
  }

 private:
  /// What is known of the PD alone and of what a drive has, over all moves.
  static std::vector<VibrationMethod> host_rows(const VibrationResult& known, const std::vector<Method>& driven) {
    std::vector<VibrationMethod> rows;
    for (const VibrationMethod& method : known.methods) {
      const std::string& name = method.feedforward;
      const bool beside = name == "none" || std::any_of(driven.begin(), driven.end(),
                                                        [&](const Method& other) { return other.name == name; });
      if (beside && method.is_exact()) rows.push_back(method);
    }
    return rows;
  }

  /// The same over some moves alone: what is known are means over all of them.
  std::vector<VibrationMethod> on_host(const std::vector<Method>& driven, const std::vector<Move>& moves) {
    std::vector<VibrationMethod> rows{judge({.name = "none"}, moves)};
    for (const char* numbers : {"fixed", "real"}) {
      for (Method method : driven) {
        method.numbers = numbers;
        rows.push_back(judge(method, moves));
      }
    }
    return rows;
  }

  /// The models with their parameters off.
  struct Wrong {
    std::string off;
    IdentifiedModel model, rigid, friction;
  };

  static Method elastic_row(const std::string& numbers, const std::string& off, const IdentifiedModel& model) {
    return {.name = elastic, .numbers = numbers, .off = off, .model = &model, .motor_side = true};
  }
  static Method shaped_row(const std::string& numbers, const std::string& off, const IdentifiedModel& model) {
    Method method = elastic_row(numbers, off, model);
    method.name = elastic_shaped;
    method.path = Path::shaped;
    method.shaper = &model;
    return method;
  }

  std::vector<Method> methods(const IdentifiedModel& rigid, const IdentifiedModel& friction,
                              const std::vector<Wrong>& wrong, bool bent) const {
    std::vector<Method> rows{{.name = "none"},
                             {.name = "rigid", .numbers = "fixed", .model = &rigid},
                             {.name = "friction", .numbers = "fixed", .model = &friction},
                             {.name = "model", .numbers = "fixed", .model = &model_},
                             {.name = "model", .numbers = "real", .model = &model_}};
    if (bent) {
      rows.push_back(elastic_row("fixed", "none", model_));
      rows.push_back(elastic_row("real", "none", model_));
      rows.push_back(shaped_row("fixed", "none", model_));
      rows.push_back(shaped_row("real", "none", model_));
      // what shaping alone and the longer time alone are worth
      rows.push_back({.name = "none_shaped", .path = Path::shaped, .shaper = &model_});
      rows.push_back({.name = "none_slower", .path = Path::slower, .shaper = &model_});
      rows.push_back(elastic_row("fixed", "none", model_));
      rows.back().name = "model_elastic_slower";
      rows.back().path = Path::slower;
      rows.back().shaper = &model_;
    }
    for (const Wrong& w : wrong) {
      if (!w.rigid.joints.empty()) {
        rows.push_back({.name = "rigid", .numbers = "fixed", .off = w.off, .model = &w.rigid});
        rows.push_back({.name = "friction", .numbers = "fixed", .off = w.off, .model = &w.friction});
      }
      rows.push_back({.name = "model", .numbers = "fixed", .off = w.off, .model = &w.model});
      if (!bent) continue;
      rows.push_back(elastic_row("fixed", w.off, w.model));
      rows.push_back(shaped_row("fixed", w.off, w.model));
    }
    return rows;
  }

  VibrationControl control() const {
    return {settings_.bandwidth_hz, settings_.damping, model_.tick_s,          encoder_step,
            instants_.band,         instants_.late_s,  options_.bandwidths_hz, options_.dampings};
  }

  static ClosedLoopSettings loop(double bandwidth_hz, double damping) {
    ClosedLoopSettings s;
    s.bandwidth_hz = bandwidth_hz;
    s.damping = damping;
    s.substeps = 1;
    s.encoder_step = encoder_step;
    return s;
  }

  /// Of all rows: the band by the PD alone, the late instant by the slowest shaper.
  void set_instants(const std::vector<Method>& rows, const std::vector<Move>& moves) {
    std::vector<double> residual(moves.size()), delay(moves.size());
    parallel_for(moves.size(), [&](std::size_t i) {
      residual[i] = play(plan({}, moves[i]), {}, settings_).residual;
      for (const Method& method : rows) delay[i] = std::max(delay[i], plan(method, moves[i]).delay_s);
    });
    instants_ = {options_.still * *std::max_element(residual.begin(), residual.end()),
                 *std::max_element(delay.begin(), delay.end())};
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
                                     [](const JointFit& joint) { return compliance_of(joint) != nullptr; });
      if (!bends)
        fmt::print(stderr, "note: no gear of {} bends (effect \"elasticity\"): there is little to vibrate\n",
                   entry.scenario->string());
      return plant;
    }
    throw InputError(fmt::format("{}: vibration needs a robot to move: a train log with scenario = \"x.toml\"",
                                 pipeline_.project().file.string()));
  }

  /// For the modes of `model` under this controller.
  Shaper shaper(const IdentifiedModel& model, const Reference& path) const {
    const MotorLoop motors = motor_loop(model, path.q.row(0), settings_.bandwidth_hz, settings_.damping);
    const ShaperSettings wanted;
    return design_shaper(bands_along(model, path, motors, wanted.margin), path.step_s, wanted.tolerance);
  }

  Plan plan(const Method& method, const Move& move) const {
    Plan plan{move, {}};
    if (method.path != Path::asked) {
      const Shaper by = shaper(*method.shaper, move.reference);
      plan.move = method.path == Path::shaped ? shaped(move, by) : slower(move, by.delay());
      plan.delay_s = by.delay_s();
      plan.cut_short = cut_short(move.reference, plan.move.reference);
    }
    plan.asked = method.motor_side ? motor_reference(*method.model, plan.move.reference) : plan.move.reference;
    return plan;
  }

  PlantRun run_plant(const Reference& asked, MatrixXd feedforward, const ClosedLoopSettings& settings) const {
    Reference reference = asked;
    reference.feedforward = std::move(feedforward);
    return closed_loop_on_mujoco(plant_, reference, settings);
  }
  Outcome play(const Plan& plan, MatrixXd feedforward, const ClosedLoopSettings& settings) const {
    return outcome_of(run_plant(plan.asked, std::move(feedforward), settings), plan.move, plan.asked, plant_,
                      instants_);
  }

  void tune() {
    const std::vector<double>&bandwidths = options_.bandwidths_hz, &dampings = options_.dampings;
    const std::vector<Move> moves = make_moves(model_, model_.tick_s, tuning_moves, 1);
    progress_.stage("vibration: tuning the PD", bandwidths.size() * dampings.size());
    std::vector<double> cost(bandwidths.size() * dampings.size());
    const auto settings = [&](std::size_t i) {
      return loop(bandwidths[i / dampings.size()], dampings[i % dampings.size()]);
    };
    parallel_for(cost.size(), [&](std::size_t i) {
      try {
        for (const Move& move : moves) cost[i] += play(plan({}, move), {}, settings(i)).with_rest;
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

  VibrationMethod judge(const Method& method, const std::vector<Move>& moves) {
    std::vector<Plan> plans(moves.size());
    std::vector<Outcome> outcomes(moves.size());
    parallel_for(moves.size(), [&](std::size_t i) {
      plans[i] = plan(method, moves[i]);
      outcomes[i] = play(
          plans[i], method.model == nullptr ? MatrixXd() : feedforward(*method.model, method.numbers, plans[i].asked),
          settings_);
      progress_.step();
    });
    return row(method, moves, plans, outcomes);
  }

  static VibrationMethod row(const Method& method, const std::vector<Move>& moves, const std::vector<Plan>& plans,
                             const std::vector<Outcome>& outcomes) {
    VibrationMethod out{method.name, method.numbers, method.off, method.motor_side, {}, {}, {}};
    set_means(out, moves, outcomes);
    if (method.path == Path::asked) return out;
    out.path = {method.path == Path::shaped ? "shaped" : "slower", {}, 0};
    for (const Plan& plan : plans) {
      out.path->delay_s.push_back(plan.delay_s);
      out.path->cut_short = std::max(out.path->cut_short, 1e3 * plan.cut_short);
    }
    return out;
  }

  /// Of the motors' remaining error (RMS, double in the loop): how much it is another in fixed point, and how far both
  /// paths are apart. Exact encoders: the steps of real ones part any two runs that differ at all.
  NumbersCompared compare_numbers(const std::vector<Move>& moves, const Method& method) {
    ClosedLoopSettings exact = settings_;
    exact.encoder_step = 0;
    VectorXd error(moves.size()), fixed(moves.size()), apart(moves.size());
    parallel_for(moves.size(), [&](std::size_t i) {
      const Reference asked = plan(method, moves[i]).asked;
      const MatrixXd real = run_plant(asked, feedforward(model_, "real", asked), exact).q;
      const MatrixXd rounded = run_plant(asked, feedforward(model_, "fixed", asked), exact).q;
      const auto k = static_cast<Index>(i);
      error[k] = (real - asked.q).squaredNorm();
      fixed[k] = (rounded - asked.q).squaredNorm();
      apart[k] = (rounded - real).squaredNorm();
      progress_.step();
    });
    return {std::fabs(std::sqrt(fixed.sum() / error.sum()) - 1), std::sqrt(apart.sum() / error.sum())};
  }

  Pipeline pipeline_;
  VibrationOptions options_;
  IdentifiedModel model_, plant_;
  ClosedLoopSettings settings_;
  Instants instants_;
  Progress progress_;
};

}  // namespace

VibrationResult vibration(const fs::path& project, const fs::path& directory, const VibrationOptions& options) {
  VibrationResult result = Experiment(project, directory, options).run();
  write_file(directory / "vibration.json", to_json(result).dump(1) + "\n");
  return result;
}

namespace {

/// What `vibration` found before, if that is of the files that are there now.
std::optional<VibrationResult> known_result(const fs::path& directory) {
  const fs::path file = directory / "vibration.json";
  if (!fs::exists(file)) return {};
  const json content = json::parse(read_file(file));
  try {
    VibrationResult known = vibration_of(content);
    if (is_unchanged(known.made_from, directory)) return known;
  } catch (const json::exception&) {  // another version wrote it
  }
  return {};
}

}  // namespace

VibrationResult vibration_with(const fs::path& project, const fs::path& directory, const Feedforward& drive,
                               const VibrationOptions& options) {
  const std::optional<VibrationResult> known = known_result(directory);
  const VibrationResult host = known ? *known : vibration(project, directory, options);
  return Experiment(project, directory, options).with_drive(host, drive);
}

}  // namespace fxdyn

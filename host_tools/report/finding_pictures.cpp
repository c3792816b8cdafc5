#include "host_tools/report/finding_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/parameter_values.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// An effect of the model: of a joint, or on the body.
struct Place {
  std::optional<std::size_t> joint{};
  std::size_t index = 0;
  std::string name{};  ///< of the effect, or of all that it may be
};

std::vector<EffectFit>& effects_at(IdentifiedModel& model, const Place& place) {
  return place.joint ? model.joints[*place.joint].effects : model.body;
}
const std::vector<EffectFit>& effects_at(const IdentifiedModel& model, const Place& place) {
  return place.joint ? model.joints[*place.joint].effects : model.body;
}
const EffectFit& effect_at(const IdentifiedModel& model, const Place& place) {
  return effects_at(model, place)[place.index];
}

using Sets = std::vector<std::vector<std::string>>;

/// Those of a list that were found, and the first of each undecided set, which the model has without a name: the last
/// of that effect, as a healthy one may stand before it.
void add_found(std::vector<Place>& places, const std::vector<EffectFit>& effects, std::optional<std::size_t> joint,
               const Sets& undecided) {
  for (std::size_t i = 0; i < effects.size(); ++i) {
    if (effects[i].named) places.push_back({joint, i, effects[i].effect});
  }
  for (const std::vector<std::string>& set : undecided) {
    for (std::size_t i = effects.size(); i-- > 0 && !set.empty();) {
      if (effects[i].named || effects[i].effect != set.front()) continue;
      places.push_back({joint, i, diagnosis_words::either(set)});
      break;
    }
  }
}

const JointDiagnosis* diagnosis_at(const DiagnosisResult* diagnosis, std::size_t joint) {
  if (diagnosis == nullptr) return nullptr;
  for (const JointDiagnosis& one : diagnosis->joints) {
    if (one.index == joint + 1) return &one;
  }
  return nullptr;
}

std::vector<Place> found_places(const IdentifiedModel& model, const DiagnosisResult* diagnosis) {
  std::vector<Place> out;
  add_found(out, model.body, std::nullopt, diagnosis != nullptr ? diagnosis->undecided : Sets());
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const JointDiagnosis* at = diagnosis_at(diagnosis, j);
    add_found(out, model.joints[j].effects, j, at != nullptr ? at->undecided : Sets());
  }
  return out;
}

/// A model that differs from the page's in one effect at most per joint, or in one that all joints feel: what each
/// place's joint then lacks is this effect's. So a page with findings on all joints costs as much as with one.
struct Variant {
  IdentifiedModel model;
  std::vector<std::size_t> places;  ///< to which it belongs
};

bool stays_at_its_joint(const IdentifiedModel& model, const Place& place) {
  return place.joint && find_effect(effect_at(model, place).effect)->acts_on == ActsOn::torque;
}

/// Puts the change of a place into the first variant that has none at its joint, else into a new one.
template <class Change>
void add_change(std::vector<Variant>& variants, const IdentifiedModel& model, const std::vector<Place>& places,
                std::size_t p, Change&& change) {
  const bool alone = !stays_at_its_joint(model, places[p]);
  const auto takes = [&](const Variant& variant) {
    return !alone && std::all_of(variant.places.begin(), variant.places.end(), [&](std::size_t other) {
      return stays_at_its_joint(model, places[other]) && places[other].joint != places[p].joint;
    });
  };
  auto found = std::find_if(variants.begin(), variants.end(), takes);
  if (found == variants.end()) found = variants.insert(variants.end(), Variant{model, {}});
  change(effects_at(found->model, places[p]));
  found->places.push_back(p);
}

/// The parameters whose deviations are known, each as "shape or not, which".
std::vector<std::pair<bool, std::size_t>> known_deviations(const EffectFit& fit) {
  std::vector<std::pair<bool, std::size_t>> out;
  for (std::size_t i = 0; i < fit.shape_std.size(); ++i) {
    if (fit.shape_std[i] > 0) out.emplace_back(true, i);
  }
  for (std::size_t i = 0; i < fit.linear_std.size(); ++i) {
    if (fit.linear_std[i] > 0) out.emplace_back(false, i);
  }
  return out;
}

/// Torques of the variants over the logs: [variant][log].
std::vector<std::vector<MatrixXd>> torques_of(const std::vector<Variant>& variants, const std::vector<ShownLog>& logs) {
  std::vector<std::vector<MatrixXd>> out(variants.size(), std::vector<MatrixXd>(logs.size()));
  parallel_for(variants.size() * logs.size(), [&](std::size_t i) {
    const std::size_t v = i / logs.size(), l = i % logs.size();
    out[v][l] = shown_torque(variants[v].model, *logs[l].log);
  });
  return out;
}

/// All that may tell a torque, at a joint.
std::vector<ShownSignal> signals_at(const std::vector<ShownLog>& logs, const Joint& joint, Index k) {
  const std::string unit = joint.position_unit();
  std::vector<VectorXd> time;
  for (const ShownLog& log : logs) time.push_back(log.t);
  std::vector<ShownSignal> out;
  const auto add = [&](const char* name, const std::string& in, const VectorXd& x) {
    out.push_back({fmt::format("{} [{}]", name, in), name, x});
  };
  add("velocity", unit + "/s", joined(logs, &ShownLog::dq, k));
  add("position", unit, joined(logs, &ShownLog::q, k));
  add("load", joint.torque_unit(), joined(logs, &ShownLog::load, k));
  add("acceleration", unit + "/s²", joined(logs, &ShownLog::ddq, k));
  add("time", "s", joined(time));
  return out;
}

/// Sets the picture's signal to the one that explains most of this torque.
void choose_signal(FindingPicture& picture, std::vector<ShownSignal> signals, const VectorXd& torque) {
  picture.explained = -1;
  for (ShownSignal& signal : signals) {
    ClassMeans means = class_means(signal.x, torque);
    if (means.explained <= picture.explained) continue;
    picture.explained = means.explained;
    picture.torque = std::move(means);
    picture.over = std::move(signal);
  }
}

/// The position within one period of an effect that repeats with it.
ShownSignal within_period(ShownSignal position, double wavenumber, const std::string& unit) {
  const double period = 2 * std::numbers::pi / wavenumber;
  position.name = fmt::format("position within one period of {:.4g} {}", period, unit);
  position.label = fmt::format("position within one period [{}]", unit);
  for (double& x : position.x) x -= period * std::floor(x / period);
  return position;
}

std::string in_words(const EffectFit& fit, const JointFit& joint, bool prismatic) {
  std::string out;
  for (const ParameterValue& p : parameter_values(fit, joint, prismatic)) {
    out += fmt::format("{}{} {:.3g}{}{}", out.empty() ? "" : ", ", p.name, p.value,
                       p.std && *p.std > 0 ? fmt::format(" ± {:.2g}", *p.std) : "",
                       p.unit.empty() || p.unit == "-" ? "" : fmt::format(" {}", p.unit));
  }
  return out;
}

/// A place's torque, and the squared standard deviation of it, log by log; samples x joints.
struct OwnTorque {
  std::vector<MatrixXd> torque, variance;
  Index joint = 0;
  bool with_band = false;
};

std::vector<VectorXd> columns(const std::vector<MatrixXd>& logs, Index joint) {
  std::vector<VectorXd> out;
  for (const MatrixXd& log : logs) out.emplace_back(log.col(joint));
  return out;
}

std::vector<OwnTorque> own_torques(const IdentifiedModel& model, const std::vector<Place>& places,
                                   const std::vector<ShownLog>& logs) {
  std::vector<Variant> without, moved;
  for (std::size_t p = 0; p < places.size(); ++p) {
    add_change(without, model, places, p, [&](std::vector<EffectFit>& effects) {
      effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(places[p].index));
    });
    for (const auto& [is_shape, i] : known_deviations(effect_at(model, places[p]))) {
      add_change(moved, model, places, p, [&, shape = is_shape, at = i](std::vector<EffectFit>& effects) {
        EffectFit& fit = effects[places[p].index];
        (shape ? fit.shape : fit.linear)[at] += (shape ? fit.shape_std : fit.linear_std)[at];
      });
    }
  }
  std::vector<OwnTorque> out(places.size());
  const auto rest = torques_of(without, logs), around = torques_of(moved, logs);
  for (std::size_t v = 0; v < without.size(); ++v) {
    for (const std::size_t p : without[v].places) {
      for (std::size_t l = 0; l < logs.size(); ++l) out[p].torque.push_back(logs[l].predicted - rest[v][l]);
    }
  }
  for (std::size_t p = 0; p < places.size(); ++p) {
    out[p].joint = static_cast<Index>(places[p].joint.value_or(0));
    if (places[p].joint) continue;
    VectorXd power = VectorXd::Zero(logs[0].predicted.cols());
    for (const MatrixXd& log : out[p].torque) power += log.colwise().squaredNorm().transpose();
    power.maxCoeff(&out[p].joint);
  }
  for (std::size_t v = 0; v < moved.size(); ++v) {
    for (const std::size_t p : moved[v].places) {
      out[p].variance.resize(logs.size());
      out[p].with_band = true;
      for (std::size_t l = 0; l < logs.size(); ++l) {
        const MatrixXd change = (around[v][l] - logs[l].predicted).cwiseAbs2();
        out[p].variance[l] = out[p].variance[l].size() == 0 ? change : MatrixXd(out[p].variance[l] + change);
      }
    }
  }
  return out;
}

FindingPicture picture_of(const IdentifiedModel& model, const Place& place, const std::vector<ShownLog>& logs,
                          const OwnTorque& own) {
  constexpr double of_95_percent = 1.96;
  FindingPicture out;
  out.joint = static_cast<std::size_t>(own.joint);
  out.effect = place.name;
  const EffectFit& fit = effect_at(model, place);
  const Joint& joint = model.robot.joints[out.joint];
  out.parameters = in_words(fit, model.joints[out.joint], joint.type == JointType::prismatic);
  const VectorXd torque = joined(columns(own.torque, own.joint));
  out.with = joined(logs, &ShownLog::residual, own.joint);
  out.without = out.with + torque;
  std::vector<ShownSignal> signals = signals_at(logs, joint, own.joint);
  if (find_effect(fit.effect)->of_spectrum() && fit.shape[0] > 0)
    signals = {within_period(signals[1], fit.shape[0], joint.position_unit())};
  choose_signal(out, std::move(signals), torque);
  if (own.with_band) {
    const VectorXd variance = joined(columns(own.variance, own.joint));
    out.band = of_95_percent * class_means(out.over.x, variance).y.cwiseMax(0).cwiseSqrt();
  }
  return out;
}

}  // namespace

std::vector<FindingPicture> finding_pictures(const IdentifiedModel& model, const std::vector<ShownLog>& logs,
                                             const DiagnosisResult* diagnosis) {
  std::vector<FindingPicture> out;
  if (logs.empty()) return out;
  const std::vector<Place> places = found_places(model, diagnosis);
  const std::vector<OwnTorque> own = own_torques(model, places, logs);
  for (std::size_t p = 0; p < places.size(); ++p) out.push_back(picture_of(model, places[p], logs, own[p]));
  for (std::size_t j = 0; j < model.robot.size(); ++j) {
    const JointDiagnosis* at = diagnosis_at(diagnosis, j);
    if (at == nullptr || (at->verdict != Verdict::unexplained && at->verdict != Verdict::partly_explained)) continue;
    FindingPicture unknown;
    unknown.joint = j;
    const auto k = static_cast<Index>(j);
    unknown.with = joined(logs, &ShownLog::residual, k);
    choose_signal(unknown, signals_at(logs, model.robot.joints[j], k), unknown.with);
    out.push_back(std::move(unknown));
  }
  std::stable_sort(out.begin(), out.end(), [](auto& a, auto& b) { return a.joint < b.joint; });
  return out;
}

}  // namespace fxdyn

#include "host_tools/report/vibration_result.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

/// Whose numbers_of() is not under a name in vibration.json, but beside the others'.
constexpr const char* plain = "model";

struct Figure {
  const char* name;
  double VibrationFigures::*value;
};
constexpr Figure always[] = {{"tracking_motor", &VibrationFigures::tracking_motor},
                             {"tracking_link", &VibrationFigures::tracking_link},
                             {"residual", &VibrationFigures::residual},
                             {"settling_s", &VibrationFigures::settling_s},
                             {"roughness", &VibrationFigures::roughness}};
struct FigureOrNone {
  const char* name;
  std::optional<double> VibrationFigures::*value;
};
constexpr FigureOrNone sometimes[] = {{"residual_late", &VibrationFigures::residual_late},
                                      {"still_s", &VibrationFigures::still_s}};

VibrationFigures figures_of(const json& file) {
  VibrationFigures out;
  for (const auto& [name, value] : always) out.*value = file.at(name);
  for (const auto& [name, value] : sometimes) {
    if (file.contains(name)) out.*value = file.at(name).get<double>();
  }
  return out;
}

json to_json(const VibrationPath& path) {
  return {{"kind", path.kind}, {"delay_s", path.delay_s}, {"cut_short", path.cut_short}};
}

VibrationPath path_of(const json& file) {
  return {file.at("kind"), file.at("delay_s").get<std::vector<double>>(), file.at("cut_short")};
}

json to_json(const VibrationMethod& method) {
  json moves;
  moves["all"] = by_name(method.all);
  for (const auto& [kind, figures] : method.kinds) moves[kind] = by_name(figures);
  json out{{"feedforward", method.feedforward},
           {"numbers", method.numbers},
           {"parameters_off", method.parameters_off},
           {"reference", method.motor_side ? "motor" : "link"},
           {"moves", moves}};
  if (!method.ratios.empty()) out["ratios"] = method.ratios;
  if (method.path) out["path"] = to_json(*method.path);
  return out;
}

VibrationMethod method_of(const json& file) {
  VibrationMethod out;
  out.feedforward = file.at("feedforward");
  out.numbers = file.at("numbers");
  out.parameters_off = file.at("parameters_off");
  out.motor_side = file.value("reference", "link") == "motor";
  for (const auto& [kind, figures] : file.at("moves").items())
    (kind == "all" ? out.all : out.kinds[kind]) = figures_of(figures);
  if (file.contains("ratios")) out.ratios = file.at("ratios").get<decltype(out.ratios)>();
  if (file.contains("path")) out.path = path_of(file.at("path"));
  return out;
}

json to_json(const VibrationControl& control) {
  return {{"bandwidth_hz", control.bandwidth_hz},
          {"damping", control.damping},
          {"tick_s", control.tick_s},
          {"encoder_step", control.encoder_step},
          {"settling_band", control.settling_band},
          {"late_s", control.late_s},
          {"grid", {{"bandwidth_hz", control.grid_bandwidths_hz}, {"damping", control.grid_dampings}}}};
}

VibrationControl control_of(const json& file) {
  const json grid = file.value("grid", json::object());  // who sets a PD by hand has none
  return {file.at("bandwidth_hz"),
          file.at("damping"),
          file.at("tick_s"),
          file.at("encoder_step"),
          file.at("settling_band"),
          file.value("late_s", 0.0),
          grid.value("bandwidth_hz", std::vector<double>()),
          grid.value("damping", std::vector<double>())};
}

json to_json(const NumbersCompared& numbers) {
  return {{"error_change", numbers.error_change}, {"path_difference", numbers.path_difference}};
}

NumbersCompared numbers_of(const json& file) { return {file.at("error_change"), file.at("path_difference")}; }

}  // namespace

std::map<std::string, double> by_name(const VibrationFigures& figures) {
  std::map<std::string, double> out;
  for (const auto& [name, value] : always) out[name] = figures.*value;
  for (const auto& [name, value] : sometimes) {
    if (figures.*value) out[name] = *(figures.*value);
  }
  return out;
}

std::optional<double> VibrationMethod::ratio(const std::string& to, const std::string& figure) const {
  const auto base = ratios.find(to);
  if (base == ratios.end()) return {};
  const auto found = base->second.find(figure);
  return found == base->second.end() ? std::nullopt : std::optional(found->second);
}

json to_json(const VibrationResult& result) {
  json out{{"schema", "fxdyn.vibration/1"}, {"control", to_json(result.control)}, {"methods", json::array()}};
  for (const VibrationMethod& method : result.methods) out["methods"].push_back(to_json(method));
  if (result.project_hash) out["project_hash"] = *result.project_hash;
  if (!result.made_from.is_null()) out["made_from"] = result.made_from;
  for (const auto& [name, numbers] : result.fixed_against_double) {
    json& beside = out["fixed_against_double"];
    if (name == plain)
      beside.update(to_json(numbers));
    else
      beside[name] = to_json(numbers);
  }
  return out;
}

VibrationResult vibration_of(const json& file) {
  VibrationResult out;
  out.control = control_of(file.at("control"));
  for (const json& method : file.at("methods")) out.methods.push_back(method_of(method));
  if (file.contains("project_hash")) out.project_hash = file.at("project_hash").get<std::string>();
  out.made_from = file.value("made_from", json());
  if (file.contains("fixed_against_double")) {
    const json& numbers = file.at("fixed_against_double");
    out.fixed_against_double[plain] = numbers_of(numbers);
    for (const auto& [name, other] : numbers.items()) {
      if (other.is_object()) out.fixed_against_double[name] = numbers_of(other);
    }
  }
  return out;
}

}  // namespace fxdyn

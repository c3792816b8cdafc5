#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "host_tools/export/export.hpp"
#include "host_tools/files.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/version.hpp"
#include "model/table_page.hpp"

namespace fxdyn {
namespace {

Evaluator<RunTimeNumbers> make_evaluator(const IdentifiedModel& model, const Formats& formats) {
  const FormatScope scope(formats);
  return Evaluator<RunTimeNumbers>(model, model.tick_s);
}

std::string type_name(std::string_view effect) {
  // stribeck -> Stribeck, rotor_inertia -> RotorInertia: the class names of model/effects
  std::string name;
  bool upper = true;
  for (const char c : effect) {
    if (c == '_') {
      upper = true;
    } else {
      name += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
      upper = false;
    }
  }
  return name;
}

std::string joint_type(const JointFit& joint) {
  std::string list;
  for (const EffectFit& fit : joint.effects) list += (list.empty() ? "" : ", ") + type_name(fit.effect);
  if (joint.bls) list += fmt::format("{}BroadLearning<{}>", list.empty() ? "" : ", ", joint.bls->nodes());
  return "JointEffects<" + list + ">";
}

/// Emits the words in order, with a comment for each group.
class Printer {
 public:
  explicit Printer(const std::vector<std::int32_t>& words) : words_(words) {}
  void group(std::size_t count, const std::string& comment) {
    text += "    ";
    for (std::size_t i = 0; i < count; ++i) text += fmt::format("{}, ", literal(words_[at_++]));
    text += "// " + comment + "\n";
  }
  void joint_kind(JointType type) {
    ++at_;
    text += fmt::format("    JointType::{}, ", type == JointType::prismatic ? "prismatic" : "revolute");
  }
  /// Many words, ten a line.
  void block(std::size_t count, const std::string& comment) {
    text += "    // " + comment + "\n";
    for (std::size_t i = 0; i < count; ++i) {
      text += (i % 10 == 0 ? "    " : "") + fmt::format("{},", literal(words_[at_++])) +
              (i % 10 == 9 || i + 1 == count ? "\n" : " ");
    }
  }
  std::string text;

 private:
  static std::string literal(std::int32_t word) {
    // -2147483648 is not one literal in C++
    return word == INT32_MIN ? "(-2147483647 - 1)" : std::to_string(word);
  }
  const std::vector<std::int32_t>& words_;
  std::size_t at_ = 0;
};

std::string parameters_text(const IdentifiedModel& model, const std::vector<std::int32_t>& words) {
  Printer printer(words);
  printer.group(3, "minus gravity in the first DH frame [m/s^2]");
  for (std::size_t i = 0; i < model.robot.size(); ++i) {
    printer.joint_kind(model.robot.joints[i].type);
    printer.group(6,
                  fmt::format("{}: cos alpha, sin alpha, a, d [m], cos theta, sin theta", model.robot.joints[i].name));
  }
  for (std::size_t i = 0; i < model.robot.size(); ++i) {
    printer.group(10, fmt::format("link {}: m [kg], h [kg m], Jxx Jyy Jzz Jxy Jxz Jyz [kg m^2]", i + 1));
  }
  for (std::size_t i = 0; i < model.robot.size(); ++i) {
    printer.group(9, fmt::format("{}: limits of q, dq, ddq, tau (lower, upper), 1 / width of the Coulomb sign",
                                 model.robot.joints[i].name));
  }
  for (std::size_t i = 0; i < model.robot.size(); ++i) {
    const Joint& joint = model.robot.joints[i];
    const bool prismatic = joint.type == JointType::prismatic;
    for (const EffectFit& fit : model.joints[i].effects) {
      const EffectInfo& info = *find_effect(fit.effect);
      std::string comment = fmt::format("{}: {} = {};", joint.name, fit.effect, info.equation);
      const auto describe = [&](std::span<const ParameterInfo> infos, const std::vector<double>& values) {
        for (std::size_t k = 0; k < infos.size(); ++k) {
          comment += fmt::format(" {} {:.6g} {}", infos[k].name, values[k],
                                 prismatic ? infos[k].unit_prismatic : infos[k].unit);
        }
      };
      describe(info.shape, fit.shape);
      describe(info.linear, fit.linear);
      printer.group(info.shape.size() + info.linear.size(), comment);
    }
    if (const auto& bls = model.joints[i].bls) {
      const auto nodes = static_cast<std::size_t>(bls->nodes());
      printer.block(broad_learning_shape_words(nodes) + broad_learning_coefficients(nodes),
                    fmt::format("{}: BLS, {} nodes: 1 / reference velocity, tick / distances, weights, coefficients",
                                joint.name, nodes));
    }
  }
  return printer.text;
}

}  // namespace

FixedModel::FixedModel(const IdentifiedModel& model, const Formats& formats)
    : formats_(formats), model_(model), evaluator_(make_evaluator(model, formats)) {}

std::vector<std::int32_t> FixedModel::tick(const std::vector<std::int32_t>& states, Saturations& saturations) {
  const FormatScope scope(formats_);
  std::vector<JointState<RunTimeNumbers>> joints(evaluator_.joints());
  for (std::size_t j = 0; j < joints.size(); ++j)
    joints[j] = {{states[3 * j]}, {states[3 * j + 1]}, {states[3 * j + 2]}};
  std::vector<std::int32_t> torques;
  for (const auto tau : evaluator_.tick(joints, saturations)) torques.push_back(tau.raw);
  return torques;
}

std::vector<std::int32_t> FixedModel::words() const { return evaluator_.words(); }

std::uint32_t FixedModel::layout_hash() const {
  // RobotModel::layout_hash() of the types that write_tables() names
  LayoutHash hash;
  for (const int bits : formats_.quantity) hash.add(bits);
  hash.add(formats_.force_sum);
  hash.add(formats_.torque_sum);
  hash.add(static_cast<std::int32_t>(model_.joints.size()));
  for (const JointFit& joint : model_.joints) {
    hash.add(static_cast<std::int32_t>(joint.effects.size() + (joint.bls ? 1 : 0)));
    for (const EffectFit& fit : joint.effects) {
      hash.add(std::string_view(fit.effect));
      hash.add(static_cast<std::int32_t>(fit.shape.size() + fit.linear.size()));
    }
    if (joint.bls) {
      const auto nodes = static_cast<std::size_t>(joint.bls->nodes());
      hash.add(BroadLearning<1>::name);
      hash.add(static_cast<std::int32_t>(broad_learning_shape_words(nodes) + broad_learning_coefficients(nodes)));
    }
  }
  return hash.value();
}

QuantisationError quantisation_error(const IdentifiedModel& model, const Formats& formats,
                                     const std::vector<TickStates>& states) {
  FixedModel fixed(model, formats);
  Evaluator<Real> exact(model, model.tick_s);
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  QuantisationError out{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  std::vector<JointState<Real>> state(model.robot.size());
  Eigen::Index count = 0;
  Saturations saturations, ignored;
  for (const TickStates& log : states) {
    fixed.reset();
    exact.reset();
    for (Eigen::Index k = 0; k < log.t.size(); ++k, ++count) {
      const std::vector<std::int32_t> raw = raw_states(log, k, formats);
      for (std::size_t j = 0; j < state.size(); ++j) {
        state[j] = {from_raw(raw[3 * j], formats[Quantity::position]),
                    from_raw(raw[3 * j + 1], formats[Quantity::velocity]),
                    from_raw(raw[3 * j + 2], formats[Quantity::acceleration])};
      }
      const std::vector<std::int32_t> torques = fixed.tick(raw, saturations);
      const auto reference = exact.tick(state, ignored);
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto i = static_cast<std::size_t>(j);
        const double error = std::fabs(from_raw(torques[i], formats[Quantity::torque]) - reference[i]);
        out.largest[j] = std::max(out.largest[j], error);
        out.rms[j] += error * error;
      }
    }
  }
  out.rms = (out.rms / static_cast<double>(std::max<Eigen::Index>(1, count))).cwiseSqrt();
  out.saturations = saturations.count;
  return out;
}

Eigen::MatrixXd predict_fixed(const IdentifiedModel& model, const Formats& formats, const TickStates& states) {
  FixedModel fixed(model, formats);
  Eigen::MatrixXd out(states.q.rows(), states.q.cols());
  Saturations ignored;
  for (Eigen::Index k = 0; k < out.rows(); ++k) {
    const std::vector<std::int32_t> torques = fixed.tick(raw_states(states, k, formats), ignored);
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out(k, j) = from_raw(torques[static_cast<std::size_t>(j)], formats[Quantity::torque]);
  }
  return out;
}

std::uint32_t write_tables(const IdentifiedModel& model, const Formats& formats, const QuantisationError& error,
                           const std::filesystem::path& directory) {
  const FixedModel fixed(model, formats);
  const std::vector<std::int32_t> words = fixed.words();
  Crc32 crc;
  for (const std::int32_t word : words) crc.add(static_cast<std::uint32_t>(word));
  const PageHeader header{table_magic, fixed.layout_hash(), static_cast<std::uint32_t>(words.size()), crc.value()};

  std::string format_lines, model_lines, error_lines, log_lines;
  for (std::size_t i = 0; i < quantity_count; ++i) {
    const auto quantity = static_cast<Quantity>(i);
    if (quantity == Quantity::unit || quantity == Quantity::argument || quantity == Quantity::ratio ||
        quantity == Quantity::count) {
      continue;
    }
    format_lines += fmt::format("  static constexpr int {} = {};\n", quantity_names[i], formats.quantity[i]);
  }
  format_lines += fmt::format("  static constexpr int force_sum = {};\n  static constexpr int torque_sum = {};\n",
                              formats.force_sum, formats.torque_sum);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    model_lines += fmt::format(",\n                         {}", joint_type(model.joints[j]));
    const auto k = static_cast<Eigen::Index>(j);
    error_lines += fmt::format("//   {}: {:.3g} {}, {:.2g} of rated\n", model.robot.joints[j].name, error.largest[k],
                               model.robot.joints[j].torque_unit(), error.largest[k] / model.joints[j].rated_torque);
  }
  for (const LogReference& log : model.logs)
    log_lines += fmt::format("//   {} {} [{}, {}) s, hash {}\n", log.role, log.file, log.from_s, log.to_s, log.hash);

  const std::string text = fmt::format(
      R"(// Generated by fxdyn {} export from project {} (hash {}). Do not edit: make it anew.
// Feedforward torque tau = RNEA(q, dq, ddq) + sum of the joint's effects [N*m | N], joint side of the gearbox, one call a
// tick of {} s:
//   tau = fxdyn::tables::Model::tick(parameters, state, setpoints, saturations)
// Raw integers, value = raw * 2^-bits with the bits of Formats. Made from
{}// Largest |fixed - double| observed over these logs and their perturbed copies (an observation, not a proof):
{}
#pragma once

#include "model/joint_model.hpp"

namespace fxdyn::tables {{

struct Formats {{
{}}};
using Numbers = FixedNumbers<Formats>;
using Model = RobotModel<Numbers{}>;

[[gnu::section(".fxdyn_tables"), gnu::used]] inline constexpr TablePage<Model> page{{
  {{{}U, {}U, {}U, {}U}},  // magic, layout hash, words, CRC-32
  {{
{}  }}}};
inline constexpr const Model::Parameters& parameters = page.parameters;

}}  // namespace fxdyn::tables
)",
      version, model.project, model.project_hash, model.tick_s, log_lines, error_lines, format_lines, model_lines,
      header.magic, header.layout_hash, header.words, header.crc32, parameters_text(model, words));
  write_file(directory / "tables.hpp", text);

  std::string bytes(sizeof header + 4 * words.size(), '\0');
  std::memcpy(bytes.data(), &header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, words.data(), 4 * words.size());
  write_file(directory / "tables.bin", bytes);
  return header.crc32;
}

}  // namespace fxdyn

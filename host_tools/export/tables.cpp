#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/effects/effect_library.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/support/files.hpp"
#include "model/broad_learning.hpp"
#include "model/table_page.hpp"
#include "model/version.hpp"

namespace fxdyn {
namespace {

Evaluator<RunTimeNumbers> make_evaluator(const IdentifiedModel& model, const Formats& formats, std::uint32_t outputs) {
  const FormatScope scope(formats);
  Evaluator<RunTimeNumbers> evaluator(model, model.tick_s);
  evaluator.set_outputs(outputs);
  return evaluator;
}

/// stribeck -> Stribeck, rotor_inertia -> RotorInertia: the class names of model/effects.
std::string type_name(std::string_view effect) {
  std::string name;
  bool upper = true;
  for (const char c : effect) {
    if (c != '_') name += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    upper = c == '_';
  }
  return name;
}

/// Link<...> with what its parameters say beforehand (model/rigid_body.hpp).
struct LinkShape {
  JointType type = JointType::revolute;
  Twist twist = Twist::any;
  unsigned offsets = 0, parameters = 0;

  std::int32_t code() const {
    return static_cast<std::int32_t>(type) | static_cast<std::int32_t>(twist) << 1 |
           static_cast<std::int32_t>(offsets << 3 | parameters << 6);
  }
  std::string text() const {
    static constexpr std::array names{"any", "none", "quarter", "minus_quarter"};
    return fmt::format("Link<JointType::{}, Twist::{}, {:#x}, {:#x}>",
                       type == JointType::prismatic ? "prismatic" : "revolute", names[static_cast<std::size_t>(twist)],
                       offsets, parameters);
  }
};

/// Read from the words themselves: what is zero or a right angle there is not computed (which parameters are, a layout
/// may have said before). 17 words a link.
std::vector<LinkShape> link_shapes(const IdentifiedModel& model, const std::vector<std::int32_t>& words) {
  constexpr std::int32_t one = 1 << unit_bits;
  const std::size_t joints = model.joints.size();
  std::vector<LinkShape> shapes;
  for (std::size_t i = 0; i < joints; ++i) {
    const std::int32_t* geometry = words.data() + 4 + 7 * i;
    const std::int32_t* inertia = words.data() + 4 + 7 * joints + 10 * i;
    LinkShape shape;
    shape.type = static_cast<JointType>(geometry[0]);
    const std::int32_t cosine = geometry[1], sine = geometry[2];
    if (cosine == one && sine == 0) shape.twist = Twist::none;
    if (cosine == 0 && sine == one) shape.twist = Twist::quarter;
    if (cosine == 0 && sine == -one) shape.twist = Twist::minus_quarter;
    for (unsigned k = 0; k < 3; ++k) shape.offsets |= static_cast<unsigned>(geometry[3 + k] != 0) << k;
    for (unsigned k = 0; k < 10; ++k) shape.parameters |= static_cast<unsigned>(inertia[k] != 0) << k;
    if (model.layout) shape.parameters = model.layout->parameters[i];
    shapes.push_back(shape);
  }
  return shapes;
}

bool deflects(const IdentifiedModel& model) {
  for (const JointFit& joint : model.joints) {
    for (const EffectFit& fit : joint.effects) {
      if (find_effect(fit.effect)->acts_on == ActsOn::position) return true;
    }
  }
  return false;
}

/// The effects of a joint in the tables: none where the drive does not put out its torque and nobody needs them.
bool has_effects(const IdentifiedModel& model, std::size_t joint, std::uint32_t outputs) {
  return (outputs >> joint & 1U) != 0 || deflects(model);
}

std::string bls_type(const BroadLearningFit& fit, int bits) {
  std::string list = fmt::format("{}, {}", stored_nodes(fit), bits);
  // Only what differs from the template's defaults.
  const bool relu = fit.activation == RampNodes::name;
  if (fit.inputs != PhysicalInputs::name || relu) list += fmt::format(", {}Inputs", type_name(fit.inputs));
  if (relu) list += ", RampNodes";
  return "BroadLearning<" + list + ">";
}

std::string joint_type(const IdentifiedModel& model, std::size_t index, const LinkShape& shape, bool effects) {
  const JointFit& joint = model.joints[index];
  std::string list = shape.text();
  if (effects) {
    for (const EffectFit* fit : in_order(joint)) list += ", " + type_name(fit->effect);
    if (joint.bls) list += ", " + bls_type(*joint.bls, node_bits(model, index));
    for (const EffectFit* fit : in_order(joint, true)) list += ", " + type_name(fit->effect);
  }
  return "JointModel<" + list + ">";
}

/// The words in front of a BLS's rows: what Inputs::stored() gives.
std::string scales_text(std::string_view inputs) {
  constexpr std::string_view physical = "1 / reference velocity, 1 / span, tick / distances";
  if (inputs == ExtendedInputs::name)
    return fmt::format("{}, 1 / torque, turns per unit of position, 1 / acceleration", physical);
  if (inputs == BristlesInputs::name)
    return fmt::format("{}, 1 / Stribeck velocity, 1 - share, 1 / velocity", physical);
  if (inputs == StateInputs::name)
    return "middle position, 1 / half range, 1 / velocity, 1 / acceleration, 1 / reference velocity, 1 / span";
  return std::string(physical);
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
  /// The next words in the places of # and, as a joint type, of @.
  void pattern(std::string_view form, const std::string& comment) {
    text += "    ";
    for (const char c : form) {
      if (c == '#') {
        text += literal(words_[at_++]);
      } else if (c == '@') {
        text += words_[at_++] == static_cast<std::int32_t>(JointType::prismatic) ? "JointType::prismatic"
                                                                                 : "JointType::revolute";
      } else {
        text += c;
      }
    }
    text += "  // " + comment + "\n";
  }
  void plain(const std::string& line) { text += "    " + line + "\n"; }
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

std::string parameters_text(const IdentifiedModel& model, const std::vector<std::int32_t>& words,
                            std::uint32_t outputs) {
  Printer printer(words);
  printer.pattern("{#, #, #},", "minus gravity in the first DH frame [m/s^2]");
  printer.pattern("#,", "ticks per second");
  printer.plain("{{");
  for (const Joint& joint : model.robot.joints)
    printer.pattern("{@, #, #, {#, #, #}, #},",
                    fmt::format("{}: cos alpha, sin alpha, p [m], theta [rad]", joint.name));
  printer.plain("}}, {{");
  for (std::size_t i = 0; i < model.robot.size(); ++i)
    printer.pattern("{#, {#, #, #}, #, #, #, #, #, #},",
                    fmt::format("link {}: m [kg], h [kg m], Jxx Jyy Jzz Jxy Jxz Jyz [kg m^2]", i + 1));
  printer.plain("}}, {{");
  for (const Joint& joint : model.robot.joints)
    printer.pattern(
        "{{#, #, #, #, #, #, #, #}, #},",
        fmt::format("{}: limits of q, dq, ddq, tau (lower, upper), 1 / width of the Coulomb sign", joint.name));
  printer.plain("}}, {");
  for (std::size_t i = 0; i < model.robot.size(); ++i) {
    const Joint& joint = model.robot.joints[i];
    const bool prismatic = joint.type == JointType::prismatic;
    if (!has_effects(model, i, outputs)) continue;
    const auto print = [&](const EffectFit& fit) {
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
    };
    for (const EffectFit* fit : in_order(model.joints[i])) print(*fit);
    if (const auto& bls = model.joints[i].bls) {
      const std::size_t nodes = stored_nodes(*bls);
      std::size_t count = 0;
      with_bls_types(*bls, [&]<class Inputs, class>() { count = BroadLearningLayout<Inputs>::words(nodes, true); });
      printer.block(count, fmt::format("{}: BLS, {} nodes{}: {}; a row of bias and weights a node; coefficients of "
                                       "inputs and nodes",
                                       joint.name, nodes, bls->activation == RampNodes::name ? " (ramps)" : "",
                                       scales_text(bls->inputs)));
    }
    for (const EffectFit* fit : in_order(model.joints[i], true)) print(*fit);
  }
  printer.plain("}");
  return printer.text;
}

}  // namespace

FixedModel::FixedModel(const IdentifiedModel& model, const Formats& formats, std::uint32_t outputs)
    : formats_(formats),
      model_(std::make_shared<const IdentifiedModel>(model)),
      outputs_(outputs),
      evaluator_(make_evaluator(model, formats, outputs)) {
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    if ((outputs >> i & 1U) != 0) output_joints_.push_back(i);
  }
}

void FixedModel::warm_up(double seconds) {
  const FormatScope scope(formats_);
  evaluator_.warm_up(seconds);
}

std::vector<std::int32_t> FixedModel::tick(const std::vector<std::int32_t>& states, Saturations& saturations) {
  const FormatScope scope(formats_);
  std::vector<JointState<RunTimeNumbers>> joints(evaluator_.joints());
  for (std::size_t j = 0; j < joints.size(); ++j)
    joints[j] = {{states[3 * j]}, {states[3 * j + 1]}, {states[3 * j + 2]}};
  std::vector<std::int32_t> torques;
  const auto tau = evaluator_.tick(joints, saturations);
  for (const std::size_t i : output_joints_) torques.push_back(tau[i].raw);
  return torques;
}

std::vector<std::int32_t> FixedModel::words() const { return evaluator_.words(); }

std::uint32_t FixedModel::crc() const {
  Crc32 crc;
  for (const std::int32_t word : words()) crc.add(static_cast<std::uint32_t>(word));
  return crc.value();
}

std::uint32_t FixedModel::layout_hash() const {
  // RobotModel::layout_hash() of the types that write_tables() names
  LayoutHash hash;
  for (const int bits : formats_.quantity) hash.add(bits);
  hash.add(formats_.force_sum);
  hash.add(formats_.torque_sum);
  hash.add(formats_.deflection_sum);
  hash.add(static_cast<std::int32_t>(model_->joints.size()));
  hash.add(static_cast<std::int32_t>(outputs_));
  const std::vector<LinkShape> shapes = link_shapes(*model_, words());
  for (std::size_t i = 0; i < model_->joints.size(); ++i) {
    const JointFit& joint = model_->joints[i];
    hash.add(shapes[i].code());
    if (!has_effects(*model_, i, outputs_)) {
      hash.add(0);
      continue;
    }
    hash.add(static_cast<std::int32_t>(joint.effects.size() + (joint.bls ? 1 : 0)));
    const auto add = [&](const EffectFit& fit) {
      hash.add(std::string_view(fit.effect));
      hash.add(static_cast<std::int32_t>(fit.shape.size() + fit.linear.size()));
    };
    for (const EffectFit* fit : in_order(joint)) add(*fit);
    if (joint.bls) {
      with_bls_types(*joint.bls, [&]<class Inputs, class Activation>() {
        BroadLearning<2, 0, Inputs, Activation>::hash_layout(hash, stored_nodes(*joint.bls), node_bits(*model_, i));
      });
    }
    for (const EffectFit* fit : in_order(joint, true)) add(*fit);
  }
  return hash.value();
}

TableLayout layout_of(const IdentifiedModel& model, const Formats& formats) {
  TableLayout layout;
  for (const LinkShape& shape : link_shapes(model, FixedModel(model, formats).words()))
    layout.parameters.push_back(shape.parameters);
  for (std::size_t j = 0; j < model.joints.size(); ++j) layout.node_bits.push_back(node_bits(model, j));
  return layout;
}

std::string why_not_in_layout(const IdentifiedModel& model, const Formats& formats) {
  if (!formats_hold(model, formats)) return "its numbers leave the formats";
  const std::vector<std::int32_t> words = FixedModel(model, formats).words();
  IdentifiedModel free = model;
  free.layout.reset();
  const std::vector<LinkShape> computed = link_shapes(model, words), needed = link_shapes(free, words);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const std::string& joint = model.robot.joints[j].name;
    if (most_node_bits(model.joints[j]) < node_bits(model, j))
      return fmt::format("output weights of {}'s BLS leave their format", joint);
    if ((needed[j].parameters & ~computed[j].parameters) != 0)
      return fmt::format("an inertial parameter of the link behind {} is not zero any more", joint);
  }
  return {};
}

namespace {

/// tables.hpp, as write_tables() fills it in.
constexpr const char* header_template =
    R"(// Generated by fxdyn {} export from project {} (hash {}). Do not edit: make it anew.
// For a drive that puts out the torque of {}.
{}// Feedforward torque tau = RNEA(q, dq, ddq) + sum of the joint's effects [N*m | N], joint side of the gearbox, one call a
// tick of {} s:
//   tau = fxdyn::tables::Model::tick(parameters, state, setpoints, saturations)
// Raw integers, value = raw * 2^-bits with the bits of Formats. Made from
{}// |fixed - double|: proven for every motion within the limits (effect states: unless a joint creeps, by less than a
// presliding distance in ten seconds, for longer than that), and the largest over these logs, disturbed copies of them and
// random and creeping motion within the limits:
{}
#pragma once

#include <array>
#include <cstdint>

#include "model/joint_model.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-braces"  // numbers without braces of their own

namespace fxdyn::tables {{

struct Formats {{
{}}};
using Numbers = FixedNumbers<Formats>;
using Model = RobotModel<Numbers, {:#x}{}>;

[[gnu::section(".fxdyn_tables"), gnu::used]] inline constexpr TablePage<Model> page{{
  // magic, layout hash, words, CRC-32; origin, sequence, CRC-32 of the header
  {{{}U, {}U, {}U, {}U, {}U, {}U, {}U}},
  {{
{}  }}}};
static_assert(page.header.words == TablePage<Model>::parameter_words && page.header.layout_hash == Model::layout_hash() &&
                  page.header.check == with_check(page.header).check,
              "these tables are for another version of the model library: export them anew");
inline constexpr const Model::Parameters& parameters = page.parameters;

/// Rated torque of every joint [mN*m | mN], what a bus counts torques in.
inline constexpr std::array<std::int32_t, Model::joints> rated_torque{{{}}};

}}  // namespace fxdyn::tables

#pragma GCC diagnostic pop
)";

/// Bits of every kind of number, one line each.
std::string format_lines(const Formats& formats) {
  std::string out;
  for (std::size_t i = 0; i < quantity_count; ++i) {
    const auto quantity = static_cast<Quantity>(i);
    if (common_bits(quantity) > 0) continue;
    out += fmt::format("  static constexpr int {} = {};\n", quantity_names[i], formats.quantity[i]);
  }
  return out +
         fmt::format(
             "  static constexpr int force_sum = {};\n  static constexpr int torque_sum = {};\n  static constexpr "
             "int deflection_sum = {};\n",
             formats.force_sum, formats.torque_sum, formats.deflection_sum);
}

/// The joints whose torques the drive puts out, for people.
std::string driven_joints(const IdentifiedModel& model, std::uint32_t outputs) {
  if (outputs == all_joints(model)) return "every joint";
  std::string out;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if ((outputs >> j & 1U) != 0) out += (out.empty() ? "" : ", ") + model.robot.joints[j].name;
  }
  return out;
}

/// The build of an image reads it.
std::string library_line() {
  return effect_library().empty() ? "" : fmt::format("// Effects of the library {} are in it.\n", effect_library());
}

std::string joint_types(const IdentifiedModel& model, const std::vector<LinkShape>& shapes, std::uint32_t outputs) {
  std::string out;
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    out +=
        fmt::format(",\n                         {}", joint_type(model, j, shapes[j], has_effects(model, j, outputs)));
  return out;
}

std::string error_lines(const IdentifiedModel& model, const QuantisationError& error, const Eigen::VectorXd& proven) {
  std::string out;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    out += fmt::format("//   {}: proven <= {:.3g}, observed {:.3g} {} ({:.2g} of rated)\n", model.robot.joints[j].name,
                       proven[k], error.largest[k], model.robot.joints[j].torque_unit(),
                       error.largest[k] / model.joints[j].rated_torque);
  }
  return out;
}

std::string log_lines(const IdentifiedModel& model) {
  std::string out;
  for (const auto* logs : {&model.logs, &model.updates}) {
    for (const LogReference& log : *logs)
      out += fmt::format("//   {} {} [{}, {}) s, hash {}\n", log.role, log.file, log.from_s, log.to_s, log.hash);
  }
  return out;
}

/// Rated torques [mN*m | mN].
std::string rated_torques(const IdentifiedModel& model) {
  std::string out;
  for (const JointFit& joint : model.joints)
    out += fmt::format("{}{}", out.empty() ? "" : ", ",
                       static_cast<std::int32_t>(std::clamp(std::round(1e3 * joint.rated_torque), 1.0, 2147483647.0)));
  return out;
}

}  // namespace

std::uint32_t write_tables(const IdentifiedModel& model, const Formats& formats, const QuantisationError& error,
                           const Eigen::VectorXd& proven, std::uint32_t outputs,
                           const std::filesystem::path& directory) {
  const FixedModel fixed(model, formats, outputs);
  const std::vector<std::int32_t> words = fixed.words();
  const PageHeader header = with_check({.layout_hash = fixed.layout_hash(),
                                        .words = static_cast<std::uint32_t>(words.size()),
                                        .crc32 = fixed.crc(),
                                        .origin = model.lineage.origin,
                                        .sequence = model.lineage.sequence});
  const std::string text = fmt::format(fmt::runtime(header_template), version, model.project, model.project_hash,
                                       driven_joints(model, outputs), library_line(), model.tick_s, log_lines(model),
                                       error_lines(model, error, proven), format_lines(formats), outputs,
                                       joint_types(model, link_shapes(model, words), outputs), header.magic,
                                       header.layout_hash, header.words, header.crc32, header.origin, header.sequence,
                                       header.check, parameters_text(model, words, outputs), rated_torques(model));
  write_file(directory / "tables.hpp", text);

  std::string bytes(sizeof header + 4 * words.size(), '\0');
  std::memcpy(bytes.data(), &header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, words.data(), 4 * words.size());
  write_file(directory / "tables.bin", bytes);
  return header.crc32;
}

}  // namespace fxdyn

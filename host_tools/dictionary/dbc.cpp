#include <fmt/format.h>
#include <fmt/ostream.h>

#include "firmware/protocol/canopen.hpp"
#include "host_tools/dictionary/dictionary.hpp"

namespace fxdyn {
namespace {

/// SG_ name : start|bits@1sign (factor,offset) [min|max] "unit" receiver; @1: little endian.
struct Signal {
  const char* name;
  int start, bits;
  bool is_signed = false;
  double factor = 1;
  const char* unit = "";
};

void write_message(std::ostream& out, std::uint32_t id, const std::string& name, int size, const char* sender,
                   const std::vector<Signal>& signals) {
  fmt::print(out, "BO_ {} {}: {} {}\n", id, name, size, sender);
  for (const Signal& s : signals) {
    const double highest = std::ldexp(1.0, s.is_signed ? s.bits - 1 : s.bits) - 1;
    const double lowest = s.is_signed ? -highest - 1 : 0;
    fmt::print(out, " SG_ {} : {}|{}@1{} ({:.17g},0) [{:.9g}|{:.9g}] \"{}\" Vector__XXX\n", s.name, s.start, s.bits,
               s.is_signed ? '-' : '+', s.factor, lowest * s.factor, highest * s.factor, s.unit);
  }
  out << "\n";
}

}  // namespace

void write_dbc(const BusDescription& description, std::ostream& out) {
  std::vector<int> nodes;
  std::string names = "HOST";
  for (std::size_t j = 0; j < description.joints.size(); ++j) {
    if ((description.outputs >> j & 1U) == 0) continue;
    if (nodes.empty()) names += fmt::format(" NODE_{}", j + 1);
    nodes.push_back(static_cast<int>(j) + 1);
  }
  const int first = nodes.empty() ? 1 : nodes.front();
  const std::string node = fmt::format("NODE_{}", first);
  fmt::print(out, "VERSION \"fxdyn {}\"\n\nNS_ :\n\nBS_:\n\nBU_: {}\n\n", description.software, names);
  const auto id = [&](std::uint32_t function, int number) { return function + static_cast<std::uint32_t>(number); };

  write_message(out, canopen::nmt_id, "NMT", 2, "HOST", {{"Command", 0, 8}, {"Node", 8, 8}});
  write_message(out, canopen::sync_id, "SYNC", 0, "HOST", {});
  write_message(out, id(canopen::emergency_id, first), fmt::format("EMCY_{}", first), 8, node.c_str(),
                {{"Code", 0, 16}, {"ErrorRegister", 16, 8}, {"Detail", 24, 16}});
  for (std::size_t j = 0; j < description.joints.size(); ++j) {
    const BusDescription::Joint& joint = description.joints[j];
    const int number = static_cast<int>(j) + 1;
    if ((description.outputs >> j & 1U) != 0) {
      write_message(out, id(canopen::torque_id, number), fmt::format("Torque_{}", number), 8, node.c_str(),
                    {{"PerMille", 0, 16, true, 1, "per mille"},
                     {"Torque", 16, 32, true, 1e-3, joint.prismatic ? "N" : "N*m"},
                     {"Tick", 48, 8},
                     {"Fresh", 56, 1},
                     {"Ramping", 57, 1},
                     {"StepLimited", 58, 1},
                     {"AtLimit", 59, 1},
                     {"Enabled", 60, 1}});
    }
    write_message(out, id(canopen::setpoint_id, number), fmt::format("Setpoint_{}", number), 8, "HOST",
                  {{"Position", 0, 32, true, joint.q_step, joint.prismatic ? "m" : "rad"},
                   {"Velocity", 32, 16, true, joint.dq_limit / 32768, joint.prismatic ? "m/s" : "rad/s"},
                   {"Acceleration", 48, 16, true, joint.ddq_limit / 32768, joint.prismatic ? "m/s^2" : "rad/s^2"}});
  }
  write_message(out, id(canopen::sdo_answer_id, first), fmt::format("SDO_answer_{}", first), 8, node.c_str(),
                {{"Command", 0, 8}, {"Index", 8, 16}, {"SubIndex", 24, 8}, {"Data", 32, 32}});
  write_message(out, id(canopen::sdo_request_id, first), fmt::format("SDO_request_{}", first), 8, "HOST",
                {{"Command", 0, 8}, {"Index", 8, 16}, {"SubIndex", 24, 8}, {"Data", 32, 32}});
  write_message(out, id(canopen::heartbeat_id, first), fmt::format("Heartbeat_{}", first), 1, node.c_str(),
                {{"State", 0, 8}});

  fmt::print(out, "CM_ \"Bus of a fxdyn drive node: classic frames, default identifiers\";\n");
  for (std::size_t j = 0; j < description.joints.size(); ++j)
    fmt::print(out, "CM_ BO_ {} \"Joint {}, rated torque {:g} {}\";\n",
               id(canopen::setpoint_id, static_cast<int>(j) + 1), j + 1, description.joints[j].rated_torque,
               description.joints[j].prismatic ? "N" : "N*m");
  fmt::print(out,
             "VAL_ {} State 0 \"boot-up\" 4 \"stopped\" 5 \"operational\" 127 \"pre-operational\" ;\n"
             "VAL_ 0 Command 1 \"start\" 2 \"stop\" 128 \"enter pre-operational\" 129 \"reset node\" 130 \"reset "
             "communication\" ;\n",
             id(canopen::heartbeat_id, first));
}

}  // namespace fxdyn

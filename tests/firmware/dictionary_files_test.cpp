// EDS and DBC: parsed again, complete, and true to what the node says and sends.

#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "host_tools/dictionary/dictionary.hpp"
#include "model/version.hpp"
#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using test::Bench;

BusDescription robot() { return describe<test::Robot>(tables::page.parameters, tables::rated_torque, version); }

// --- EDS -------------------------------------------------------------------------------------------------------------

using Section = std::map<std::string, std::string>;

std::map<std::string, Section> parse_eds(const BusDescription& description) {
  std::ostringstream out;
  write_eds(description, "node.eds", out);
  std::istringstream in(out.str());
  std::map<std::string, Section> sections;
  Section* section = nullptr;
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) continue;
    if (line.front() == '[') {
      EXPECT_EQ(line.back(), ']');
      const auto [at, is_new] = sections.emplace(line.substr(1, line.size() - 2), Section{});
      EXPECT_TRUE(is_new) << line;
      section = &at->second;
      continue;
    }
    const std::size_t equals = line.find('=');
    EXPECT_NE(equals, std::string::npos) << line;
    EXPECT_NE(section, nullptr);
    EXPECT_TRUE(section->emplace(line.substr(0, equals), line.substr(equals + 1)).second) << line;
  }
  return sections;
}

std::uint32_t number(const std::string& text, std::uint32_t node_id) {
  const std::string prefix = "$NODEID+";
  const bool plus_node = text.rfind(prefix, 0) == 0;
  return static_cast<std::uint32_t>(std::stoul(plus_node ? text.substr(prefix.size()) : text, nullptr, 0)) +
         (plus_node ? node_id : 0);
}

std::string hex(int index) {
  char text[8];
  std::snprintf(text, sizeof text, "%04X", static_cast<unsigned>(index));
  return text;
}

TEST(Eds, ListsEveryObjectOnceAndNothingElse) {
  const auto eds = parse_eds(robot());
  for (const char* section : {"FileInfo", "DeviceInfo", "DummyUsage", "Comments"}) EXPECT_TRUE(eds.contains(section));
  EXPECT_EQ(eds.at("DeviceInfo").at("NrOfRXPDO"), "6");
  EXPECT_EQ(eds.at("DeviceInfo").at("NrOfTXPDO"), "6");
  std::set<int> listed;
  for (const char* list : {"MandatoryObjects", "OptionalObjects", "ManufacturerObjects"}) {
    const Section& section = eds.at(list);
    const int count = std::stoi(section.at("SupportedObjects"));
    EXPECT_EQ(section.size(), static_cast<std::size_t>(count) + 1);
    for (int i = 1; i <= count; ++i) {
      const int index = std::stoi(section.at(std::to_string(i)), nullptr, 0);
      EXPECT_TRUE(listed.insert(index).second);
      EXPECT_TRUE(eds.contains(hex(index))) << hex(index);
    }
  }
  std::set<int> expected;
  for (const auto& entry : dictionary::entries) {
    for (std::size_t offset = 0; offset < 6; ++offset) {
      if (dictionary::Extent{6, 0x3F}.stands_at(entry, offset)) expected.insert(entry.index + static_cast<int>(offset));
    }
  }
  EXPECT_EQ(listed, expected);
}

// Every sub-index of the file is one of the node's, with its type and access, and the default is what the node says.
TEST(Eds, SaysWhatTheNodeSays) {
  const auto eds = parse_eds(robot());
  Bench<> bench;
  bench.poll();
  std::size_t compared = 0, places = 0;
  const std::regex name("([0-9A-F]{4})(sub([0-9A-F]+))?");
  for (const auto& [title, section] : eds) {
    std::smatch match;
    if (!std::regex_match(title, match, name)) continue;
    const int index = std::stoi(match[1], nullptr, 16);
    if (section.contains("SubNumber")) {
      int subs = 0;
      for (int sub = 0; sub < 0xFF; ++sub) {
        std::ostringstream sub_title;
        sub_title << hex(index) << "sub" << std::uppercase << std::hex << sub;
        subs += eds.contains(sub_title.str()) ? 1 : 0;
      }
      EXPECT_EQ(std::stoi(section.at("SubNumber")), subs) << title;
      continue;
    }
    ++places;
    const auto sub = static_cast<std::uint8_t>(match[3].matched ? std::stoi(match[3], nullptr, 16) : 0);
    for (const char* key : {"ParameterName", "ObjectType", "DataType", "AccessType", "PDOMapping", "DefaultValue"})
      EXPECT_TRUE(section.contains(key)) << title << " " << key;
    EXPECT_FALSE(section.at("ParameterName").empty());
    dictionary::Object object;
    ASSERT_EQ(bench.node.find(static_cast<std::uint16_t>(index), sub, object), canopen::Abort::none) << title;
    EXPECT_EQ(std::stoi(section.at("DataType"), nullptr, 0), static_cast<int>(object.type())) << title;
    const bool is_setpoint = index >= 0x2100 && index <= 0x2102 && sub != 0;
    if (is_setpoint)
      EXPECT_EQ(section.at("AccessType"), "rww") << title;
    else
      EXPECT_EQ(section.at("AccessType") == "rw", object.writable()) << title;
    EXPECT_EQ(section.contains("LowLimit"), object.writable() && object.type() != dictionary::Type::visible_string)
        << title;
    const std::string& value = section.at("DefaultValue");
    if (value.empty() || object.type() == dictionary::Type::visible_string) continue;
    ++compared;
    EXPECT_EQ(bench.read(static_cast<std::uint32_t>(index), sub), number(value, 1)) << title;
  }
  EXPECT_GT(compared, 100U);
  EXPECT_GT(places, 200U);
}

TEST(Eds, MappedObjectsExistAndMayBeMapped) {
  const auto eds = parse_eds(robot());
  for (const int base : {0x1600, 0x1A00}) {
    for (int joint = 0; joint < 6; ++joint) {
      int bits = 0;
      for (int place = 1; place <= (base == 0x1600 ? 3 : 4); ++place) {
        const auto value = number(eds.at(hex(base + joint) + "sub" + std::to_string(place)).at("DefaultValue"), 1);
        const Section& mapped = eds.at(hex(static_cast<int>(value >> 16)) + "sub" + std::to_string(value >> 8 & 0xFF));
        EXPECT_EQ(mapped.at("PDOMapping"), "1");
        // What a PDO writes must not be read-only, and what it reads is not written by one.
        EXPECT_EQ(mapped.at("AccessType"), base == 0x1600 ? "rww" : "ro");
        bits += static_cast<int>(value & 0xFF);
      }
      EXPECT_EQ(bits, 64);
    }
  }
}

// CiA 306-1, sections FileInfo and DeviceInfo: every key, and what the identity object says too.
TEST(Eds, HasWhatFileAndDeviceInfoNeed) {
  const auto eds = parse_eds(robot());
  for (const char* key : {"FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime",
                          "CreationDate", "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy"}) {
    ASSERT_TRUE(eds.at("FileInfo").contains(key)) << key;
    EXPECT_FALSE(eds.at("FileInfo").at(key).empty()) << key;
  }
  const std::regex date("[0-9]{2}-[0-9]{2}-[0-9]{4}"), time("[0-9]{2}:[0-9]{2}(AM|PM)");
  EXPECT_TRUE(std::regex_match(eds.at("FileInfo").at("ModificationDate"), date));
  EXPECT_TRUE(std::regex_match(eds.at("FileInfo").at("ModificationTime"), time));
  for (const char* key : {"VendorName", "VendorNumber", "ProductName", "ProductNumber", "RevisionNumber", "OrderCode",
                          "SimpleBootUpMaster", "SimpleBootUpSlave", "Granularity", "DynamicChannelsSupported",
                          "GroupMessaging", "LSS_Supported"})
    EXPECT_TRUE(eds.at("DeviceInfo").contains(key)) << key;
  Bench<> bench;
  bench.poll();
  EXPECT_EQ(bench.read(0x1018, 2), number(eds.at("DeviceInfo").at("ProductNumber"), 1));
  EXPECT_EQ(bench.read(0x1018, 3), number(eds.at("DeviceInfo").at("RevisionNumber"), 1));
  EXPECT_FALSE(eds.at("DeviceInfo").at("OrderCode").empty());
}

TEST(Eds, ErrorBehaviourIsAnArray) {
  const auto eds = parse_eds(robot());
  EXPECT_EQ(eds.at("1029").at("ObjectType"), "0x8");
  EXPECT_EQ(eds.at("1018").at("ObjectType"), "0x9");
}

TEST(Eds, ANodeOfOneJointSendsOnePdo) {
  BusDescription description = robot();
  description.outputs = 0x08;
  const auto eds = parse_eds(description);
  EXPECT_EQ(eds.at("DeviceInfo").at("NrOfRXPDO"), "6");
  EXPECT_EQ(eds.at("DeviceInfo").at("NrOfTXPDO"), "1");
  EXPECT_FALSE(eds.contains("1800"));
  EXPECT_EQ(eds.at("1803sub1").at("DefaultValue"), "0x40000184");
}

// --- DBC -------------------------------------------------------------------------------------------------------------

struct Signal {
  unsigned start = 0, bits = 0;
  bool is_signed = false;
  double factor = 0;
  std::string unit;
  double value(const std::uint8_t* data) const {
    std::uint64_t word = 0;
    for (unsigned i = 0; i < 8; ++i) word |= static_cast<std::uint64_t>(data[i]) << (8 * i);
    const std::uint64_t x = word >> start & (~std::uint64_t{0} >> (64 - bits));
    const bool negative = is_signed && (x >> (bits - 1) & 1U) != 0;
    return factor *
           (negative ? static_cast<double>(x) - std::ldexp(1.0, static_cast<int>(bits)) : static_cast<double>(x));
  }
};
struct Message {
  std::string name;
  unsigned size = 0;
  std::map<std::string, Signal> signals;
};

std::map<unsigned, Message> parse_dbc(const BusDescription& description) {
  std::ostringstream out;
  write_dbc(description, out);
  std::istringstream in(out.str());
  std::map<unsigned, Message> messages;
  const std::regex message(R"(BO_ (\d+) (\w+): (\d+) (\w+))");
  const std::regex signal(R"x( SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),0\) \[([^|]+)\|([^\]]+)\] "([^"]*)" (\w+))x");
  Message* last = nullptr;
  std::string nodes;
  for (std::string line; std::getline(in, line);) {
    std::smatch m;
    if (line.rfind("BU_:", 0) == 0) nodes = line;
    if (line.rfind("BO_", 0) == 0) {
      EXPECT_TRUE(std::regex_match(line, m, message)) << line;
      EXPECT_NE(nodes.find(m[4]), std::string::npos) << line;
      const auto [at, is_new] = messages.emplace(static_cast<unsigned>(std::stoul(m[1])), Message{});
      EXPECT_TRUE(is_new) << line;
      last = &at->second;
      last->name = m[2];
      last->size = static_cast<unsigned>(std::stoul(m[3]));
    }
    if (line.rfind(" SG_", 0) == 0) {
      EXPECT_TRUE(std::regex_match(line, m, signal)) << line;
      Signal s{static_cast<unsigned>(std::stoul(m[2])), static_cast<unsigned>(std::stoul(m[3])), m[4] == "-",
               std::stod(m[5]), m[8]};
      EXPECT_LT(std::stod(m[6]), std::stod(m[7])) << line;
      EXPECT_TRUE(last->signals.emplace(m[1], s).second) << line;
    }
  }
  return messages;
}

TEST(Dbc, SignalsFitTheirMessagesAndDoNotOverlap) {
  const auto messages = parse_dbc(robot());
  EXPECT_EQ(messages.size(), 2U + 1 + 12 + 2 + 1);
  for (const auto& [id, message] : messages) {
    std::uint64_t taken = 0;
    for (const auto& [name, s] : message.signals) {
      EXPECT_LE(s.start + s.bits, 8 * message.size) << message.name << "." << name;
      const std::uint64_t mask = (~std::uint64_t{0} >> (64 - s.bits)) << s.start;
      EXPECT_EQ(taken & mask, 0U) << message.name << "." << name;
      taken |= mask;
    }
  }
}

// Limits that differ by direction: 32768 is the larger one, for the node and for the file.
TEST(Dbc, ScalesAsTheNodeDoesWhereLimitsDiffer) {
  auto parameters = tables::page.parameters;
  auto& limits = parameters.constants[1].limits;
  limits.dq_lower.raw = -3 * (limits.dq_upper.raw / 2);
  limits.ddq_lower.raw = -2 * (limits.ddq_upper.raw / 3);
  Bench<> bench({.board = "bench"}, true, parameters);
  bench.poll();
  const auto dbc = parse_dbc(describe<test::Robot>(parameters, tables::rated_torque, version));
  const Message& setpoint = dbc.at(canopen::setpoint_id + 2);
  EXPECT_DOUBLE_EQ(setpoint.signals.at("Velocity").factor, std::ldexp(bench.read(0x2021, 2), -25 - 15));
  EXPECT_DOUBLE_EQ(setpoint.signals.at("Acceleration").factor, std::ldexp(bench.read(0x2022, 2), -22 - 15));
  EXPECT_NE(bench.read(0x2021, 2), static_cast<std::uint32_t>(limits.dq_upper.raw));
}

// A session on the bus, read with the DBC, gives the numbers that were meant.
TEST(Dbc, DecodesWhatIsOnTheBus) {
  const auto dbc = parse_dbc(robot());
  Bench<> bench;
  bench.start();
  for (std::size_t k = 0; k < 200; ++k) bench.tick(test::motion(k));
  bench.wire.sent.clear();
  const auto setpoints = test::motion(200);
  bench.tick(setpoints);
  std::size_t torques = 0;
  for (const auto& frame : bench.wire.sent) {
    ASSERT_TRUE(dbc.contains(frame.id)) << frame.id;
    const Message& message = dbc.at(frame.id);
    EXPECT_EQ(message.size, frame.size);
    const auto value = [&](const char* name) { return message.signals.at(name).value(frame.data.data()); };
    if (frame.id > 0x180 && frame.id <= 0x186) {
      const std::size_t j = frame.id - 0x181;
      ++torques;
      const double torque = std::ldexp(bench.node.torque(j), -22);
      EXPECT_NEAR(value("Torque"), torque, 0.5e-3);
      EXPECT_NEAR(value("PerMille"), 1e6 * torque / tables::rated_torque[j], 0.51);
      EXPECT_EQ(value("Tick"), 201);
      EXPECT_EQ(value("Fresh"), 1);
      EXPECT_EQ(value("Ramping"), 0);
      EXPECT_EQ(value("Enabled"), 1);
    } else if (frame.id > 0x200 && frame.id <= 0x206) {
      const std::size_t j = frame.id - 0x201;
      const auto& limits = tables::page.parameters.constants[j].limits;
      EXPECT_DOUBLE_EQ(value("Position"), std::ldexp(setpoints[j].q, -28));
      EXPECT_NEAR(value("Velocity"), std::ldexp(from_share(setpoints[j].dq, limits.dq_upper.raw), -25), 1e-7);
      EXPECT_NEAR(value("Acceleration"), std::ldexp(from_share(setpoints[j].ddq, limits.ddq_upper.raw), -22), 1e-6);
      EXPECT_EQ(message.signals.at("Position").unit, "rad");
    }
  }
  EXPECT_EQ(torques, 6U);
}

}  // namespace
}  // namespace fxdyn

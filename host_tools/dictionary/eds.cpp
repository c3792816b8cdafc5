#include <fmt/format.h>
#include <fmt/ostream.h>

#include <map>

#include "host_tools/dictionary/dictionary.hpp"

// CiA 306-1, "Electronic data sheet specification": sections and keys of an EDS.

namespace fxdyn {
namespace {

using dictionary::Access;
using dictionary::Default;
using dictionary::Described;
using dictionary::Entry;
using dictionary::Type;

enum class ObjectType : std::uint8_t { variable = 7, array = 8, record = 9 };

struct SubIndex {
  std::string name;
  Type type = Type::unsigned8;
  Access access = Access::constant;
  std::string value;  ///< default
  bool mappable = false;
  bool is_received = false;  ///< a received PDO writes it
  bool has_limits = false;
  std::int64_t lowest = 0, highest = 0;
};
struct IndexedObject {
  std::string name;
  ObjectType type = ObjectType::variable;
  std::map<int, SubIndex> subs;
};

/// Whether a setpoint's mapping names this object.
bool is_setpoint(std::uint16_t index) {
  for (std::size_t place = 1; place <= 3; ++place) {
    if (dictionary::mapping(false, place, 0) >> 16 == index) return true;
  }
  return false;
}

std::string with_unit(const Described& described) {
  std::string name = described.name;
  if (*described.unit != 0) name += fmt::format(" [{}]", described.unit);
  return name;
}

std::string default_value(const Described& described, std::size_t offset, std::size_t i) {
  using V = dictionary::Variable;
  const auto variable = described.entry.variable;
  if (variable == V::setpoint_mapping || variable == V::torque_mapping)
    return fmt::format("0x{:08X}",
                       dictionary::mapping(variable == V::torque_mapping, described.entry.sub_index, offset));
  if (variable == V::device_name) return dictionary::device_name;
  switch (described.kind) {
    case Default::none:
      return {};
    case Default::number:
      return fmt::format("0x{:X}", described.value);
    case Default::plus_node:
      return fmt::format("$NODEID+0x{:X}", described.value);
    case Default::plus_joint:
      return fmt::format("0x{:X}", described.value + offset + i + 1);
  }
  return {};
}

std::map<int, IndexedObject> objects_of(const BusDescription& description) {
  const dictionary::Extent extent = description.extent();
  std::map<int, IndexedObject> objects;
  for (const Described& described : dictionary::described) {
    const Entry& entry = described.entry;
    for (std::size_t offset = 0; offset < extent.joints; ++offset) {
      if (!extent.stands_at(entry, offset)) continue;
      IndexedObject& object = objects[entry.index + static_cast<int>(offset)];
      object.name = described.object;
      if (entry.times != dictionary::Times::one) object.name += fmt::format(" of joint {}", offset + 1);
      if (entry.array != 0)
        object.type = ObjectType::array;
      else if (entry.sub_index != 0)
        object.type = ObjectType::record;
      const std::size_t count = entry.array == 0 ? 1 : extent.length(entry);
      for (std::size_t i = 0; i < count; ++i) {
        SubIndex sub{with_unit(described),
                     entry.type,
                     entry.access,
                     default_value(described, offset, i),
                     described.mappable,
                     described.mappable && is_setpoint(entry.index),
                     false,
                     0,
                     0};
        if (entry.array != 0) sub.name = fmt::format("{} {}", described.name, i + 1);
        if (entry.access == Access::read_write && entry.type != Type::visible_string) {
          sub.has_limits = true;
          sub.lowest = entry.lowest;
          sub.highest = entry.variable == dictionary::Variable::cycle_period
                            ? std::int64_t{dictionary::longest_period_us(description.tick_us)}
                            : entry.highest;
        }
        object.subs[entry.sub_index + static_cast<int>(i)] = sub;
      }
    }
  }
  for (auto& [index, object] : objects) {
    if (object.type == ObjectType::variable || object.subs.contains(0)) continue;
    SubIndex highest;
    highest.name = "Highest sub-index supported";
    highest.value = fmt::format("{}", object.subs.rbegin()->first);
    object.subs[0] = highest;
  }
  return objects;
}

/// An object that a received PDO writes is `rww` (read and write, process output), the only type that CiA 306 has for
/// it, although SDO can't write it here.
const char* access_text(const SubIndex& sub) {
  if (sub.is_received) return "rww";
  return sub.access == Access::constant ? "const" : (sub.access == Access::read ? "ro" : "rw");
}

void write_variable(const SubIndex& sub, std::ostream& out) {
  fmt::print(out, "ParameterName={}\nObjectType=0x7\nDataType=0x{:04X}\nAccessType={}\n", sub.name,
             static_cast<int>(sub.type), access_text(sub));
  if (sub.has_limits) fmt::print(out, "LowLimit={}\nHighLimit={}\n", sub.lowest, sub.highest);
  fmt::print(out, "DefaultValue={}\nPDOMapping={}\n\n", sub.value, sub.mappable ? 1 : 0);
}

void write_list(const char* section, const std::vector<int>& indices, std::ostream& out) {
  fmt::print(out, "[{}]\nSupportedObjects={}\n", section, indices.size());
  for (std::size_t i = 0; i < indices.size(); ++i) fmt::print(out, "{}=0x{:04X}\n", i + 1, indices[i]);
  out << "\n";
}

// No clock: the same dictionary gives the same file.
constexpr const char *creation_time = "12:00AM", *creation_date = "01-01-2026";

}  // namespace

void write_eds(const BusDescription& description, const std::string& file_name, std::ostream& out) {
  const auto objects = objects_of(description);
  int outputs = 0;
  for (std::size_t j = 0; j < description.joints.size(); ++j) outputs += description.outputs >> j & 1U;
  fmt::print(
      out,
      "[FileInfo]\nFileName={}\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\nDescription=Torque feedforward of "
      "{} of {} joints\nCreationTime={}\nCreationDate={}\nCreatedBy=fxdyn {}\nModificationTime={}\n"
      "ModificationDate={}\nModifiedBy=fxdyn {}\n\n",
      file_name, outputs, description.joints.size(), creation_time, creation_date, description.software, creation_time,
      creation_date, description.software);
  out << "[DeviceInfo]\nVendorName=\nVendorNumber=0x0\nProductName=" << dictionary::device_name;
  fmt::print(out, "\nProductNumber=0x{:08X}\nRevisionNumber=0x{:08X}\nOrderCode={}\n", dictionary::product_code,
             description.revision, dictionary::device_name);
  for (const int rate : {10, 20, 50, 125, 250, 500, 800, 1000})
    fmt::print(out, "BaudRate_{}={}\n", rate, rate == 1000 ? 1 : 0);
  fmt::print(out,
             "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=0\nDynamicChannelsSupported=0\nCompactPDO=0\n"
             "GroupMessaging=0\nNrOfRXPDO={}\nNrOfTXPDO={}\nLSS_Supported=0\n\n",
             description.joints.size(), outputs);
  out << "[DummyUsage]\n";
  for (int type = 1; type <= 7; ++type) fmt::print(out, "Dummy{:04X}=0\n", type);
  out << "\n[Comments]\nLines=1\nLine1=Joint j is sub-index j of an array and index offset j - 1 of a PDO\n\n";

  std::vector<int> mandatory, optional, makers;
  for (const auto& [index, object] : objects) {
    if (index == 0x1000 || index == 0x1001 || index == 0x1018)
      mandatory.push_back(index);
    else
      (index >= 0x2000 && index < 0x6000 ? makers : optional).push_back(index);
  }
  const auto write_objects = [&](const std::vector<int>& indices) {
    for (const int index : indices) {
      const IndexedObject& object = objects.at(index);
      fmt::print(out, "[{:04X}]\n", index);
      if (object.type == ObjectType::variable) {
        write_variable(object.subs.at(0), out);
        continue;
      }
      fmt::print(out, "ParameterName={}\nObjectType=0x{:X}\nSubNumber={}\n\n", object.name,
                 static_cast<int>(object.type), object.subs.size());
      for (const auto& [sub_index, sub] : object.subs) {
        fmt::print(out, "[{:04X}sub{:X}]\n", index, sub_index);
        write_variable(sub, out);
      }
    }
  };
  write_list("MandatoryObjects", mandatory, out);
  write_objects(mandatory);
  write_list("OptionalObjects", optional, out);
  write_objects(optional);
  write_list("ManufacturerObjects", makers, out);
  write_objects(makers);
}

}  // namespace fxdyn

#include "host_tools/readers/log_reader.hpp"

#include <algorithm>
#include <cctype>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/bags/bag.hpp"

namespace fxdyn {
namespace {

/// The last one reads what no other knows.
constexpr std::array readers{
    LogReader{"mcap", ".mcap", read_bag_log, is_bag, bag_columns, true},
    LogReader{"rosbag2", ".db3", read_bag_log, is_bag, bag_columns, true},
    LogReader{"matlab", ".mat", read_array_log, is_matlab, array_columns},
    LogReader{"hdf5", ".h5", read_array_log, is_hdf5, array_columns},
    LogReader{"parquet", ".parquet", read_array_log, is_parquet, array_columns},
    LogReader{"candump", ".candump", read_can_log, is_can_log, can_columns},
    LogReader{"csv", ".csv", read_csv},
};

}  // namespace

std::span<const LogReader> log_readers() { return readers; }

const LogReader& reader_of(const std::filesystem::path& file, std::span<const LogReader> all) {
  const auto own = std::find_if(all.begin(), all.end(),
                                [&](const LogReader& reader) { return reader.knows != nullptr && reader.knows(file); });
  if (own != all.end()) return *own;
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const LogReader& reader) { return reader.extension == extension; });
  return found == all.end() ? all.back() : *found;
}

std::vector<std::string> joint_columns_of(const std::string& signal, const std::vector<std::string>& joints) {
  static const std::map<std::string, const char*> fields{
      {"q", ".position"}, {"dq", ".velocity"}, {"ddq", ".acceleration"}, {"tau", ".effort"}};
  std::vector<std::string> out;
  const auto field = fields.find(signal);
  if (field == fields.end()) return out;
  for (const std::string& joint : joints) out.push_back(joint + field->second);
  return out;
}

Log read_log(const std::filesystem::path& file, std::size_t joints, const std::vector<bool>& revolute,
             const LogFormat& format, std::optional<double> from_s, std::optional<double> to_s, bool torque_required) {
  const auto read = [](const LogRequest& request) { return reader_of(request.file).read(request); };
  return uniform_log(read, file, joints, revolute, format, from_s, to_s, torque_required);
}

LogFormat with_joint_names(const std::filesystem::path& file, LogFormat format,
                           const std::vector<std::string>& joints) {
  if (!reader_of(file).names_joints) return format;
  for (const char* signal : signal_names) {
    if (format.columns.contains(signal) || format.joint_columns.contains(signal)) continue;
    const std::vector<std::string> names = joint_columns_of(signal, joints);
    if (!names.empty()) format.joint_columns[signal] = names;
  }
  return format;
}

}  // namespace fxdyn

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "host_tools/bags/joint_recording.hpp"
#include "host_tools/readers/column_cut.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Names = std::vector<std::string>;

std::string topic_of(const LogFormat& format) {
  const auto found = format.columns.find(topic_key);
  return found == format.columns.end() ? "" : found->second;
}

/// Which one to take where several would do: the name that drivers use, then the type that carries measured torque.
int rank_of(const JointTopic& topic) {
  if (topic.name == "/joint_states") return 0;
  return topic.type.ends_with("/JointState") ? 1 : 2;
}

std::string listed(const JointTopic& topic) {
  Names joints;
  for (const JointStream& stream : topic.streams)
    for (const std::string& joint : stream.joints)
      if (std::find(joints.begin(), joints.end(), joint) == joints.end()) joints.push_back(joint);
  return fmt::format("{} ({}) of {}", topic.name, topic.type,
                     joints.empty() ? "no joints" : fmt::format("{}", fmt::join(joints, ", ")));
}

[[noreturn]] void no_joint_states(const JointRecording& recording, const std::string& where, const std::string& topic) {
  Names others;
  for (const BagTopic& other : recording.others) others.push_back(fmt::format("{} ({})", other.name, other.type));
  constexpr std::size_t most = 12;  // a robot has hundreds
  const std::size_t all = others.size();
  if (all > most) others.resize(most);
  const std::string what = topic.empty() ? "no joint states" : fmt::format("no joint states on topic {}", topic);
  throw InputError(
      fmt::format("{}: {}: it has {}{}; record sensor_msgs/msg/JointState, as in ros2 bag record "
                  "/joint_states, or name its topic: topic = \"/..\"",
                  where, what, all == 0 ? "no topics" : fmt::format("{}", fmt::join(others, ", ")),
                  all > most ? fmt::format(" and {} others", all - most) : ""));
}

/// Names of a project's joint columns; empty: they are numbered, or not of this signal.
Names named(const LogFormat& format, const char* signal) {
  const auto found = format.joint_columns.find(signal);
  return found == format.joint_columns.end() ? Names() : found->second;
}

std::vector<std::string> missing_of(const JointTopic& topic, const Names& wanted) {
  const Names has = column_names(topic);
  Names out;
  for (const std::string& name : wanted)
    if (std::find(has.begin(), has.end(), name) == has.end()) out.push_back(name);
  return out;
}

/// What to say where a topic lacks columns: that it has other joints, or no torque.
[[noreturn]] void lacks(const JointRecording& recording, const JointTopic& nearest, const Names& wanted,
                        const std::string& where) {
  const Names gone = missing_of(nearest, wanted), has = column_names(nearest);
  const std::string joint = gone.front().substr(0, gone.front().find('.'));
  const bool knows_joint =
      std::any_of(has.begin(), has.end(), [&](const std::string& name) { return name.starts_with(joint + "."); });
  if (knows_joint && gone.front().ends_with(".effort"))
    throw InputError(
        fmt::format("{}: {} has no {}: its driver measures no torque (effort is empty or NaN in every "
                    "message); it has {}",
                    where, nearest.name, fmt::join(gone, ", "), fmt::join(has, ", ")));
  Names topics;
  for (const JointTopic& topic : recording.topics) topics.push_back(listed(topic));
  throw InputError(
      fmt::format("{}: no topic has {}: there is {}; name the columns of its joints, as in columns = {{ q = "
                  "[\"{}\", ..], tau = [..] }}",
                  where, fmt::join(gone, ", "), fmt::join(topics, "; "), has.size() > 1 ? has[1] : "JOINT.position"));
}

JointTopic& choose(JointRecording& recording, const Names& wanted, const std::string& where, const std::string& topic) {
  if (recording.topics.empty()) no_joint_states(recording, where, topic);
  std::vector<JointTopic*> able;
  for (JointTopic& one : recording.topics)
    if (one.trouble.empty() && one.messages > 0 && missing_of(one, wanted).empty()) able.push_back(&one);
  std::stable_sort(able.begin(), able.end(),
                   [](const JointTopic* a, const JointTopic* b) { return rank_of(*a) < rank_of(*b); });
  if (able.size() > 1 && rank_of(*able[0]) == rank_of(*able[1]))
    throw InputError(fmt::format("{}: {} and {} both have these joints; write topic = \"{}\", or the other one", where,
                                 able[0]->name, able[1]->name, able[0]->name));
  if (!able.empty()) return *able.front();
  for (const JointTopic& one : recording.topics)
    if (!one.trouble.empty()) throw InputError(fmt::format("{}: {}: {}", where, one.name, one.trouble));
  const auto nearest =
      std::min_element(recording.topics.begin(), recording.topics.end(), [&](const JointTopic& a, const JointTopic& b) {
        return missing_of(a, wanted).size() < missing_of(b, wanted).size();
      });
  if (nearest->messages == 0)
    throw InputError(fmt::format("{}: {} has no messages: was the driver running?", where, nearest->name));
  lacks(recording, *nearest, wanted, where);
}

/// Velocities and accelerations that nobody has asked for by name, and that are not there: differentiated from q.
void leave_out_absent(LogFormat& format, const JointTopic& topic) {
  for (const auto& [signal, field] : {std::pair("dq", ".velocity"), std::pair("ddq", ".acceleration")}) {
    const Names names = named(format, signal);
    const bool by_default =
        std::all_of(names.begin(), names.end(), [end = field](const std::string& name) { return name.ends_with(end); });
    if (names.empty() || !by_default || missing_of(topic, names).empty()) continue;
    format.joint_columns.erase(signal);
    format.columns[signal] = "";
  }
}

}  // namespace

RecordedLog read_bag_log(const LogRequest& request) {
  const std::string file = request.file.string(), topic_name = topic_of(request.columns);
  JointRecording recording = read_joint_recording(request.file, topic_name);
  Names wanted = named(request.columns, "q");
  if (request.torque_required)
    for (const std::string& name : named(request.columns, "tau")) wanted.push_back(name);
  JointTopic& topic = choose(recording, wanted, file, topic_name);
  const std::string where = fmt::format("{}: {}", file, topic.name);
  LogFormat format = request.columns;
  leave_out_absent(format, topic);
  if (!request.torque_required && !missing_of(topic, named(format, "tau")).empty()) {
    format.joint_columns.erase("tau");
    format.columns["tau"] = "";
  }
  const ColumnLayout layout =
      ColumnNames(where, column_names(topic)).layout(request.joints, format, request.torque_required);
  const Names names(layout.names.begin() + 1, layout.names.end());
  JointTable table = take_table(topic, names, where);
  if (table.columns[0].size() < 2) throw InputError(where + ": fewer than 2 messages");
  std::string note = recording.note;
  if (!table.note.empty()) note += (note.empty() ? "" : "; ") + table.note;
  ColumnTable rows = cut_rows(std::move(table.columns), layout.names, request, where, note);
  const double first_t = rows.first_t, last_t = rows.last_t;
  Log log = to_log(std::move(rows), layout, request.joints);
  log.time_note = note;
  return {std::move(log), first_t, last_t, true};
}

std::vector<LogColumns> bag_columns(const std::filesystem::path& file) {
  JointRecording recording = read_joint_recording(file);
  if (recording.topics.empty()) no_joint_states(recording, file.string(), "");
  std::stable_sort(recording.topics.begin(), recording.topics.end(),
                   [](const JointTopic& a, const JointTopic& b) { return rank_of(a) < rank_of(b); });
  std::vector<LogColumns> out;
  std::string trouble;
  for (const JointTopic& topic : recording.topics) {
    if (!topic.trouble.empty()) trouble = fmt::format("{}: {}: {}", file.string(), topic.name, topic.trouble);
    if (topic.trouble.empty() && topic.messages > 0) out.push_back({topic.name, column_names(topic)});
  }
  if (out.empty())
    throw InputError(trouble.empty() ? file.string() + ": its topics have no messages: was the driver running?"
                                     : trouble);
  return out;
}

}  // namespace fxdyn

// Frames of a CAN bus as `candump -L` (or `-ta`) of can-utils writes them: a row at every SYNC (CiA 301). What a drive
// sends was sampled at the SYNC before it, what it receives counts at the SYNC after it (7.5.2.2, transmission type 1).

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <map>
#include <optional>

#include "firmware/protocol/canopen.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "host_tools/bytes/text_file.hpp"
#include "host_tools/readers/column_cut.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using canopen::setpoint_id;
using canopen::sync_id;
using canopen::torque_id;

constexpr std::size_t most_bytes = 64;  // of a frame

struct Frame {
  double t = 0;
  std::uint32_t id = 0;
  std::array<std::uint8_t, most_bytes> data{};
  std::size_t size = 0;
  bool carries_data = true;  ///< false: a remote request, or an error that the controller told
};

/// What is in front of the next blank; the text goes on behind it.
std::string_view word(std::string_view& text) {
  text = text.substr(std::min(text.find_first_not_of(" \t\r"), text.size()));
  const std::size_t end = std::min(text.find_first_of(" \t\r"), text.size());
  const std::string_view out = text.substr(0, end);
  text.remove_prefix(end);
  return out;
}

template <class Number>
bool read_number(std::string_view text, Number& out, int base) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out, base);
  return error == std::errc() && end == text.data() + text.size();
}

bool append_bytes(std::string_view text, Frame& frame) {
  for (; !text.empty(); text.remove_prefix(2)) {
    if (text.size() < 2 || frame.size == most_bytes || !read_number(text.substr(0, 2), frame.data[frame.size], 16))
      return false;
    ++frame.size;
  }
  return true;
}

/// An identifier: three digits, or eight of the extended format.
bool read_id(std::string_view text, Frame& frame) {
  constexpr std::uint32_t error_frame = 0x2000'0000;
  if ((text.size() != 3 && text.size() != 8) || !read_number(text, frame.id, 16)) return false;
  frame.carries_data = (frame.id & error_frame) == 0;
  return true;
}

/// `181#0102..`, `181##1..` (CAN FD, one digit of flags), `181#R8`
bool read_short_frame(std::string_view text, Frame& frame) {
  const std::size_t mark = text.find('#');
  if (!read_id(text.substr(0, mark), frame)) return false;
  text.remove_prefix(mark + 1);
  if (text.starts_with('R')) frame.carries_data = false;
  if (text.starts_with('#')) text.remove_prefix(std::min<std::size_t>(2, text.size()));
  return !frame.carries_data || append_bytes(text, frame);
}

/// `181   [8]  01 02 ..`
bool read_long_frame(std::string_view id, std::string_view rest, Frame& frame) {
  if (!read_id(id, frame) || !word(rest).starts_with('[')) return false;
  for (std::string_view byte = word(rest); !byte.empty(); byte = word(rest)) {
    if (byte == "remote" || byte == "ERRORFRAME") {
      frame.carries_data = false;
      return true;
    }
    if (byte.front() == '\'') break;  // the same as characters
    if (!append_bytes(byte, frame)) return false;
  }
  return true;
}

/// `(1436509052.249713) can0 ..`
std::optional<Frame> frame_of(std::string_view line) {
  Frame frame;
  const std::string_view stamp = word(line), interface = word(line), content = word(line);
  if (stamp.size() < 3 || stamp.front() != '(' || stamp.back() != ')' || interface.empty()) return std::nullopt;
  const std::string_view number = stamp.substr(1, stamp.size() - 2);
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), frame.t);
  if (error != std::errc() || end != number.data() + number.size()) return std::nullopt;
  const bool is_short = content.find('#') != std::string_view::npos;
  const bool good = is_short ? read_short_frame(content, frame) : read_long_frame(content, line, frame);
  return good ? std::optional(frame) : std::nullopt;
}

template <class Visit>
void each_frame(MappedFile& file, const std::string& where, Visit&& visit) {
  LineReader lines(file.text());
  for (std::string_view line; lines.next(line);) {
    const std::optional<Frame> frame = frame_of(line);
    if (!frame) {
      throw InputError(fmt::format("{}:{}: '{}' is no frame; record with candump -L, and keep whole lines", where,
                                   lines.number(), line.substr(0, 40)));
    }
    if (frame->carries_data) visit(*frame);
  }
}

/// A number in the frames of one identifier, as "181.i32.0" says it: identifier, type, first byte (little endian).
struct Field {
  std::uint32_t id = 0;
  std::size_t bytes = 0, offset = 0;
  bool is_signed = false, is_float = false;
  double scale = 1;

  std::size_t end() const { return offset + bytes; }
  double value(const Frame& frame) const {
    std::uint32_t raw = 0;
    for (std::size_t i = 0; i < bytes; ++i) raw |= static_cast<std::uint32_t>(frame.data[offset + i]) << (8 * i);
    if (is_float) return scale * std::bit_cast<float>(raw);
    const int unused = 32 - 8 * static_cast<int>(bytes);
    const auto number = static_cast<std::int32_t>(raw << unused) >> unused;
    return scale * (is_signed ? static_cast<double>(number) : static_cast<double>(raw));
  }
};

std::optional<Field> field_of(std::string_view name) {
  const std::size_t first = name.find('.'), second = name.rfind('.');
  if (first == std::string_view::npos || second == first || second < first + 3) return std::nullopt;
  Frame frame;
  Field field;
  std::size_t bits = 0;
  const std::string_view type = name.substr(first + 1, second - first - 1);
  if (!read_id(name.substr(0, first), frame) || !read_number(type.substr(1), bits, 10) ||
      !read_number(name.substr(second + 1), field.offset, 10))
    return std::nullopt;
  field.id = frame.id;
  field.bytes = bits / 8;
  field.is_signed = type.front() == 'i';
  field.is_float = type.front() == 'f';
  const bool known = field.is_float ? bits == 32 : (bits == 8 || bits == 16 || bits == 32);
  const bool fits = field.offset < most_bytes && field.end() <= most_bytes;
  return known && fits && (field.is_signed || field.is_float || type.front() == 'u') ? std::optional(field)
                                                                                     : std::nullopt;
}

/// What a bus carries.
struct Bus {
  struct Identifier {
    std::size_t frames = 0, bytes = std::numeric_limits<std::size_t>::max();  ///< of the shortest
    std::uint8_t tick = 0;
    std::size_t counted = 0;  ///< frames whose tick is one more than that of the frame before
  };
  std::map<std::uint32_t, Identifier> ids;
  std::size_t rows() const { return ids.contains(sync_id) ? ids.at(sync_id).frames : 0; }
  /// Nodes with such frames at nearly every SYNC.
  std::vector<std::uint32_t> nodes(std::uint32_t first_id, std::size_t bytes) const {
    std::vector<std::uint32_t> out;
    for (std::uint32_t node = 1; node <= canopen::largest_node_id; ++node) {
      const auto found = ids.find(first_id + node);
      if (found != ids.end() && found->second.bytes >= bytes && found->second.frames > rows() / 2) out.push_back(node);
    }
    return out;
  }
};

Bus scan(MappedFile& file, const std::string& where) {
  Bus bus;
  each_frame(file, where, [&](const Frame& frame) {
    Bus::Identifier& one = bus.ids[frame.id];
    ++one.frames;
    one.bytes = std::min(one.bytes, frame.size);
    if (frame.size < WireTorque::bytes) return;
    const std::uint8_t tick = WireTorque::load(frame.data.data()).tick;
    one.counted += tick == static_cast<std::uint8_t>(one.tick + 1) ? 1 : 0;
    one.tick = tick;
  });
  return bus;
}

/// The columns of a bus by name.
struct Signals {
  std::vector<std::string> names{"t"};
  std::vector<Field> fields;  ///< of all names but t
  bool of_node = false;       ///< setpoints and torques of fxdyn's drive node
  void add(std::string name, const Field& field) {
    names.push_back(std::move(name));
    fields.push_back(field);
  }
};

/// q1.., tau1.. of what is known: fxdyn's drive node, whose torques count the ticks; else CiA 402 with the drive's
/// position (0x6064) and torque (0x6077) in its first PDO.
Signals known_signals(const Bus& bus) {
  Signals out;
  const std::vector<std::uint32_t> torques = bus.nodes(torque_id, WireTorque::bytes);
  const auto counts = [&](std::uint32_t node) {
    const Bus::Identifier& one = bus.ids.at(torque_id + node);
    return one.counted > one.frames * 3 / 4;
  };
  out.of_node = !torques.empty() && std::all_of(torques.begin(), torques.end(), counts) &&
                bus.nodes(setpoint_id, WireSetpoint::bytes) == torques;
  const Field position{.bytes = 4, .is_signed = true}, torque{.bytes = 2, .offset = 4, .is_signed = true};
  const Field milli{.bytes = 4, .offset = 2, .is_signed = true, .scale = 1e-3};
  std::size_t joint = 0;
  for (const std::uint32_t node : out.of_node ? torques : bus.nodes(torque_id, torque.end())) {
    Field q = position, tau = out.of_node ? milli : torque;
    q.id = (out.of_node ? setpoint_id : torque_id) + node;
    tau.id = torque_id + node;
    out.add(fmt::format("q{}", ++joint), q);
    out.add(fmt::format("tau{}", joint), tau);
  }
  return out;
}

/// The columns that a project names by their frames, as far as the bus has them.
void add_named(const LogFormat& format, const Bus& bus, Signals& signals) {
  for (const auto& [signal, names] : format.joint_columns) {
    for (const std::string& name : names) {
      const std::optional<Field> field = field_of(name);
      if (!field || std::find(signals.names.begin(), signals.names.end(), name) != signals.names.end()) continue;
      const auto found = bus.ids.find(field->id);
      if (found != bus.ids.end() && found->second.bytes >= field->end()) signals.add(name, *field);
    }
  }
}

/// PDOs that a node receives (CiA 301, table 38): their content is of the SYNC after them.
bool is_received(std::uint32_t id) {
  const std::uint32_t function = id & 0x780;
  return id < 0x800 && (function == 0x200 || function == 0x300 || function == 0x400 || function == 0x500);
}

/// SyncRows at SYNC, as the frames come.
class SyncRows {
 public:
  SyncRows(const Signals& signals, std::vector<bool> wanted)
      : signals_(signals), wanted_(std::move(wanted)), columns_(signals.names.size()) {
    next_.assign(signals.fields.size(), none);
    now_ = next_;
    for (std::size_t c = 0; c < signals.fields.size(); ++c) by_id_[signals.fields[c].id].push_back(c);
  }
  void take(const Frame& frame) {
    if (frame.id == sync_id) return sync(frame.t);
    const auto found = by_id_.find(frame.id);
    if (found == by_id_.end()) return;
    if (signals_.of_node && !is_received(frame.id) && !is_models_torque(frame)) held_back_ = true;
    for (const std::size_t c : found->second) {
      std::vector<double>& values = is_received(frame.id) ? next_ : now_;
      if (frame.size >= signals_.fields[c].end()) values[c] = signals_.fields[c].value(frame);
    }
  }
  std::vector<std::vector<double>> finish() {
    close();
    return std::move(columns_);
  }
  std::size_t incomplete() const { return incomplete_; }
  std::size_t held_back() const { return count_held_back_; }

 private:
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();

  static bool is_models_torque(const Frame& frame) {
    constexpr std::uint8_t plain = torque_status::fresh | torque_status::enabled;
    return frame.size >= WireTorque::bytes &&
           (WireTorque::load(frame.data.data()).status & (plain | torque_status::ramping)) == plain;
  }
  void sync(double t) {
    close();
    at_ = t;
    for (std::size_t c = 0; c < now_.size(); ++c) now_[c] = is_received(signals_.fields[c].id) ? next_[c] : none;
    next_.assign(next_.size(), none);
  }
  void close() {
    if (!at_) return;
    bool whole = true;
    for (std::size_t c = 0; c < now_.size(); ++c) whole = whole && (!wanted_[c] || !std::isnan(now_[c]));
    incomplete_ += whole ? 0 : 1;
    count_held_back_ += whole && held_back_ ? 1 : 0;
    if (whole && !held_back_) {
      columns_[0].push_back(*at_);
      for (std::size_t c = 0; c < now_.size(); ++c) columns_[c + 1].push_back(now_[c]);
    }
    held_back_ = false;
  }

  const Signals& signals_;
  std::vector<bool> wanted_;  ///< by field: a row needs it
  std::map<std::uint32_t, std::vector<std::size_t>> by_id_;
  std::optional<double> at_;  ///< the last SYNC
  std::vector<double> now_, next_;
  std::vector<std::vector<double>> columns_;
  bool held_back_ = false;
  std::size_t incomplete_ = 0, count_held_back_ = 0;
};

void check_bus(const Bus& bus, const Signals& signals, const std::string& where) {
  std::vector<std::string> ids;
  for (const auto& [id, one] : bus.ids) ids.push_back(fmt::format("{:03X} ({} bytes)", id, one.bytes));
  constexpr std::size_t most = 12;
  const std::string more = ids.size() > most ? fmt::format(" and {} others", ids.size() - most) : "";
  if (ids.size() > most) ids.resize(most);
  const std::string has = fmt::format("it has {}{}", fmt::join(ids, ", "), more);
  if (bus.rows() < 2) {
    throw InputError(
        fmt::format("{}: no SYNC (080) on this bus, which would say which frames belong together: {}; make "
                    "a CSV of it, as the guide \"My log is from ..\" shows",
                    where, ids.empty() ? "it has no frames" : has));
  }
  if (signals.fields.empty()) {
    throw InputError(
        fmt::format("{}: no frames 181 .. 1FF with position and torque at every SYNC: {}; name the columns "
                    "by identifier, type and first byte, as in columns = {{ q = [\"281.i32.0\", ..], tau = "
                    "[\"381.i16.2\", ..] }}",
                    where, has));
  }
}

std::string note_of(const Signals& signals, const SyncRows& rows) {
  std::string out = signals.of_node
                        ? "frames of fxdyn's node: q are setpoints in raw units (position_gain = 2^-bits of "
                          "object 0x2020:1), tau is what the node put out and no measurement"
                        : "";
  if (rows.held_back() > 0)
    out += fmt::format("; {} ticks left out that ramped, were stale or not enabled", rows.held_back());
  if (rows.incomplete() > 1) {
    out += fmt::format("{}{} SYNC without all the frames are left out", out.empty() ? "" : "; ", rows.incomplete());
  }
  return out;
}

}  // namespace

bool is_can_log(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  std::string bytes(64, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const bool packed = bytes.starts_with("\x1F\x8B") || bytes.starts_with("\x28\xB5\x2F\xFD");
  if (packed ? file.stem().extension() == ".csv" : bytes.find('(') == std::string::npos) return false;
  MappedFile mapped(file.string());
  LineReader lines(mapped.text());
  std::string_view line;
  return lines.next(line) && frame_of(line).has_value();
}

RecordedLog read_can_log(const LogRequest& request) {
  const std::string where = request.file.string();
  MappedFile mapped(where);
  const Bus bus = scan(mapped, where);
  Signals signals = known_signals(bus);
  add_named(request.columns, bus, signals);
  check_bus(bus, signals, where);
  const ColumnLayout layout =
      ColumnNames(where, signals.names).layout(request.joints, request.columns, request.torque_required);
  std::vector<bool> wanted;
  for (std::size_t c = 1; c < signals.names.size(); ++c)
    wanted.push_back(std::find(layout.names.begin(), layout.names.end(), signals.names[c]) != layout.names.end());
  SyncRows rows(signals, wanted);
  each_frame(mapped, where, [&](const Frame& frame) { rows.take(frame); });
  std::vector<std::vector<double>> all = rows.finish(), used;
  for (const std::string& name : layout.names) {
    const auto place = std::find(signals.names.begin(), signals.names.end(), name) - signals.names.begin();
    used.push_back(std::move(all[static_cast<std::size_t>(place)]));
  }
  std::string note = note_of(signals, rows);
  if (used[0].size() < 2)
    throw InputError(
        fmt::format("{}: no two SYNC with all the frames behind them{}{}", where, note.empty() ? "" : ": ", note));
  ColumnTable table = cut_rows(std::move(used), layout.names, request, where, note);
  const double first_t = table.first_t, last_t = table.last_t;
  Log log = to_log(std::move(table), layout, request.joints);
  log.time_note = note;
  return {std::move(log), first_t, last_t, true};
}

std::vector<LogColumns> can_columns(const std::filesystem::path& file) {
  MappedFile mapped(file.string());
  const Bus bus = scan(mapped, file.string());
  const Signals signals = known_signals(bus);
  check_bus(bus, signals, file.string());
  return {{"", signals.names}};
}

}  // namespace fxdyn

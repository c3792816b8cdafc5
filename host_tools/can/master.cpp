#include "host_tools/can/master.hpp"

#include <algorithm>
#include <cstdio>

namespace fxdyn::can {
namespace {

// Command specifiers of SDO, CiA 301, 7.2.4.3: the client's, and the server's answers.
constexpr std::uint8_t initiate_download = 0x20, initiate_upload = 0x40, upload_segment = 0x60, abort_transfer = 0x80;
constexpr std::uint8_t downloaded = 0x60, segment_downloaded = 0x20;
constexpr std::uint8_t toggle = 0x10, expedited = 0x02, size_is_given = 0x01, last_segment = 0x01;
constexpr std::size_t segment_bytes = 7;
/// An answer that was sent before the node's boot-up message has come by then.
constexpr Duration after_boot_up = std::chrono::milliseconds(200);

std::string object_name(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "node %u, object 0x%04X:%02X", node, index, sub_index);
  return text.data();
}

}  // namespace

std::string to_text(canopen::NmtState state) {
  switch (state) {
    case canopen::NmtState::initialising:
      return "initialising";
    case canopen::NmtState::stopped:
      return "stopped";
    case canopen::NmtState::operational:
      return "operational";
    case canopen::NmtState::pre_operational:
      return "pre-operational";
  }
  return "in an unknown state";
}

void Master::command(canopen::NmtCommand command, std::uint8_t node) {
  bus_.send({.id = canopen::nmt_id, .size = 2, .data = {static_cast<std::uint8_t>(command), node}});
}

void Master::heartbeat(std::uint8_t node, canopen::NmtState state) {
  bus_.send({.id = canopen::heartbeat_id + node, .size = 1, .data = {static_cast<std::uint8_t>(state)}});
}

void Master::dispatch(const Frame& frame) {
  if (frame.extended || frame.remote) {
    if (other) other(frame);
    return;
  }
  const auto node = static_cast<std::uint8_t>(frame.id & 127U);
  const std::uint32_t function = frame.id & ~127U;
  if (function == canopen::heartbeat_id && node != 0 && frame.size == 1) {
    heartbeats_[node].state = static_cast<canopen::NmtState>(frame.data[0] & 127U);
    ++heartbeats_[node].count;
    heartbeats_[node].last = bus_.now();
  } else if (function == canopen::emergency_id && node != 0 && frame.size == 8) {
    Emergency emergency{node, static_cast<std::uint16_t>(canopen::load<2>(frame.data.data())), frame.data[2], {}};
    std::copy_n(frame.data.begin() + 3, emergency.detail.size(), emergency.detail.begin());
    emergencies.push_back(emergency);
  } else if (other) {
    other(frame);
  }
}

void Master::listen(Duration time) {
  const Duration end = bus_.now() + time;
  Frame frame;
  for (Duration left = time; left.count() > 0; left = end - bus_.now()) {
    if (bus_.receive(frame, left)) dispatch(frame);
  }
}

void Master::wait_for(std::uint8_t node, canopen::NmtState state, Duration timeout) {
  const std::uint32_t before = heartbeat_of(node).count;
  const Duration end = bus_.now() + timeout;
  Frame frame;
  for (Duration left = timeout; left.count() > 0; left = end - bus_.now()) {
    if (bus_.receive(frame, left)) dispatch(frame);
    if (heartbeat_of(node).count != before && heartbeat_of(node).state == state) return;
  }
  throw NodeError(heartbeat_of(node).count == 0
                      ? "node " + std::to_string(node) +
                            " does not answer: its power, its node id, the bit rate; `candump` shows what is on the bus"
                      : "node " + std::to_string(node) + " is " + to_text(heartbeat_of(node).state) + " and not " +
                            to_text(state) + ": its error history is object 0x1003");
}

void Master::reset(std::uint8_t node, Duration timeout) {
  constexpr int most_boot_ups = 3;  // of its start, of the command, and one of another master's
  command(canopen::NmtCommand::reset_node, node);
  wait_for(node, canopen::NmtState::initialising, timeout);
  for (int boot_up = 1;; ++boot_up) {
    try {
      static_cast<void>(read(node, 0x1000, 0));
      return;
    } catch (const SdoAbort&) {
      return;  // it is there
    } catch (const NodeRestarted&) {
      if (boot_up == most_boot_ups) throw;
    }
  }
}

Master::Bytes Master::exchange(std::uint8_t node, const Bytes& request, std::uint16_t index, std::uint8_t sub_index) {
  Frame frame{.id = canopen::sdo_request_id + node, .size = 8};
  std::copy(request.begin(), request.end(), frame.data.begin());
  bus_.send(frame);
  Duration end = bus_.now() + sdo_timeout;
  bool restarted = false;
  for (Duration left = sdo_timeout; left.count() > 0; left = end - bus_.now()) {
    if (!bus_.receive(frame, left)) continue;
    if (frame.id != canopen::sdo_answer_id + node || frame.extended || frame.size != 8) {
      const std::uint32_t heartbeats = heartbeat_of(node).count;
      dispatch(frame);
      if (heartbeat_of(node).count != heartbeats && heartbeat_of(node).state == canopen::NmtState::initialising) {
        restarted = true;
        end = std::min(end, bus_.now() + after_boot_up);
      }
      continue;
    }
    Bytes answer;
    std::copy_n(frame.data.begin(), answer.size(), answer.begin());
    if (answer[0] == abort_transfer) {
      const std::uint32_t code = canopen::load<4>(&answer[4]);
      std::array<char, 48> text{};
      std::snprintf(text.data(), text.size(), ": aborted with code 0x%08X", code);
      throw SdoAbort(object_name(node, index, sub_index) + text.data(), static_cast<canopen::Abort>(code));
    }
    return answer;
  }
  if (restarted)
    throw NodeRestarted(object_name(node, index, sub_index) +
                        ": no answer but a boot-up message: it restarted; its supply, or another master's reset?");
  throw NodeError(object_name(node, index, sub_index) +
                  ": no answer: its power, its node id, the bit rate; `candump` shows what is on the bus");
}

void Master::protocol_error(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index) {
  bus_.send({.id = canopen::sdo_request_id + node,
             .size = 8,
             .data = {abort_transfer, static_cast<std::uint8_t>(index & 255U), static_cast<std::uint8_t>(index >> 8),
                      sub_index, 1, 0, 4, 5}});
  throw NodeError(object_name(node, index, sub_index) +
                  ": an answer that is none to what was asked: two masters, or two nodes with one id?");
}

std::vector<std::uint8_t> Master::upload(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index) {
  Bytes request{initiate_upload, static_cast<std::uint8_t>(index & 255U), static_cast<std::uint8_t>(index >> 8),
                sub_index};
  Bytes answer = exchange(node, request, index, sub_index);
  if ((answer[0] & 0xE0U) != initiate_upload ||
      !std::equal(request.begin() + 1, request.begin() + 4, answer.begin() + 1)) {
    protocol_error(node, index, sub_index);
  }
  if ((answer[0] & expedited) != 0) {
    const std::size_t size = (answer[0] & size_is_given) != 0 ? 4U - (answer[0] >> 2 & 3U) : 4U;
    return {answer.begin() + 4, answer.begin() + 4 + static_cast<std::ptrdiff_t>(size)};
  }
  const bool size_given = (answer[0] & size_is_given) != 0;
  const std::size_t expected = canopen::load<4>(&answer[4]);
  std::vector<std::uint8_t> bytes;
  std::uint8_t bit = 0;
  do {
    answer = exchange(node, {static_cast<std::uint8_t>(upload_segment | bit)}, index, sub_index);
    if ((answer[0] & 0xE0U) != 0 || (answer[0] & toggle) != bit) protocol_error(node, index, sub_index);
    const std::size_t count = segment_bytes - (answer[0] >> 1 & 7U);
    bytes.insert(bytes.end(), answer.begin() + 1, answer.begin() + 1 + static_cast<std::ptrdiff_t>(count));
    bit ^= toggle;
  } while ((answer[0] & last_segment) == 0);
  if (size_given && bytes.size() != expected) protocol_error(node, index, sub_index);
  return bytes;
}

void Master::download(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index,
                      std::span<const std::uint8_t> bytes) {
  Bytes request{initiate_download | size_is_given, static_cast<std::uint8_t>(index & 255U),
                static_cast<std::uint8_t>(index >> 8), sub_index};
  const bool short_value = !bytes.empty() && bytes.size() <= 4;
  if (short_value) {
    request[0] = static_cast<std::uint8_t>(request[0] | expedited | (4 - bytes.size()) << 2);
    std::copy(bytes.begin(), bytes.end(), request.begin() + 4);
  } else {
    canopen::store<4>(&request[4], static_cast<std::uint32_t>(bytes.size()));
  }
  const Bytes answer = exchange(node, request, index, sub_index);
  if (answer[0] != downloaded || !std::equal(request.begin() + 1, request.begin() + 4, answer.begin() + 1)) {
    protocol_error(node, index, sub_index);
  }
  if (short_value) return;
  std::uint8_t bit = 0;
  do {
    const std::size_t count = std::min(segment_bytes, bytes.size());
    const bool last = count == bytes.size();
    Bytes segment{static_cast<std::uint8_t>(bit | (segment_bytes - count) << 1 | (last ? last_segment : 0U))};
    std::copy_n(bytes.begin(), count, segment.begin() + 1);
    if ((exchange(node, segment, index, sub_index)[0] & 0xF0U) != (segment_downloaded | bit))
      protocol_error(node, index, sub_index);
    bytes = bytes.subspan(count);
    bit ^= toggle;
  } while (!bytes.empty());
}

std::uint32_t Master::read(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index) {
  const auto bytes = upload(node, index, sub_index);
  if (bytes.empty() || bytes.size() > 4) {
    throw NodeError(object_name(node, index, sub_index) + ": " + std::to_string(bytes.size()) + " bytes, not a number");
  }
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::uint32_t{bytes[i]} << (8 * i);
  return value;
}

std::string Master::read_text(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index) {
  const auto bytes = upload(node, index, sub_index);
  return {bytes.begin(), bytes.end()};
}

void Master::write(std::uint8_t node, std::uint16_t index, std::uint8_t sub_index, std::uint32_t value,
                   std::size_t bytes) {
  std::array<std::uint8_t, 4> data;
  canopen::store<4>(data.data(), value);
  download(node, index, sub_index, std::span{data}.first(std::min<std::size_t>(bytes, 4)));
}

void Master::use_lockstep(std::uint8_t node, std::chrono::milliseconds patience) {
  write(node, 0x1006, 0, 0, 4);
  write(node, 0x2014, 0, static_cast<std::uint32_t>(patience.count()), 2);
}

}  // namespace fxdyn::can

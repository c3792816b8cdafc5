#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/protocol/canopen.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "tests/emulated_g474/board.hpp"

namespace fxdyn::emulated {

using Bytes = std::vector<std::uint8_t>;

/// A host on the bus of a board that runs the node's image.
class Host {
 public:
  static constexpr std::uint8_t node = 1;  ///< the id of a node with all joints

  explicit Host(const Image& image, Oscillators oscillators = {}, std::uint32_t garbage = 1)
      : board(image, oscillators) {
    board.power_on(garbage);
    board.port_b.drive(4, true);
  }

  Board board;

  static Frame frame(std::uint32_t id, const Bytes& bytes) {
    Frame f;
    f.id = id;
    f.size = static_cast<std::uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), f.data.begin());
    return f;
  }
  void send(const Frame& f) { board.wire.send(f, board.now()); }
  void send(std::uint32_t id, const Bytes& bytes) { send(frame(id, bytes)); }
  void run_us(std::uint64_t us) { board.run(us * microsecond); }
  void run_ms(std::uint64_t ms) { board.run(ms * millisecond); }

  /// What the node has said since this was last asked.
  std::vector<Wire::Heard> heard() { return std::exchange(board.wire.heard, {}); }
  std::vector<Bytes> heard(std::uint32_t id) { return take(heard(), id); }
  static std::vector<Bytes> take(const std::vector<Wire::Heard>& all, std::uint32_t id) {
    std::vector<Bytes> data;
    for (const auto& [at, f] : all)
      if (f.id == id) data.emplace_back(f.data.begin(), f.data.begin() + f.size);
    return data;
  }
  std::vector<std::uint16_t> emergencies() {
    std::vector<std::uint16_t> codes;
    for (const Bytes& data : heard(canopen::emergency_id + node))
      codes.push_back(static_cast<std::uint16_t>(canopen::load<2>(data.data())));
    return codes;
  }

  /// Until the boot-up message has come; false: it did not within 200 ms.
  bool boot() {
    return board.run_until([&] { return !take(board.wire.heard, canopen::heartbeat_id + node).empty(); },
                           200 * millisecond);
  }
  void nmt(canopen::NmtCommand command) {
    send(canopen::nmt_id, {static_cast<std::uint8_t>(command), 0});
    run_ms(1);
  }

  // --- SDO -----------------------------------------------------------------------------------------------------------

  /// Empty: no answer within 5 ms.
  Bytes request(const Bytes& bytes) {
    heard();
    send(canopen::sdo_request_id + node, bytes);
    const auto answered = [&] { return !take(board.wire.heard, canopen::sdo_answer_id + node).empty(); };
    if (!board.run_until(answered, 5 * millisecond)) return {};
    return take(board.wire.heard, canopen::sdo_answer_id + node)[0];
  }
  static Bytes initiate(std::uint8_t command, std::uint32_t index, std::uint8_t sub, std::uint32_t value = 0) {
    Bytes bytes(8);
    bytes[0] = command;
    canopen::store<2>(&bytes[1], index);
    bytes[3] = sub;
    canopen::store<4>(&bytes[4], value);
    return bytes;
  }
  /// The number in an object; nothing where the node aborts or does not answer.
  std::optional<std::uint32_t> read(std::uint32_t index, std::uint8_t sub = 0) {
    const Bytes answer = request(initiate(0x40, index, sub));
    if (answer.size() != 8 || (answer[0] & 0xe2) != 0x42) return std::nullopt;
    const std::uint32_t unused = 8U * (answer[0] >> 2 & 3U);
    return canopen::load<4>(&answer[4]) & UINT32_MAX >> unused;
  }
  std::string text(std::uint32_t index, std::uint8_t sub = 0) {
    Bytes answer = request(initiate(0x40, index, sub));
    if (answer.size() != 8 || (answer[0] & 0xe0) != 0x40) return "(abort)";
    if ((answer[0] & 2) != 0) return {answer.begin() + 4, answer.begin() + 8 - (answer[0] >> 2 & 3)};
    std::string text;
    for (std::uint8_t toggle = 0;; toggle ^= 0x10) {
      answer = request({static_cast<std::uint8_t>(0x60 | toggle), 0, 0, 0, 0, 0, 0, 0});
      if (answer.size() != 8 || (answer[0] & 0xf0) != toggle) return "(abort)";
      text.append(answer.begin() + 1, answer.begin() + 8 - (answer[0] >> 1 & 7));
      if ((answer[0] & 1) != 0) return text;
    }
  }
  bool write(std::uint32_t index, std::uint8_t sub, std::uint32_t value, std::size_t bytes) {
    const auto command = static_cast<std::uint8_t>(0x23 | (4 - bytes) << 2);
    const Bytes answer = request(initiate(command, index, sub, value));
    return answer.size() == 8 && answer[0] == 0x60;
  }

  // --- ticks ---------------------------------------------------------------------------------------------------------

  static Bytes bytes_of(const WireSetpoint& setpoint) {
    Bytes bytes(8);
    setpoint.store(bytes.data());
    return bytes;
  }
  template <std::size_t joints>
  void send_setpoints(const std::array<WireSetpoint, joints>& setpoints) {
    for (std::size_t j = 0; j < joints; ++j)
      send(canopen::setpoint_id + static_cast<std::uint32_t>(j) + 1, bytes_of(setpoints[j]));
  }
  /// All setpoints in one frame.
  template <std::size_t joints>
  void send_together(const std::array<WireSetpoint, joints>& setpoints) {
    Bytes bytes;
    for (const WireSetpoint& setpoint : setpoints)
      for (const std::uint8_t byte : bytes_of(setpoint)) bytes.push_back(byte);
    bytes.resize(hal::fd_length(bytes.size()));
    Frame together = frame(canopen::setpoint_id + 1, bytes);
    together.fd = true;
    send(together);
  }
  void sync() { send(canopen::sync_id, {}); }
  /// Torques since last asked, in the order of their identifiers.
  std::vector<WireTorque> torques() {
    std::vector<std::pair<std::uint32_t, WireTorque>> found;
    for (const auto& [at, f] : heard()) {
      if (f.id <= canopen::torque_id || f.id > canopen::torque_id + 32) continue;
      for (std::uint32_t i = 0; i + 8U <= f.size; i += 8)
        found.emplace_back(f.id + i / 8, WireTorque::load(&f.data[i]));
    }
    std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<WireTorque> torques;
    for (const auto& [id, torque] : found) torques.push_back(torque);
    return torques;
  }
  /// Setpoints and SYNC, then the rest of the 2 ms.
  template <std::size_t joints>
  std::vector<WireTorque> tick(const std::array<WireSetpoint, joints>& setpoints, bool fd = false) {
    heard();
    if (fd)
      send_together(setpoints);
    else
      send_setpoints(setpoints);
    sync();
    run_ms(2);
    return torques();
  }
};

}  // namespace fxdyn::emulated

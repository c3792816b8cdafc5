// The fault campaign on the STM32G474's own image in the emulated part: every instruction, register and interrupt of
// the drive. fault_g474 ELF [EVENTS [SEED [before|after]]], the last: when the setpoints of a SYNC come.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>

#include "tests/emulated_g474/board.hpp"
#include "tests/hil/fault_campaign.hpp"

namespace {

using namespace fxdyn;
using emulated::Time;

/// The campaign compares counters and ticks with what it has sent, so a frame has to be there as soon as it was sent:
/// frames take a thousandth of their time. What a full bus does to the image, tests/emulated_g474 looks at.
constexpr std::uint32_t wire_speed = 1000;
constexpr Time to_femtoseconds = 1'000'000;

class EmulatedNode final : public hil::NodeUnderTest, public can::Bus {
 public:
  explicit EmulatedNode(const emulated::Image& image) : board_(image), page_(find_page(image)) {
    board_.wire.speed = wire_speed;
    board_.port_b.drive(4, true);
  }
  can::Bus& bus() override { return *this; }
  bool sees_foreign_frames() const override { return false; }

  /// Its answer to a request is destroyed again and again.
  std::uint32_t fall_off_the_bus() override {
    board_.wire.disturbed = 32;                                                        // 8 errors each: 256
    send({.id = canopen::sdo_request_id + 1, .size = 8, .data = {0x40, 0x00, 0x10}});  // device type
    if (board_.wire.disturbed != 0) fail("did not answer");
    return 1;
  }
  void restart(bool good_tables) override {
    std::vector<std::uint8_t> bytes(sizeof tables::page);
    std::memcpy(bytes.data(), &tables::page, bytes.size());
    if (!good_tables) {
      corrupt_bit_ = (corrupt_bit_ + 7919) % (8 * bytes.size());
      bytes[corrupt_bit_ / 8] = static_cast<std::uint8_t>(bytes[corrupt_bit_ / 8] ^ 1U << corrupt_bit_ % 8);
    }
    board_.program(page_, bytes);
    board_.power_on(++garbage_);
  }
  /// Nothing that the manual forbids, no fault and no reset that nobody asked for.
  bool is_clean() const {
    for (const std::string& what : board_.violations()) std::printf("FAILED: %s\n", what.c_str());
    for (const auto& fault : board_.core.faults()) std::printf("FAILED: %s at %x\n", fault.what.c_str(), fault.pc);
    if (board_.resets() != 0) std::printf("FAILED: %u resets\n", board_.resets());
    return board_.violations().empty() && board_.core.faults().empty() && board_.resets() == 0;
  }

  void send(const can::Frame& frame) override {
    board_.wire.send(frame, board_.now());
    settle();
  }
  bool receive(can::Frame& frame, can::Duration timeout) override {
    const Time end = board_.now() + static_cast<Time>(timeout.count()) * to_femtoseconds;
    settle();
    while (board_.wire.heard.empty()) {
      if (board_.now() >= end) return false;
      board_.run(std::min(end - board_.now(), 10 * emulated::microsecond));
    }
    settle();
    frame = board_.wire.heard.front().frame;
    board_.wire.heard.erase(board_.wire.heard.begin());
    return true;
  }
  can::Duration now() const override { return can::Duration(board_.now() / to_femtoseconds); }
  std::uint32_t lost() const override { return 0; }
  std::string name() const override { return "emulated"; }
  std::string trouble() override { return {}; }

 private:
  /// Until nothing is under way: the processor sleeps and the wire is silent.
  void settle() {
    const auto is_settled = [&] {
      return board_.core.sleeping() && board_.wire.waiting() == 0 && board_.fdcan.pending() == 0;
    };
    const Time end = board_.now() + 5 * emulated::millisecond;
    while (!is_settled() && board_.now() < end) board_.run(2 * emulated::microsecond);
    board_.core.forget_taken();
    board_.port_a.edges.clear();
    board_.port_b.edges.clear();
  }
  [[noreturn]] static void fail(const char* what) {
    std::printf("FAILED: the node %s\n", what);
    std::exit(1);
  }
  static emulated::Address find_page(const emulated::Image& image) {
    const auto* page = reinterpret_cast<const std::uint8_t*>(&tables::page);
    for (const auto& segment : image.segments) {
      const auto found = std::search(segment.bytes.begin(), segment.bytes.end(), page, page + sizeof tables::page);
      if (found != segment.bytes.end())
        return segment.address + static_cast<emulated::Address>(found - segment.bytes.begin());
    }
    fail("has other tables than this program");
  }

  emulated::Board board_;
  emulated::Address page_;
  std::size_t corrupt_bit_ = 0;
  std::uint32_t garbage_ = 1;
};

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return 2;
  const auto events = count > 2 ? std::strtoull(arguments[2], nullptr, 10) : 200U;
  const auto seed = count > 3 ? std::strtoul(arguments[3], nullptr, 10) : 1U;
  const bool after = count > 4 && std::strcmp(arguments[4], "after") == 0;
  try {
    EmulatedNode node(emulated::Image::load(arguments[1]));
    hil::FaultCampaign campaign(node, {.seed = static_cast<unsigned>(seed),
                                       .period = std::chrono::milliseconds(2),
                                       .order = after ? hil::Order::after : hil::Order::before});
    campaign.run(events);
    const bool good = campaign.report();
    return node.is_clean() && good ? 0 : 1;
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}

// What a tick of the drive node costs on a board, protocol included: the node on a bus in memory, fed with good ticks
// and with every fault that a frame can have; instructions from its own object 0x2002.

#include <array>
#include <cstdint>

#include FXDYN_TABLES_HEADER
#include FXDYN_VECTORS_HEADER

#include "firmware/drive_node.hpp"
#include "hal/absent.hpp"
#include "hal/cortex_m/semihosting.hpp"
#include "hal/mps2/systick.hpp"

namespace {

using fxdyn::tables::Model;
using Frame = fxdyn::hal::ClassicFrame;
using fxdyn::hal::Status;
namespace golden = fxdyn::golden;
namespace semihosting = fxdyn::hal::semihosting;

/// Gives what was put in, takes everything that is sent.
struct MemoryBus {
  using Frame = fxdyn::hal::ClassicFrame;
  std::array<Frame, 32> frames{};
  std::size_t next = 0, end = 0;
  std::uint32_t sent = 0;
  void put(std::uint32_t id, std::uint8_t size) {
    frames[end] = {};
    frames[end].id = id;
    frames[end++].size = size;
  }
  Status send(const Frame&) {
    ++sent;
    return Status::ok;
  }
  Status receive(Frame& frame) {
    if (next == end) {
      next = end = 0;
      return Status::busy;
    }
    frame = frames[next++];
    return Status::ok;
  }
  fxdyn::hal::CanErrors errors() const { return {}; }
  Status restart() { return Status::ok; }
};
struct CountedClock {
  std::uint32_t us = 0;
  std::uint32_t now_us() const { return us; }
};

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};

void print(const char* name, std::uint32_t number) {
  semihosting::print(name);
  semihosting::print(" ");
  semihosting::print(number);
  semihosting::print("\n");
}

}  // namespace

int main() {
  const auto& page = fxdyn::as_flashed(fxdyn::tables::page);
  static MemoryBus bus;
  static CountedClock clock;
  static fxdyn::hal::mps2::ExactSysTick counter;
  static fxdyn::hal::AbsentWatchdog watchdog;
  static fxdyn::hal::FixedInput enable;
  static fxdyn::hal::AbsentOutput fault, tick_busy;
  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  static fxdyn::DriveNode<Model, decltype(hardware)> node(
      hardware, {page.parameters, page.header, fxdyn::page_is_valid(page), fxdyn::UpdateSlot::empty, rated},
      {.board = "cost"});

  const auto cost = [](std::uint8_t item) {
    fxdyn::dictionary::Object object;
    std::array<std::uint8_t, 32> bytes{};
    static_cast<void>(node.find(0x2002, item, object));
    static_cast<void>(node.read(object, bytes.data()));
    return fxdyn::canopen::load<4>(bytes.data());
  };
  while (node.poll()) continue;
  bus.put(0, 2);
  bus.frames[0].data[0] = 1;  // start
  while (node.poll()) continue;

  // Good ticks of the slow golden runs; then the same with foreign frames, duplicates, an SDO that finds nothing, and
  // one to four stale ticks after four fresh ones: what a model extrapolates over them depends on how many they are.
  constexpr auto is_stale = [](std::size_t tick) {
    constexpr std::size_t fresh = 4, most = 4;
    std::size_t at = tick % (most * fresh + most * (most + 1) / 2);
    for (std::size_t stale = 1; stale <= most; ++stale) {
      if (at < fresh + stale) return at >= fresh;
      at -= fresh + stale;
    }
    return false;
  };
  for (const bool faults : {false, true}) {
    for (std::size_t k = 0; k < golden::ticks_per_run; ++k) {
      const std::int32_t* in = golden::setpoints.data() + 3 * golden::joints * k;
      for (std::uint32_t j = 0; j < golden::joints; ++j, in += 3) {
        if (faults && is_stale(k) && k % golden::joints == j) continue;
        bus.put(0x201 + j, 8);
        fxdyn::WireSetpoint{in[0], static_cast<std::int16_t>(k), static_cast<std::int16_t>(-k)}.store(
            bus.frames[bus.end - 1].data.data());
      }
      if (faults) {
        bus.put(0x333, 8);
        bus.put(0x202, 3);
        bus.put(0x206, 8);
        bus.put(0x601, 8);
        bus.frames[bus.end - 1].data = {0x40, 0x13, 0x21, 0x07};  // last entry, no such sub-index
      }
      bus.put(0x80, 0);
      clock.us += 2000;
      while (node.poll()) continue;
    }
    print(faults ? "most_model_with_faults" : "most_model", cost(2));
    print(faults ? "most_everything_with_faults" : "most_everything", cost(4));
  }
  print("fresh_ticks", node.counted(fxdyn::dictionary::Counter::ticks));
  print("stale_ticks", node.counted(fxdyn::dictionary::Counter::stale_ticks));
  print("sent", bus.sent);
  semihosting::exit(node.counted(fxdyn::dictionary::Counter::ticks) > golden::ticks_per_run ? 0 : 1);
}

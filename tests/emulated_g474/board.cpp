#include "tests/emulated_g474/board.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

namespace fxdyn::emulated {
namespace {

// RM0440, "Memory map and register boundary addresses"
constexpr Address at_tim2 = 0x4000'0000, at_tim6 = 0x4000'1000, at_iwdg = 0x4000'3000, at_fdcan1 = 0x4000'6400,
                  at_pwr = 0x4000'7000, at_fdcan_ram = 0x4000'a400, at_rcc = 0x4002'1000, at_flash = 0x4002'2000,
                  at_gpio_a = 0x4800'0000, at_gpio_b = 0x4800'0400;
constexpr std::uint32_t fdcan1_it0 = 21, fdcan1_it1 = 22, tim6_dac = 54, tim2_global = 28;

bool within(Address address, Address base, Address bytes = 0x400) { return address >= base && address < base + bytes; }

}  // namespace

Board::Board(const Image& image, Oscillators oscillators)
    : flash_(flash_bytes, 0xff),
      ram_(ram_bytes),
      complain_([this](const std::string& what) { violates(what); }),
      oscillators_(oscillators),
      clocks(complain_, oscillators),
      port_a(complain_, 'A'),
      port_b(complain_, 'B'),
      tim2(complain_, 32),
      tim6(complain_, 16),
      watchdog(complain_),
      fdcan(complain_),
      wire(fdcan),
      core(*this, {flash_base, flash_}, {ram_base, ram_}) {
  program(image);
  power_on();
}

void Board::violates(const std::string& what) {
  constexpr std::size_t enough = 50;
  if (violations_.size() < enough) violations_.push_back(what + " (pc " + std::to_string(core.pc()) + ")");
}

void Board::program(const Image& image) {
  for (const auto& segment : image.segments) program(segment.address, segment.bytes);
}

void Board::program(Address address, const std::vector<std::uint8_t>& bytes) {
  if (address < flash_base || address - flash_base + bytes.size() > flash_.size())
    throw std::runtime_error("this does not lie in the flash");
  std::copy(bytes.begin(), bytes.end(), flash_.begin() + (address - flash_base));
}

void Board::erase(Address begin, Address end) {
  std::fill(flash_.begin() + (begin - flash_base), flash_.begin() + (end - flash_base), 0xff);
}

std::vector<std::uint8_t> Board::flash(Address begin, std::size_t bytes) const {
  const auto from = flash_.begin() + (begin - flash_base);
  return {from, from + static_cast<std::ptrdiff_t>(bytes)};
}

void Board::tear(Address address) {
  torn_.insert(address & ~7U);
  watch();
}

void Board::note_first_read(Address begin, Address end) {
  noted_begin_ = begin, noted_end_ = end;
  first_read_.reset();
  watch();
}

void Board::watch() {
  Address begin = noted_begin_, end = noted_end_;
  if (!torn_.empty()) {
    begin = begin == end ? *torn_.begin() : std::min(begin, *torn_.begin());
    end = std::max(end, *torn_.rbegin() + 8);
  }
  core.watch_flash(begin, end);
}

void Board::reads_flash(Address address) {
  if (!first_read_ && address >= noted_begin_ && address < noted_end_)
    first_read_ = FirstRead{now(), watchdog.runs(), watchdog.expires()};
  const Address both = ecc.dual_bank ? address : address & ~0xfU;  // a read takes 64 or 128 bits
  for (Address at = both; at < both + (ecc.dual_bank ? 8 : 16); at += 8)
    if (torn_.count(at) != 0) ecc.detects(at - flash_base);
  core.set_nmi(ecc.interrupt());
}

std::uint32_t Board::word(Address address) const {
  std::uint32_t value = 0;
  std::memcpy(&value, ram_.data() + (address - ram_base), 4);
  return value;
}
void Board::set_word(Address address, std::uint32_t value) {
  std::memcpy(ram_.data() + (address - ram_base), &value, 4);
}

Address Board::lowest_written(Address begin, Address end) const {
  const auto from = static_cast<std::ptrdiff_t>(begin - ram_base), to = static_cast<std::ptrdiff_t>(end - ram_base);
  const auto found = std::mismatch(ram_.begin() + from, ram_.begin() + to, garbage_.begin() + from);
  return ram_base + static_cast<Address>(found.first - ram_.begin());
}

void Board::power_on(std::uint32_t seed) {
  for (auto& byte : ram_) {
    seed = seed * 1'664'525 + 1'013'904'223;
    byte = static_cast<std::uint8_t>(seed >> 24);
  }
  garbage_ = ram_;
  fdcan.power_on(seed);
  wire.power_off();
  clocks.power_on();
  reset(0);
}

void Board::reset(std::uint32_t flags) {
  clocks.reset(flags);
  ecc.reset();
  port_a.reset();
  port_b.reset();
  tim2.reset();
  tim6.reset();
  watchdog.reset();
  watchdog.set_clock(oscillators_.low_speed_hz);
  fdcan.reset();
  core.reset();
  follow_clocks();
}

void Board::run(Time time) {
  core.look_again();  // a test may have sent or driven something
  const Time end = now() + time;
  while (now() < end) {
    core.run_until(end);
    if (!core.reset_asked()) continue;
    ++resets_;
    const bool bitten = watchdog.expires() <= now();
    if (bitten) ++watchdog_resets_;
    // An internal reset also pulls the reset pin.
    reset((bitten ? ClockTree::watchdog : ClockTree::software) | ClockTree::pin);
  }
}

void Board::follow_clocks() {
  core.set_clock(clocks.processor_hz());
  tim2.set_clock(clocks.timer_hz(), now());
  tim6.set_clock(clocks.timer_hz(), now());
  fdcan.set_clock(pins_on_fdcan() ? clocks.fdcan_hz() : 0);
}

void Board::follow_lines() {
  core.set_line(fdcan1_it0, fdcan.interrupt0());
  core.set_line(fdcan1_it1, fdcan.interrupt1());
  core.set_line(tim6_dac, tim6.interrupt());
  core.set_line(tim2_global, tim2.interrupt());
  core.set_nmi(ecc.interrupt());
}

/// PA11 and PA12 carry FDCAN1 as alternate function 9 (data sheet DS12288, "Alternate function").
bool Board::pins_on_fdcan() const {
  for (const std::uint32_t pin : {11U, 12U})
    if (port_a.mode(pin) != 0b10 || port_a.function(pin) != 9) return false;
  return true;
}

Time Board::happen(Time now) {
  for (const std::uint32_t pin : {4U, 6U}) port_b.pull_down(pin, clocks.dead_battery_pull_downs());
  tim2.happen(now);
  tim6.happen(now);
  const Time frames = wire.happen(now);
  follow_lines();
  if (watchdog.expires() <= now) core.ask_for_reset();
  return std::min({frames, tim2.next_event(), tim6.next_event(), watchdog.expires()});
}

std::optional<std::uint32_t> Board::read(Address address) {
  using Gate = ClockTree::Gate;
  const Time at = now();
  const auto gated = [&](Gate gate, auto value) -> std::uint32_t { return clocks.clocked(gate, at) ? value() : 0; };
  if (within(address, at_rcc)) return clocks.read(address - at_rcc, at);
  if (within(address, at_pwr)) return gated(Gate::power, [&] { return clocks.read_power(address - at_pwr); });
  if (address == at_flash) return clocks.read_access();
  if (address == at_flash + 0x18) return ecc.read();
  if (within(address, at_gpio_a)) return gated(Gate::gpio_a, [&] { return port_a.read(address - at_gpio_a); });
  if (within(address, at_gpio_b)) return gated(Gate::gpio_b, [&] { return port_b.read(address - at_gpio_b); });
  if (within(address, at_tim2)) return gated(Gate::tim2, [&] { return tim2.read(address - at_tim2, at); });
  if (within(address, at_tim6)) return gated(Gate::tim6, [&] { return tim6.read(address - at_tim6, at); });
  if (within(address, at_iwdg)) return watchdog.read(address - at_iwdg, at);
  if (within(address, at_fdcan1)) return gated(Gate::fdcan, [&] { return fdcan.read(address - at_fdcan1, at); });
  if (within(address, at_fdcan_ram, 3 * Fdcan::ram_bytes))
    return gated(Gate::fdcan, [&] { return fdcan.read_ram(address - at_fdcan_ram); });
  return std::nullopt;
}

bool Board::write(Address address, std::uint32_t value) {
  using Gate = ClockTree::Gate;
  const Time at = now();
  const auto gated = [&](Gate gate, auto write) {
    if (clocks.clocked(gate, at)) write();
    return true;
  };
  core.look_again();
  if (within(address, at_rcc)) {
    clocks.write(address - at_rcc, value, at);
    follow_clocks();
    return true;
  }
  if (within(address, at_pwr)) return gated(Gate::power, [&] { clocks.write_power(address - at_pwr, value); });
  if (address == at_flash) return clocks.write_access(value), true;
  if (address == at_flash + 0x18) return ecc.write(value), true;
  if (within(address, at_gpio_a)) {
    gated(Gate::gpio_a, [&] { port_a.write(address - at_gpio_a, value, at); });
    follow_clocks();
    return true;
  }
  if (within(address, at_gpio_b)) return gated(Gate::gpio_b, [&] { port_b.write(address - at_gpio_b, value, at); });
  if (within(address, at_tim2)) return gated(Gate::tim2, [&] { tim2.write(address - at_tim2, value, at); });
  if (within(address, at_tim6)) return gated(Gate::tim6, [&] { tim6.write(address - at_tim6, value, at); });
  if (within(address, at_iwdg)) return watchdog.write(address - at_iwdg, value, at), true;
  if (within(address, at_fdcan1)) return gated(Gate::fdcan, [&] { fdcan.write(address - at_fdcan1, value, at); });
  if (within(address, at_fdcan_ram, 3 * Fdcan::ram_bytes))
    return gated(Gate::fdcan, [&] { fdcan.write_ram(address - at_fdcan_ram, value); });
  return false;
}

}  // namespace fxdyn::emulated

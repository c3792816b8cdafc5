#include "tests/emulated_g474/peripherals.hpp"

#include <algorithm>
#include <utility>

namespace fxdyn::emulated {
namespace {

constexpr std::uint64_t mhz = 1'000'000;

std::string number(std::uint64_t value) { return std::to_string(value); }

}  // namespace

// --- RCC, PWR, FLASH_ACR ---------------------------------------------------------------------------------------------

ClockTree::ClockTree(Complaint complain, const Oscillators& oscillators)
    : complain_(std::move(complain)), oscillators_(oscillators) {
  power_on();
}

void ClockTree::power_on() {
  status_ = 0;
  reset(brown_out | pin);
}

void ClockTree::reset(std::uint32_t flags) {
  status_ |= flags;
  control_ = 1U << 8;  // HSION
  configuration_ = 0b01;
  pll_ = 0x0000'1000;
  ahb1_ = 1U << 8;
  ahb2_ = 0;
  apb1_ = 1U << 10;
  kernel_clocks_ = 0;
  access_ = 0x0004'0601;
  power1_ = 0x200;
  power3_ = 0x8000;
  power5_ = 0x100;
  crystal_since_ = pll_since_ = never;
}

bool ClockTree::crystal_runs(Time now) const {
  return oscillators_.crystal_hz != 0 && crystal_since_ != never && now >= crystal_since_ + oscillators_.crystal_starts;
}
bool ClockTree::pll_runs(Time now) const {
  constexpr Time lock = 40 * microsecond;  // data sheet, "PLL characteristics"
  return oscillators_.pll_locks && pll_since_ != never && now >= pll_since_ + lock;
}

std::uint64_t ClockTree::pll_hz(std::uint32_t divider) const {
  const std::uint64_t input = (pll_ & 0b11) == 0b11 ? oscillators_.crystal_hz : oscillators_.internal_hz;
  return input * (pll_ >> 8 & 0x7f) / ((pll_ >> 4 & 0xf) + 1) / divider;
}

std::uint64_t ClockTree::system_hz() const {
  switch (configuration_ & 0b11) {
    case 0b10:
      return oscillators_.crystal_hz;
    case 0b11:
      return pll_hz(2 * ((pll_ >> 25 & 0b11) + 1));
    default:
      return oscillators_.internal_hz;
  }
}
std::uint64_t ClockTree::processor_hz() const {
  const std::uint32_t field = configuration_ >> 4 & 0xf;
  constexpr std::array<int, 8> shifts{1, 2, 3, 4, 6, 7, 8, 9};  // not by 32
  return field < 8 ? system_hz() : system_hz() >> shifts[field - 8];
}
std::uint64_t ClockTree::apb1_hz() const {
  const std::uint32_t field = configuration_ >> 8 & 0b111;
  return field < 4 ? processor_hz() : processor_hz() >> (field - 3);
}
std::uint64_t ClockTree::timer_hz() const { return (configuration_ >> 8 & 0b111) < 4 ? apb1_hz() : 2 * apb1_hz(); }
std::uint64_t ClockTree::fdcan_hz() const {
  switch (kernel_clocks_ >> 24 & 0b11) {
    case 0b00:
      return crystal_since_ == never ? 0 : oscillators_.crystal_hz;
    case 0b01:
      return (pll_ >> 20 & 1U) == 0 || pll_since_ == never ? 0 : pll_hz(2 * ((pll_ >> 21 & 0b11) + 1));
    case 0b10:
      return apb1_hz();
    default:
      return 0;
  }
}

bool ClockTree::clocked(Gate gate, Time now) {
  struct Bit {
    std::uint32_t on, fresh, mask;
  };
  const Bit bit = [&]() -> Bit {
    switch (gate) {
      case Gate::gpio_a:
        return {ahb2_, new_gates_ahb2_, 1U << 0};
      case Gate::gpio_b:
        return {ahb2_, new_gates_ahb2_, 1U << 1};
      case Gate::tim2:
        return {apb1_, new_gates_apb1_, 1U << 0};
      case Gate::tim6:
        return {apb1_, new_gates_apb1_, 1U << 4};
      case Gate::fdcan:
        return {apb1_, new_gates_apb1_, 1U << 25};
      case Gate::power:
        break;
    }
    return {apb1_, new_gates_apb1_, 1U << 28};
  }();
  if ((bit.on & bit.mask) == 0) {
    complain_("an access to a peripheral without its clock");
    return false;
  }
  // "Peripheral clock enable register": two clocks after the bit
  if ((bit.fresh & bit.mask) != 0 && now < gates_since_ + periods(2, apb1_hz()))
    complain_("an access to a peripheral less than two clocks after its clock was enabled");
  return true;
}

std::uint32_t ClockTree::read(Offset offset, Time now) {
  switch (offset) {
    case 0x00:
      return control_ | (control_ & 1U << 8) << 2 | (crystal_runs(now) ? 1U << 17 : 0) | (pll_runs(now) ? 1U << 25 : 0);
    case 0x08:
      return configuration_ | (configuration_ & 0b11) << 2;
    case 0x0c:
      return pll_;
    case 0x1c:  // CIFR: no clock security system here, and no interrupt that it could flag
      return 0;
    case 0x48:
      return ahb1_;
    case 0x4c:
      return ahb2_;
    case 0x58:
      return apb1_;
    case 0x88:
      return kernel_clocks_;
    case 0x94:
      return status_;
    default:
      complain_("reads RCC + " + number(offset) + ", which is not modelled");
      return 0;
  }
}

void ClockTree::write(Offset offset, std::uint32_t value, Time now) {
  switch (offset) {
    case 0x00:
      return write_control(value, now);
    case 0x08:
      return write_configuration(value, now);
    case 0x0c:
      return write_pll(value, now);
    case 0x48:
      ahb1_ = value;
      return;
    case 0x4c:
      new_gates_ahb2_ = value & ~ahb2_;
      ahb2_ = value;
      gates_since_ = now;
      return;
    case 0x58:
      new_gates_apb1_ = value & ~apb1_;
      apb1_ = value;
      gates_since_ = now;
      return;
    case 0x88:
      kernel_clocks_ = value;
      return;
    case 0x94:
      if ((value >> 23 & 1U) != 0) status_ &= 0x7f'ffff;  // RMVF
      return;
    default:
      complain_("writes RCC + " + number(offset) + ", which is not modelled");
  }
}

void ClockTree::write_control(std::uint32_t value, Time now) {
  constexpr std::uint32_t internal = 1U << 8, crystal = 1U << 16, bypass = 1U << 18, security = 1U << 19,
                          pll = 1U << 24;
  if ((value & (bypass | security)) != 0) complain_("HSEBYP and CSSON are not modelled");
  const std::uint32_t source = configuration_ & 0b11;
  if (source == 0b11 && (value & pll) == 0) complain_("switches the PLL off that it runs from");
  const bool needs_crystal = source == 0b10 || (source == 0b11 && (pll_ & 0b11) == 0b11);
  const bool needs_internal = source == 0b01 || (source == 0b11 && (pll_ & 0b11) == 0b10);
  if (needs_crystal && (value & crystal) == 0) complain_("switches the crystal off that it runs from");
  if (needs_internal && (value & internal) == 0) complain_("switches the oscillator off that it runs from");
  if ((value & crystal) == 0)
    crystal_since_ = never;
  else if (crystal_since_ == never)
    crystal_since_ = now;
  if ((value & pll) == 0) {
    pll_since_ = never;
  } else if (pll_since_ == never) {
    pll_since_ = now;
    if ((pll_ & 0b11) < 0b10) complain_("the PLL has no clock");
    if ((pll_ & 0b11) == 0b11 && !crystal_runs(now)) complain_("the PLL's crystal does not run");
  }
  control_ = value & (internal | crystal | pll);
}

void ClockTree::write_pll(std::uint32_t value, Time now) {
  (void)now;
  if (((value ^ 0x0000'1000U) & 0x008c'800cU) != 0) complain_("changes reserved bits of PLLCFGR");
  constexpr std::uint32_t free = 1U << 24 | 1U << 20 | 1U << 16;  // the outputs' enables
  if (pll_since_ != never && ((value ^ pll_) & ~free) != 0) {
    complain_("the PLL is configured while it is on");
    return;
  }
  pll_ = value;
  const std::uint64_t input =
      ((value & 0b11) == 0b11 ? oscillators_.crystal_hz : oscillators_.internal_hz) / ((value >> 4 & 0xf) + 1);
  const std::uint64_t vco = input * (value >> 8 & 0x7f);
  // data sheet, "PLL characteristics", range 1
  if (input < 2'660'000 || input > 16 * mhz || vco < 96 * mhz || vco > 347 * mhz)  // internal oscillator 1 % high
    complain_("PLL out of range: input " + number(input) + ", VCO " + number(vco));
}

void ClockTree::write_configuration(std::uint32_t value, Time now) {
  const std::uint64_t before_hz = processor_hz();
  const std::uint32_t before = configuration_;
  const std::uint32_t source = value & 0b11;
  if (source == 0b00) complain_("SW = 0 is reserved");
  if (source == 0b10 && !crystal_runs(now)) complain_("switches to a crystal that does not run");
  if (source == 0b11 && !pll_runs(now)) complain_("switches to a PLL that has not locked");
  if (source == 0b11 && (pll_ >> 24 & 1U) == 0) complain_("switches to a PLL output that is off");
  configuration_ = value & 0x0000'3ff3U;
  // "System clock selection" above 80 MHz: through AHB / 2, for at least 1 us
  if (system_hz() > 80 * mhz && (before & 0b11) != source && processor_hz() != system_hz() / 2)
    complain_("switches above 80 MHz without AHB / 2");
  if ((before >> 4 & 0xf) == 0 && (value >> 4 & 0xf) != 0) half_since_ = now;
  if ((before & 0b11) != source) half_since_ = now;
  if ((before >> 4 & 0xf) != 0 && (value >> 4 & 0xf) == 0 && processor_hz() > 80 * mhz &&
      now < half_since_ + microsecond)
    complain_("leaves AHB / 2 within 1 us");
  check_speed(before_hz);
}

void ClockTree::check_speed(std::uint64_t from_hz) {
  // 1 % above for the internal oscillator, which the table does not know
  const std::uint64_t hz = processor_hz() * 100 / 101;
  const std::uint64_t per_wait_state = (boost() ? 34 : 30) * mhz;
  if (hz > 170 * mhz) complain_("the processor runs above 170 MHz");
  if (hz > 150 * mhz && !boost()) complain_("above 150 MHz without boost mode");
  if (hz > (wait_states() + 1) * per_wait_state)
    complain_("too few wait states: " + number(wait_states()) + " for " + number(hz) + " Hz, from " + number(from_hz));
}

void ClockTree::write_access(std::uint32_t value) {
  if (((value ^ 0x0004'0600U) & ~0x0000'7f0fU) != 0) complain_("changes reserved bits or DBG_SWEN of FLASH_ACR");
  access_ = value;
  check_speed(processor_hz());
}

std::uint32_t ClockTree::read_power(Offset offset) const {
  switch (offset) {
    case 0x00:
      return power1_;
    case 0x08:
      return power3_;
    case 0x14:  // SR2: the regulator is where it should be
      return 0;
    case 0x80:
      return power5_;
    default:
      complain_("reads PWR + " + number(offset) + ", which is not modelled");
      return 0;
  }
}
void ClockTree::write_power(Offset offset, std::uint32_t value) {
  switch (offset) {
    case 0x00:
      if ((value >> 9 & 0b11) != 0b01) complain_("voltage range 2 is not modelled");
      power1_ = value;
      return;
    case 0x08:
      if (((value ^ 0x8000U) & ~0x0000'e51fU) != 0) complain_("changes reserved bits of PWR_CR3");
      power3_ = value;
      return;
    case 0x80:
      power5_ = value & 0x100U;
      check_speed(processor_hz());
      return;
    default:
      complain_("writes PWR + " + number(offset) + ", which is not modelled");
  }
}

// --- FLASH_ECCR ------------------------------------------------------------------------------------------------------

void FlashEcc::write(std::uint32_t value) {
  register_ &= ~(value & (detected | corrected | detected2 | corrected2));
  register_ = (register_ & ~(1U << 24)) | (value & 1U << 24);
}

void FlashEcc::detects(std::uint32_t offset) {
  if ((register_ & (detected | corrected | detected2 | corrected2)) != 0) return;
  register_ &= 1U << 24;
  if (dual_bank) {
    constexpr std::uint32_t bank = 0x4'0000;
    register_ |= detected | (offset >= bank ? 1U << 21 : 0) | (offset % bank & ~7U);
  } else {
    register_ |= ((offset & 8U) != 0 ? detected2 : detected) | (offset & ~0xfU & 0x7'ffff);
  }
}

// --- GPIO ------------------------------------------------------------------------------------------------------------

namespace gpio {
// A word each: MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFRL, AFRH, BRR
enum : std::size_t { mode, type, speed, pull, input, output, set_reset, lock, function_low, function_high, reset };
}  // namespace gpio

void GpioPort::reset() {
  registers_ = {};
  registers_[gpio::mode] = name_ == 'A' ? 0xabff'ffff : 0xffff'febf;
  registers_[gpio::speed] = name_ == 'A' ? 0x0c00'0000 : 0x0000'00c0;
  registers_[gpio::pull] = name_ == 'A' ? 0x6400'0000 : 0x0000'0100;
}

std::optional<bool> GpioPort::level(std::uint32_t pin) const {
  if (mode(pin) == 0b01) return (registers_[gpio::output] >> pin & 1U) != 0;
  if (driven_[pin]) return driven_[pin];
  if (foreign_pull_down_[pin]) return false;  // 5.1 kOhm against the port's 40
  if (pull(pin) == 0b01) return true;
  if (pull(pin) == 0b10) return false;
  return std::nullopt;
}

std::uint32_t GpioPort::read(Offset offset) const {
  if (offset / 4 >= registers_.size()) {
    complain_("reads a GPIO register that does not exist");
    return 0;
  }
  if (offset / 4 != gpio::input) return offset / 4 == gpio::set_reset ? 0 : registers_[offset / 4];
  std::uint32_t word = 0;
  for (std::uint32_t pin = 0; pin < 16; ++pin) {
    if (mode(pin) != 0b11 && level(pin).value_or(false)) word |= 1U << pin;
  }
  return word;
}

void GpioPort::write(Offset offset, std::uint32_t value, Time now) {
  std::array<std::optional<bool>, 16> before;
  for (std::uint32_t pin = 0; pin < 16; ++pin) before[pin] = mode(pin) == 0b01 ? level(pin) : std::optional<bool>{};
  switch (offset / 4) {
    case gpio::mode:
      if (name_ == 'A' && ((value ^ 0xabff'ffffU) & 0x3c00'0000U) != 0) complain_("takes the debug port's pins");
      [[fallthrough]];
    case gpio::type:
    case gpio::speed:
    case gpio::pull:
    case gpio::output:
    case gpio::function_low:
    case gpio::function_high:
      registers_[offset / 4] = value;
      break;
    case gpio::set_reset:
      registers_[gpio::output] = (registers_[gpio::output] & ~(value >> 16)) | (value & 0xffff);
      break;
    case gpio::reset:
      registers_[gpio::output] &= ~value;
      break;
    default:
      complain_("writes a GPIO register that cannot be written");
  }
  for (std::uint32_t pin = 0; pin < 16; ++pin) {
    if (mode(pin) != 0b01) continue;
    const bool after = *level(pin);
    if (!before[pin] || *before[pin] != after) edges.push_back({now, pin, after});
  }
}

// --- timers ----------------------------------------------------------------------------------------------------------

void Timer::reset() {
  control_ = interrupts_ = status_ = prescaler_ = taken_prescaler_ = 0;
  reload_ = mask_;
  count_ = 0;
}

std::uint64_t Timer::counted(Time now) const {
  if ((control_ & 1U) == 0) return count_;
  return count_ + whole_periods(now - since_, hz_) / (taken_prescaler_ + 1);
}
void Timer::rebase(Time now) {
  count_ = counted(now) % (std::uint64_t{reload_} + 1);
  since_ = now;
}
void Timer::set_clock(std::uint64_t hz, Time now) {
  if (hz == hz_) return;
  rebase(now);
  hz_ = hz;
}

Time Timer::next_event() const {
  if ((control_ & 1U) == 0 || (interrupts_ & 1U) == 0) return never;
  const std::uint64_t left = std::uint64_t{reload_} + 1 - count_;
  return since_ + periods(left * (taken_prescaler_ + 1), hz_) + 1;
}
void Timer::happen(Time now) {
  while (next_event() <= now) {
    const Time at = next_event();
    count_ = 0;
    since_ = at - 1;
    taken_prescaler_ = prescaler_;
    status_ |= 1U;
  }
}

std::uint32_t Timer::read(Offset offset, Time now) {
  switch (offset) {
    case 0x00:
      return control_;
    case 0x0c:
      return interrupts_;
    case 0x10:
      return status_;
    case 0x24:
      return static_cast<std::uint32_t>(counted(now) % (std::uint64_t{reload_} + 1));
    case 0x28:
      return prescaler_;
    case 0x2c:
      return reload_;
    default:
      complain_("reads a timer's register that is not modelled: " + number(offset));
      return 0;
  }
}

void Timer::write(Offset offset, std::uint32_t value, Time now) {
  switch (offset) {
    case 0x00:
      if ((value & ~1U) != 0) complain_("timer modes are not modelled");
      rebase(now);
      control_ = value & 1U;
      return;
    case 0x0c:
      rebase(now);
      interrupts_ = value;
      return;
    case 0x10:
      status_ &= value;  // rc_w0
      return;
    case 0x14:
      if ((value & 1U) == 0) return;
      taken_prescaler_ = prescaler_;
      count_ = 0;
      since_ = now;
      status_ |= 1U;  // URS = 0
      return;
    case 0x28:
      if (value > 0xffff) complain_("PSC has 16 bits");
      prescaler_ = value & 0xffff;
      return;
    case 0x2c:
      if (value > mask_) complain_("ARR is too large");
      rebase(now);
      reload_ = value & mask_;
      return;
    default:
      complain_("writes a timer's register that is not modelled: " + number(offset));
  }
}

// --- IWDG ------------------------------------------------------------------------------------------------------------

void IndependentWatchdog::reset() {
  prescaler_ = 0;
  reload_ = 0xfff;
  open_ = false;
  busy_until_ = 0;
  expires_ = never;
}

Time IndependentWatchdog::period() const { return periods(std::uint64_t{reload_ + 1} * (4U << prescaler_), hz_); }

std::uint32_t IndependentWatchdog::read(Offset offset, Time now) const {
  switch (offset) {
    case 0x00:
      return 0;
    case 0x04:
      return prescaler_;
    case 0x08:
      return reload_;
    case 0x0c:
      return now < busy_until_ ? 0b11 : 0;
    default:
      complain_("reads an IWDG register that is not modelled");
      return 0;
  }
}

void IndependentWatchdog::write(Offset offset, std::uint32_t value, Time now) {
  constexpr std::uint32_t start = 0xcccc, feed = 0xaaaa, access = 0x5555;
  if (offset == 0x00) {
    open_ = value == access;
    if (value == start || (value == feed && runs())) expires_ = now + period();
    if (value != start && value != feed && value != access) complain_("IWDG: an unknown key");
    return;
  }
  if (offset != 0x04 && offset != 0x08) return complain_("writes an IWDG register that is not modelled");
  if (!open_) return complain_("IWDG: PR and RLR are locked");
  if (offset == 0x04)
    prescaler_ = std::min<std::uint32_t>(value & 0b111, 6);
  else
    reload_ = value & 0xfff;
  // "Up to five periods of the prescaled LSI"; the registers wait for each other, never for themselves
  busy_until_ = now + periods(5ULL * (4U << prescaler_), hz_);
}

}  // namespace fxdyn::emulated

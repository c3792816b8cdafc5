#pragma once

#include <atomic>
#include <cstdint>

#include "hal/registers.hpp"
#include "hal/stm32g4/board.hpp"

namespace fxdyn::hal::stm32g4 {

/// Double words of the flash that can't be read (RM0440, "Embedded flash memory", "Error code correction"). The flash
/// is programmed 64 bits at a time, with 8 bits of ECC; where the supply fails meanwhile, reading that double word is a
/// two-bit error, ECCD, and ECCD is an NMI. While tables are read it only counts; afterwards it is a fault, since the
/// firmware would go on with wrong code or numbers.
///
/// Which address failed is not asked: ADDR_ECC stays as it is while ECCC, a corrected bit elsewhere, is set.
template <Registers R = MemoryMapped>
class BasicFlashEcc {
 public:
  explicit constexpr BasicFlashEcc(R registers = {}) : registers_(registers) {}

  void begin() {
    is_tolerant_.store(true, std::memory_order_relaxed);
    take_error();
    has_failed_.store(false, std::memory_order_release);
  }
  bool all_read() {
    take_error();  // the NMI of the last read may still be on its way
    return !has_failed_.load(std::memory_order_acquire);
  }
  void trust() { is_tolerant_.store(false, std::memory_order_release); }

  /// False: it is a fault. The clock security system has the same NMI, and no read of the flash excuses a dead clock.
  /// An NMI without a cause is one whose error take_error() has seen first.
  bool on_nmi() {
    constexpr std::uint32_t clock_failed = 1U << 8;  // RCC_CIFR: CSSF
    if ((registers_.read(rcc + 0x1c) & clock_failed) != 0) return false;
    if (!is_tolerant_.load(std::memory_order_acquire)) return false;
    take_error();
    return true;
  }

 private:
  // FLASH_ECCR. ECCD2: of the upper double word where the flash is read 128 bits at a time (option DBANK = 0).
  static constexpr Address status = flash + 0x18;
  static constexpr std::uint32_t detected = 1U << 31 | 1U << 29, correction_interrupt = 1U << 24;

  /// Takes an error's flag back (a written 1 clears), which also ends its NMI.
  void take_error() {
    const std::uint32_t value = registers_.read(status);
    if ((value & detected) == 0) return;
    has_failed_.store(true, std::memory_order_release);
    registers_.write(status, value & (detected | correction_interrupt));  // ECCC, ECCC2 keep: 0 leaves them alone
    (void)registers_.read(status);  // the flag is gone before the handler returns, or it would be called again
  }

  [[no_unique_address]] R registers_;
  std::atomic<bool> is_tolerant_{false};
  std::atomic<bool> has_failed_{false};  // written by the NMI
};
using FlashEcc = BasicFlashEcc<>;

}  // namespace fxdyn::hal::stm32g4

#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace fxdyn::cycles {

/// The rows of the table of instruction timings in Arm's Cortex-M4 Technical Reference Manual (DDI 0439, 3.3.1).
enum class Kind : std::uint8_t {
  data,                ///< 1: moves, arithmetic, shifts, multiplication to 64 bits, saturation, packing, SIMD
  multiply_add,        ///< MLA, MLS: 1, or 2 in the manual's older issues
  divide,              ///< 2 to 12
  load,                ///< 2, pipelined after another load: 1
  load_literal,        ///< a load relative to the PC: "might add a cycle"
  store,               ///< 1 with an immediate offset
  store_at_register,   ///< 2 with an offset in a register, pipelined after a load: 1
  multiple,            ///< LDM, STM, PUSH, POP, LDRD, STRD: 1 + N
  branch,              ///< to an address in the instruction: 1 + P if taken, else 1
  branch_to_register,  ///< BX, BLX, MOV PC, ADD PC: 1 + P
  load_pc,             ///< POP, LDM or LDR of the PC, TBB, TBH: as the load, + P
  if_then,             ///< IT: 1, folded: 0
  status,              ///< MRS, MSR: 2
  barrier,             ///< DMB, DSB, ISB: 1 + B
};

struct Instruction {
  Kind kind = Kind::data;
  std::uint8_t size = 2;       ///< bytes
  std::uint8_t transfers = 0;  ///< words that a load or store moves, the PC among them
  bool is_load = false;
  std::uint16_t address_from = 0;  ///< registers that make the address of a load or store, a bit each
  std::uint16_t writes = 0;        ///< registers that change
};

/// Thumb-2 as the Cortex-M4 has it, decoded by capstone. An instruction that the table has no row for here (floating
/// point, exceptions) throws std::runtime_error: no guessed timing.
class Decoder {
 public:
  Decoder();
  Instruction decode(std::uint32_t address, std::span<const std::byte> code);

 private:
  struct Closer {
    void operator()(std::size_t* handle) const;
  };
  std::unique_ptr<std::size_t, Closer> handle_;
};

}  // namespace fxdyn::cycles

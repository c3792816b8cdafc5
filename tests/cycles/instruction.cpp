#include "tests/cycles/instruction.hpp"

#include <capstone/capstone.h>

#include <array>
#include <bit>
#include <stdexcept>
#include <string>

namespace fxdyn::cycles {
namespace {

std::uint16_t bit(unsigned reg) {
  if (reg >= ARM_REG_R0 && reg <= ARM_REG_R12) return static_cast<std::uint16_t>(1U << (reg - ARM_REG_R0));
  if (reg == ARM_REG_SP) return 1U << 13;
  if (reg == ARM_REG_LR) return 1U << 14;
  if (reg == ARM_REG_PC) return 1U << 15;
  return 0;
}
constexpr std::uint16_t pc_bit = 1U << 15;

bool is_branch(unsigned id) { return id == ARM_INS_B || id == ARM_INS_BL || id == ARM_INS_CBZ || id == ARM_INS_CBNZ; }

/// The registers of LDM, STM, PUSH and POP; of LDM and STM the first operand is the address.
unsigned listed(const cs_arm& arm, int first) {
  unsigned mask = 0;
  for (int i = first; i < arm.op_count; ++i) mask |= bit(static_cast<unsigned>(arm.operands[i].reg));
  return mask;
}

Kind kind_of(const cs_insn& said, const Instruction& so_far) {
  const cs_arm& arm = said.detail->arm;
  switch (said.id) {
    case ARM_INS_MLA:
    case ARM_INS_MLS:
      return Kind::multiply_add;
    case ARM_INS_SDIV:
    case ARM_INS_UDIV:
      return Kind::divide;
    case ARM_INS_LDRD:
    case ARM_INS_STRD:
    case ARM_INS_PUSH:
    case ARM_INS_STM:
    case ARM_INS_STMDB:
      return Kind::multiple;
    case ARM_INS_POP:
    case ARM_INS_LDM:
    case ARM_INS_LDMDB:
      return (so_far.writes & pc_bit) != 0 ? Kind::load_pc : Kind::multiple;
    case ARM_INS_TBB:
    case ARM_INS_TBH:
      return Kind::load_pc;
    case ARM_INS_LDR:
    case ARM_INS_LDRB:
    case ARM_INS_LDRH:
    case ARM_INS_LDRSB:
    case ARM_INS_LDRSH:
    case ARM_INS_LDREX:
      if ((so_far.writes & pc_bit) != 0) return Kind::load_pc;
      return so_far.address_from == pc_bit ? Kind::load_literal : Kind::load;
    case ARM_INS_STR:
    case ARM_INS_STRB:
    case ARM_INS_STRH:
      return std::popcount(so_far.address_from) > 1 ? Kind::store_at_register : Kind::store;
    case ARM_INS_STREX:
      return Kind::store_at_register;  // 2 as well
    case ARM_INS_B:
    case ARM_INS_BL:
    case ARM_INS_CBZ:
    case ARM_INS_CBNZ:
      return Kind::branch;
    case ARM_INS_BX:
    case ARM_INS_BLX:
      return Kind::branch_to_register;
    case ARM_INS_IT:
      return Kind::if_then;
    case ARM_INS_MRS:
    case ARM_INS_MSR:
      return Kind::status;
    case ARM_INS_DMB:
    case ARM_INS_DSB:
    case ARM_INS_ISB:
      return Kind::barrier;
    default:
      break;
  }
  for (int i = 0; i < arm.op_count; ++i)
    if (arm.operands[i].type == ARM_OP_MEM) throw std::runtime_error("no timing for " + std::string(said.mnemonic));
  for (int i = 0; i < said.detail->groups_count; ++i) {
    const auto group = said.detail->groups[i];
    if (group == ARM_GRP_VFP2 || group == ARM_GRP_VFP3 || group == ARM_GRP_VFP4 || group == ARM_GRP_NEON ||
        group == CS_GRP_INT)
      throw std::runtime_error("no timing for " + std::string(said.mnemonic));
  }
  return (so_far.writes & pc_bit) != 0 ? Kind::branch_to_register : Kind::data;
}

}  // namespace

void Decoder::Closer::operator()(std::size_t* handle) const {
  cs_close(handle);
  delete handle;
}

Decoder::Decoder() : handle_(new std::size_t{}) {
  if (cs_open(CS_ARCH_ARM, static_cast<cs_mode>(CS_MODE_THUMB | CS_MODE_MCLASS), handle_.get()) != CS_ERR_OK)
    throw std::runtime_error("capstone does not know Thumb");
  cs_option(*handle_, CS_OPT_DETAIL, CS_OPT_ON);
}

Instruction Decoder::decode(std::uint32_t address, std::span<const std::byte> code) {
  cs_insn* said = nullptr;
  if (cs_disasm(*handle_, reinterpret_cast<const std::uint8_t*>(code.data()), code.size(), address, 1, &said) != 1)
    throw std::runtime_error("no instruction at " + std::to_string(address));
  const std::unique_ptr<cs_insn, void (*)(cs_insn*)> keep(said, [](cs_insn* one) { cs_free(one, 1); });
  const cs_arm& arm = said->detail->arm;

  Instruction made;
  made.size = static_cast<std::uint8_t>(said->size);
  std::array<std::uint16_t, 64> reads{}, writes{};
  std::uint8_t read_count = 0, write_count = 0;
  cs_regs_access(*handle_, said, reads.data(), &read_count, writes.data(), &write_count);
  if (!is_branch(said->id) && said->id != ARM_INS_BX && said->id != ARM_INS_BLX)
    for (int i = 0; i < write_count; ++i) made.writes |= bit(writes[static_cast<std::size_t>(i)]);

  for (int i = 0; i < arm.op_count; ++i) {
    const cs_arm_op& operand = arm.operands[i];
    if (operand.type == ARM_OP_MEM)
      made.address_from = static_cast<std::uint16_t>(bit(static_cast<unsigned>(operand.mem.base)) |
                                                     bit(static_cast<unsigned>(operand.mem.index)));
  }
  switch (said->id) {
    case ARM_INS_PUSH:
    case ARM_INS_POP:
      made.address_from = bit(ARM_REG_SP);
      made.transfers = static_cast<std::uint8_t>(std::popcount(listed(arm, 0)));
      made.writes |= bit(ARM_REG_SP);
      if (said->id == ARM_INS_POP) made.writes |= static_cast<std::uint16_t>(listed(arm, 0));
      break;
    case ARM_INS_LDM:
    case ARM_INS_LDMDB:
    case ARM_INS_STM:
    case ARM_INS_STMDB:
      made.address_from = bit(static_cast<unsigned>(arm.operands[0].reg));
      made.transfers = static_cast<std::uint8_t>(std::popcount(listed(arm, 1)));
      if (said->id == ARM_INS_LDM || said->id == ARM_INS_LDMDB)
        made.writes |= static_cast<std::uint16_t>(listed(arm, 1));
      break;
    case ARM_INS_LDRD:
    case ARM_INS_STRD:
      made.transfers = 2;
      break;
    default:
      made.transfers = made.address_from != 0 ? 1 : 0;
      break;
  }
  made.kind = kind_of(*said, made);
  made.is_load = made.kind == Kind::load || made.kind == Kind::load_literal;
  return made;
}

}  // namespace fxdyn::cycles

#pragma once

#include <cstdint>

#include "model/table_page.hpp"

// The slot for updated tables, from the linker script.
extern "C" const std::uint32_t fxdyn_update_begin[];  // NOLINT

namespace fxdyn {

/// choose_tables() of the image's own page and the slot.
template <class Model, class Memory>
ChosenTables<Model> tables_in_flash(const TablePage<Model>& built_in, Memory& memory) {
  const auto* slot = reinterpret_cast<const TablePage<Model>*>(fxdyn_update_begin);  // NOLINT: what the flash has there
  return choose_tables(built_in, *slot, memory);
}
template <class Model>
ChosenTables<Model> tables_in_flash(const TablePage<Model>& built_in) {
  PlainMemory memory;
  return tables_in_flash(built_in, memory);
}

}  // namespace fxdyn

#pragma once

#include <cstdint>

#include "model/table_page.hpp"

// The slot for updated tables, from the linker script.
extern "C" const std::uint32_t fxdyn_update_begin[];  // NOLINT

namespace fxdyn {

/// The tables that an image computes with.
template <class Page>
struct FlashTables {
  const Page& page;
  bool valid = false, is_update = false;
};

/// Chooses between the update slot and the image's own page. Hides from the compiler that it knows the values: either
/// page can be reflashed alone.
template <class Page>
FlashTables<Page> tables_in_flash(const Page& built_in) {
  const Page* own = &built_in;
  const Page* update = reinterpret_cast<const Page*>(fxdyn_update_begin);  // NOLINT: whatever the flash has there
  asm volatile("" : "+r"(own), "+r"(update));
  const Page& page = newest_valid_page(*update, *own);
  return {page, page_is_valid(page), &page == update};
}

}  // namespace fxdyn

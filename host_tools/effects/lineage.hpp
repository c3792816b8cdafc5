#pragma once

#include <cstdint>

namespace fxdyn {

/// Which page of tables is newer than which (model/table_page.hpp). No clock: the same input makes the same bytes.
struct Lineage {
  std::uint32_t origin = 0;    ///< CRC-32 of the parameters that the first export wrote
  std::uint32_t sequence = 0;  ///< 0: not exported yet
};

}  // namespace fxdyn

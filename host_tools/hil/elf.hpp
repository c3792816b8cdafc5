#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace fxdyn {

/// Value of a symbol of a 32-bit little-endian ELF file; nothing: it has none of that name, or is not whole.
std::optional<std::uint32_t> symbol_of(const std::filesystem::path& elf, std::string_view name);

}  // namespace fxdyn

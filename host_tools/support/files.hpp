#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace fxdyn {

/// @throws InputError if the file can't be read.
std::string read_file(const std::filesystem::path& file);

/// Writes to a temporary file beside it and renames: a reader sees the old content or the new, never half of it.
/// Makes the directory where it is missing.
void write_file(const std::filesystem::path& file, std::string_view content);

/// Before hours of work: whether results could be written into the directory, which need not be there yet.
/// @throws InputError with what to do
void check_writable(const std::filesystem::path& directory);

/// FNV-1a, 64 bits, as 16 hex digits: shows whether a file is still the one a model was made from.
std::string hash_of(std::string_view content);
/// Of a file, read piece by piece.
std::string hash_of_file(const std::filesystem::path& file);

}  // namespace fxdyn

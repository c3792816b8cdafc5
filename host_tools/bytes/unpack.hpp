#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Whether the bytes start like a frame of zstd (RFC 8878, 3.1.1).
bool is_zstd(std::string_view bytes);

/// All frames of zstd, one after another. @param name of the file, for the complaint
/// @throws InputError: damaged, or ends in the middle
std::string unpack_zstd(std::string_view packed, const std::string& name);

/// Frames of zstd into `room`, which they fill. False: they are damaged, or of another size.
bool unpack_zstd_into(std::string_view packed, char* room, std::size_t size);
/// A frame of LZ4 (LZ4 frame format 1.6) into `room`, likewise.
bool unpack_lz4_into(std::string_view packed, char* room, std::size_t size);

/// A file packed by zstd into another one, piece by piece.
/// @throws InputError: damaged, ends in the middle, or there is no room for what comes out
void unpack_zstd_file(const std::filesystem::path& packed, const std::filesystem::path& to);

}  // namespace fxdyn

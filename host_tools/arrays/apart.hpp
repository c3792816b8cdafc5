#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

namespace fxdyn {

/// Takes bytes to the process that started read_apart().
using SendPiece = std::function<void(std::string_view piece)>;

/// Runs `work` in a process of its own: a library that a damaged file leads astray takes that process down, not this
/// one. Its words on the terminal are dropped, its time and memory are limited by the file's size.
/// @param piece gets here, in their order, what `work` sends
/// @throws InputError: that of `work`; or the process came to no end, so the file is damaged
void read_apart(const std::filesystem::path& file, const std::function<void(const SendPiece& send)>& work,
                const std::function<void(std::string_view piece)>& piece);

}  // namespace fxdyn

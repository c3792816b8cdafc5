#pragma once

#include <filesystem>
#include <string>

namespace fxdyn {

/// What comes out of a FIFO, a pipe or, for "-", standard input. Such a file can be read once: its bytes are kept for
/// all that ask later. nullptr: a file that can be read again, a folder, or nothing.
/// @throws InputError: it can't be read
const std::string* piped(const std::filesystem::path& file);
/// Whether the name stands for such a file; reads nothing.
bool is_pipe(const std::filesystem::path& file);

/// "~" and "~/x" with the home folder in front, as a shell has it; every other text as it is.
std::string with_home(const std::string& path);
/// "${NAME:-default}/rest": the environment variable, else the default. Every other text as it is.
/// @throws InputError: not closed, or not set and without a default
std::string with_variable(const std::string& path);

}  // namespace fxdyn

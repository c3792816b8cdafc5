#pragma once

#include <cstddef>
#include <filesystem>

namespace fxdyn {

/// Walks over a MATLAB 5 file's elements, one a variable, and unpacks the packed ones to nowhere: libmatio takes a cut
/// file for a shorter one, and does not look at checksums.
/// Source: "MAT-File Format", The MathWorks, R2023a: header of 128 bytes, then tags of 8 bytes (type, bytes).
/// @return how many variables there are @throws InputError: the file is cut, or a packed variable is damaged
std::size_t check_mat5_elements(const std::filesystem::path& file);

}  // namespace fxdyn

#pragma once

#include <string>
#include <string_view>

namespace fxdyn {

/// What a file is that can't be read as a text table, by its first bytes, and what to do about it, as in "is a
/// spreadsheet (xlsx or another zip archive): ..."; empty: text, as far as they show.
std::string foreign_format(std::string_view bytes);

}  // namespace fxdyn

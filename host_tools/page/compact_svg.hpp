#pragma once

#include <string>
#include <string_view>

namespace fxdyn::page {

/// A picture of gnuplot in fewer bytes, for a page whose style sheet is `style`: what begins most groups, labels and
/// lines of a frame is a class of it; paths go from point to point in tenths of a pixel; blanks, empty groups and empty
/// labels are left out. What it does not know stays as it is.
std::string compact_svg(std::string_view svg);

}  // namespace fxdyn::page

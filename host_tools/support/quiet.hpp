#pragma once

namespace fxdyn {

/// No progress bars from here on: Progress draws nothing.
void be_quiet();
bool is_quiet();

}  // namespace fxdyn

#pragma once

namespace fxdyn::page {

/// Style sheet of all pages: light and dark, narrow screens, print. Colours of text keep a contrast of at least 4.5
/// against what is behind them (tests/report/browser measures it).
extern const char* const style;

}  // namespace fxdyn::page

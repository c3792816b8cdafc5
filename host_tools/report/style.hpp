#pragma once

namespace fxdyn {

/// Style sheet of report.html: light and dark, narrow screens, print. Colours of text keep a contrast of at least 4.5
/// against what is behind them (tests/report/browser measures it).
extern const char* const report_style;

}  // namespace fxdyn

#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Pieces of which report.html is put together. They escape the text that they are given.
namespace page {

std::string escape(std::string_view text);

struct Cell {
  std::string text;
  const char* kind = "";  ///< CSS classes: n (number), bad, amber, good
  std::string link = "";  ///< where a click leads; empty: nowhere
};
Cell number(double value, int digits = 4);
Cell percent(double share);

class Table {
 public:
  explicit Table(const std::vector<Cell>& header) { row("th", header); }
  void add(const std::vector<Cell>& cells) { row("td", cells); }
  /// In a frame that scrolls where the page is too narrow.
  std::string html() const { return "<div class=\"scroll\">" + bare_html() + "</div>\n"; }
  std::string bare_html() const { return "<table>\n" + rows_ + "</table>"; }

 private:
  void row(const char* tag, const std::vector<Cell>& cells);
  std::string rows_;
};

/// A whole page; `body` is HTML.
std::string document(std::string_view title, std::string_view body);
std::string paragraph(std::string_view words);
std::string section(std::string_view title);
std::string subsection(std::string_view title);

}  // namespace page
}  // namespace fxdyn

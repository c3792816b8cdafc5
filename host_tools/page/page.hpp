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

/// The first column names its row. On narrow screens a row becomes a list of "column: value".
class Table {
 public:
  explicit Table(const std::vector<Cell>& header);
  void add(const std::vector<Cell>& cells);
  /// In a frame that scrolls where the page is too narrow. A table without caption should stand under a heading.
  std::string html(std::string_view caption = {}) const;
  std::string bare_html(std::string_view caption = {}) const;

 private:
  std::vector<std::string> labels_;  ///< escaped
  std::string head_, rows_;
};

/// A whole page; `body` is HTML whose main part has the id `main`. With a live_figure() in it, live_parts() too.
std::string document(std::string_view title, std::string_view body);
/// The picture, an <svg> element, with a title for those who can't see it, and a caption.
std::string figure(std::string_view svg, std::string_view caption);
/// Figures one below the other, on paper two side by side.
std::string figures(const std::vector<std::string>& all);

std::string paragraph(std::string_view words);
std::string section(std::string_view title);
std::string subsection(std::string_view title);

}  // namespace page
}  // namespace fxdyn

#include "host_tools/page/page.hpp"

#include <fmt/format.h>

namespace fxdyn::page {

std::string escape(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

Cell number(double value, int digits) { return {fmt::format("{:.{}g}", value, digits), "n"}; }
Cell percent(double share) { return {fmt::format("{:.2f} %", 100 * share), "n"}; }

void Table::row(const char* tag, const std::vector<Cell>& cells) {
  rows_ += "<tr>";
  for (const Cell& cell : cells)
    rows_ += fmt::format("<{0} class=\"{1}\">{2}</{0}>", tag, cell.kind, escape(cell.text));
  rows_ += "</tr>\n";
}

std::string paragraph(std::string_view words) { return "<p>" + escape(words) + "</p>\n"; }
std::string section(std::string_view title) { return "<h2>" + escape(title) + "</h2>\n"; }
std::string subsection(std::string_view title) { return "<h3>" + escape(title) + "</h3>\n"; }

}  // namespace fxdyn::page

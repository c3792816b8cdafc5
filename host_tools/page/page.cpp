#include "host_tools/page/page.hpp"

#include <fmt/format.h>

namespace fxdyn::page {
namespace {

constexpr const char* style = R"(
body { font: 15px/1.45 system-ui, sans-serif; color: #222; margin: 0 auto; max-width: 1080px; padding: 1.5em; }
h1 { font-size: 1.7em; margin: 0; } h2 { font-size: 1.25em; margin: 2em 0 .4em; border-bottom: 2px solid #e4572e; }
h3 { font-size: 1em; margin: 1.6em 0 .2em; } p { margin: .4em 0; max-width: 52em; } .quiet { color: #666; }
table { border-collapse: collapse; margin: .6em 0; font-size: .92em; }
th, td { padding: .22em .7em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { background: #f4f4f4; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.bad { background: #fde5e0; } td.good { background: #e6f4e6; }
td.amber { background: #fdf0d0; } .split { columns: 2; column-gap: 3em; }
.split tr { break-inside: avoid; } svg { width: 100%; height: auto; } .scroll { overflow-x: auto; }
)";

}  // namespace

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
  for (const Cell& cell : cells) {
    std::string text = escape(cell.text);
    if (!cell.link.empty()) text = fmt::format("<a href=\"{}\">{}</a>", escape(cell.link), text);
    rows_ += fmt::format("<{0} class=\"{1}\">{2}</{0}>", tag, cell.kind, text);
  }
  rows_ += "</tr>\n";
}

std::string document(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>{} - "
      "fxdyn</title>\n<style>{}</style></head><body>\n{}</body></html>\n",
      escape(title), style, body);
}
std::string paragraph(std::string_view words) { return "<p>" + escape(words) + "</p>\n"; }
std::string section(std::string_view title) { return "<h2>" + escape(title) + "</h2>\n"; }
std::string subsection(std::string_view title) { return "<h3>" + escape(title) + "</h3>\n"; }

}  // namespace fxdyn::page

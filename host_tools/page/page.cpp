#include "host_tools/page/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "host_tools/page/compact_svg.hpp"
#include "host_tools/page/live_plot.hpp"
#include "host_tools/page/style.hpp"

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

Table::Table(const std::vector<Cell>& header) {
  for (const Cell& cell : header) {
    labels_.push_back(escape(cell.text));
    head_ += fmt::format("<th scope=\"col\" class=\"{}\">{}</th>", cell.kind, labels_.back());
  }
}

void Table::add(const std::vector<Cell>& cells) {
  rows_ += "<tr>";
  for (std::size_t i = 0; i < cells.size(); ++i) {
    std::string words = escape(cells[i].text);
    if (!cells[i].link.empty()) words = fmt::format("<a href=\"{}\">{}</a>", escape(cells[i].link), words);
    if (i == 0 && !words.empty())
      rows_ += fmt::format("<th scope=\"row\" class=\"{}\">{}</th>", cells[i].kind, words);
    else
      rows_ += fmt::format("<td data-label=\"{}\" class=\"{}\">{}</td>", i < labels_.size() ? labels_[i] : "",
                           cells[i].kind, words);
  }
  rows_ += "</tr>\n";
}

std::string document(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n<title>{} - "
      "fxdyn</title>\n<style>{}</style></head><body>\n<a class=\"skip\" href=\"#main\">To the "
      "content</a>\n{}{}</body></html>\n",
      escape(title), style, body, body.find("<figure class=\"live\"") != std::string_view::npos ? live_parts() : "");
}

std::string Table::bare_html(std::string_view caption) const {
  const std::string named = caption.empty() ? "" : "<caption>" + escape(caption) + "</caption>\n";
  return "<table>\n" + named + "<thead><tr>" + head_ + "</tr></thead>\n<tbody>\n" + rows_ + "</tbody></table>";
}

std::string Table::html(std::string_view caption) const {
  return fmt::format("<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"{}\">{}</div>\n",
                     caption.empty() ? "table" : escape(caption), bare_html(caption));
}

std::string figure(std::string_view svg, std::string_view caption) {
  const std::string words = escape(caption);
  std::string picture = compact_svg(svg);
  for (const char* key : {"xmlns=\"", "xmlns:xlink=\""}) {  // of a file of its own; HTML needs none
    const std::size_t at = picture.find(key),
                      end = picture.find('"', at == std::string::npos ? at : at + std::strlen(key));
    if (at < picture.find('>') && end != std::string::npos) picture.erase(at, end + 1 - at);
  }
  const std::size_t open = picture.find('>');
  if (picture.starts_with("<svg") && open != std::string::npos) {
    picture.insert(open + 1, "<title>" + words + "</title>");
    picture.insert(4, " class=\"plot\" role=\"img\"");
  }
  return "<figure><figcaption>" + words + "</figcaption>\n" + picture + "</figure>\n";
}

std::string figures(const std::vector<std::string>& all) {
  std::string out;
  for (const std::string& one : all) out += one;
  return out.empty() ? out : "<div class=\"figures\">\n" + out + "</div>\n";
}

std::string paragraph(std::string_view words) { return "<p>" + escape(words) + "</p>\n"; }
std::string section(std::string_view title) { return "<h2>" + escape(title) + "</h2>\n"; }
std::string subsection(std::string_view title) { return "<h3>" + escape(title) + "</h3>\n"; }

}  // namespace fxdyn::page

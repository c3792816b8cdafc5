#include "host_tools/page/live_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "host_tools/page/page.hpp"
#include "host_tools/page/time_axis.hpp"

namespace fxdyn::page {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Of each bucket of samples those with the lowest and the highest residual, in order.
std::vector<Index> kept_samples(const VectorXd& residual, Index most) {
  std::vector<Index> out;
  const Index buckets = std::max<Index>(1, most / 2), count = residual.size();
  for (Index b = 0; b < std::min(buckets, count); ++b) {
    const Index n = std::min(buckets, count), from = b * count / n, length = (b + 1) * count / n - from;
    Index low = 0, high = 0;
    residual.segment(from, length).minCoeff(&low);
    residual.segment(from, length).maxCoeff(&high);
    out.push_back(from + std::min(low, high));
    if (low != high) out.push_back(from + std::max(low, high));
  }
  return out;
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8U | (k < left ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) out += k <= left ? letters[word >> (18 - 6 * k) & 63U] : '=';
  }
  return out;
}

/// The column's two ends, and its samples between them as numbers of 16 bits, little end first.
struct Packed {
  std::string ends;
  std::vector<std::uint8_t> bytes;
  void add(const VectorXd& column, const std::vector<Index>& kept) {
    constexpr double largest = 65535;
    const double low = column.minCoeff(), high = column.maxCoeff();
    ends += fmt::format("{}{:.9g} {:.9g}", ends.empty() ? "" : " ", low, high);
    for (const Index k : kept) {
      const double share = high > low ? (column[k] - low) / (high - low) : 0;
      const auto raw = static_cast<std::uint16_t>(std::lround(std::clamp(share, 0.0, 1.0) * largest));
      bytes.push_back(static_cast<std::uint8_t>(raw & 255U));
      bytes.push_back(static_cast<std::uint8_t>(raw >> 8U));
    }
  }
};

}  // namespace

bool has_live_plots() { return *live_script != '\0'; }

std::string live_figure(std::string_view svg, std::string_view caption, const LivePlot& plot) {
  std::string out = figure(svg, caption);
  constexpr std::string_view tag = "<figure";
  if (!has_live_plots() || plot.t.size() == 0 || !out.starts_with(tag)) return out;
  const VectorXd residual = plot.measured - plot.predicted;
  if (!residual.allFinite() || !plot.velocity.allFinite() || !plot.position.allFinite()) return out;
  const double origin = time_origin(plot.t);
  const std::vector<Index> kept = kept_samples(residual, plot.most_samples);
  Packed data;
  for (const VectorXd& column :
       {VectorXd(plot.t.array() - origin), plot.measured, residual, plot.velocity, plot.position})
    data.add(column, kept);
  out.insert(tag.size(),
             fmt::format(" class=\"live\" data-units=\"{} {}\" data-time=\"{}\" data-ends=\"{}\" data-live=\"{}\"",
                         escape(plot.torque_unit), escape(plot.path_unit), escape(time_label("time [s]", origin)),
                         data.ends, base64(data.bytes)));
  return out;
}

std::string live_parts() {
  return has_live_plots() ? fmt::format("<style>{}</style>\n<script>{}</script>\n", live_style, live_script) : "";
}

}  // namespace fxdyn::page

#include "host_tools/page/plot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "host_tools/page/time_axis.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/temporary_folder.hpp"

extern char** environ;

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// Runs gnuplot on script.gp inside the directory: no shell, no user settings, no input. Returns what went wrong, or
/// nothing.
std::string run_gnuplot(const fs::path& directory) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "errors.txt", O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::array<std::string, 3> words{"gnuplot", "-d", "script.gp"};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t child = -1;
  const int failed = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed == ENOENT) return "gnuplot not found: run toolchains/setup.sh";
  if (failed != 0) return fmt::format("gnuplot can't be started: {}", std::strerror(failed));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {}
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  std::string errors = read_file(directory / "errors.txt");
  std::replace(errors.begin(), errors.end(), '\n', ' ');
  return fmt::format("gnuplot failed: {}", errors);
}

/// The curve as a gnuplot data block of at most `points` lines: of each bucket its lowest and highest sample, in time
/// order.
std::string curve(const Eigen::VectorXd& t, const Eigen::VectorXd& y, Eigen::Index points, double origin) {
  std::string text;
  const auto line = [&](Eigen::Index k) { text += fmt::format("{:.6g} {:.6g}\n", t[k] - origin, y[k]); };
  if (y.size() <= points) {
    for (Eigen::Index k = 0; k < y.size(); ++k) line(k);
  } else {
    const Eigen::Index buckets = points / 2;
    for (Eigen::Index b = 0; b < buckets; ++b) {
      const Eigen::Index from = b * y.size() / buckets, count = (b + 1) * y.size() / buckets - from;
      Eigen::Index low = 0, high = 0;
      y.segment(from, count).minCoeff(&low);
      y.segment(from, count).maxCoeff(&high);
      line(from + std::min(low, high));
      if (low != high) line(from + std::max(low, high));
    }
  }
  return text + "\n\n";
}

/// Every n-th point of a curve that may go back and forth; NaN breaks it.
std::string path(const Eigen::VectorXd& x, const Eigen::VectorXd& y, Eigen::Index points) {
  std::string text;
  const Eigen::Index stride = std::max<Eigen::Index>(1, (y.size() + points - 1) / points);
  for (Eigen::Index k = 0; k < y.size(); ++k) {
    if (std::isnan(y[k]))
      text += "\n";
    else if (k % stride == 0)
      text += fmt::format("{:.4g} {:.4g}\n", x[k], y[k]);
  }
  return text + "\n\n";
}

/// As it can stand in gnuplot's quotes.
std::string quoted(std::string words) {
  std::replace(words.begin(), words.end(), '\'', ' ');
  return words;
}

/// The key stands above the plot, which makes room for its rows where no top margin is set.
constexpr const char* settings =
    R"(set terminal svg size 1000,420 dynamic noenhanced font 'sans-serif,13' background '#ffffff'
set encoding utf8
set grid lc rgb '#e4e4e4' lt 1
set border 3 lc rgb '#888888'
set tics nomirror textcolor rgb '#333333'
set key tmargin right horizontal samplen 2
set lmargin 11
set rmargin 2
)";

/// The next of 1, 2, 5, 10 .. above the value: the end of the residual's axis.
double round_up(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(std::max(value, 1e-12))));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (value <= step * decade) return step * decade;
  }
  return 10 * decade;
}

std::string commands(std::size_t number, const TorquePlot& plot) {
  const double origin = time_origin(plot.t);
  const std::string data = fmt::format("{}.dat", number);
  return fmt::format(R"(set output '{0}.svg'
set multiplot
set xrange [{1:.6g}:{2:.6g}]
set origin 0,0.36
set size 1,0.64
set tmargin 2
set autoscale y
set ytics autofreq
set format x ''
unset xlabel
set ylabel 'torque [{3}]'
plot '{4}' index 0 with lines lw 1.6 lc rgb '#222222' title 'measured', \
     '{4}' index 1 with lines lw 1.2 lc rgb '#e4572e' title 'predicted'
set origin 0,0
set size 1,0.4
set tmargin 1
set yrange [-{5:g}:{5:g}]
set ytics {5:g}
set format x '%g'
set xlabel '{6}'
set ylabel 'residual [{3}]'
plot '{4}' index 2 with lines lw 1 lc rgb '#2e6fb7' notitle
unset multiplot
unset output
)",
                     number, plot.t[0] - origin, plot.t[plot.t.size() - 1] - origin, plot.unit, data,
                     round_up((plot.measured - plot.predicted).cwiseAbs().maxCoeff()), time_label("time [s]", origin));
}

/// Colours of curves that share a panel; more curves than these take them again.
constexpr std::array colours{"#222222", "#e4572e", "#2e6fb7", "#3a9d5d", "#b07aa1", "#c9a227", "#17a2b8", "#8c564b"};

/// Cuts everything from `from` to the end of the next `to`, wherever it occurs.
void cut(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t start = text.find(from); start != std::string::npos; start = text.find(from, start)) {
    const std::size_t end = text.find(to, start + from.size());
    if (end == std::string::npos) return;
    text.erase(start, end + to.size() - start);
  }
}

/// The <svg> element as it can stand in a page with others: no XML prolog, no title (a tooltip everywhere), no ids.
std::string element(const std::string& file) {
  std::string svg = file.substr(std::min(file.size(), file.find("<svg")));
  cut(svg, "<title>", "</title>");
  cut(svg, "<desc>", "</desc>");
  cut(svg, "<defs>", "</defs>");
  cut(svg, " id=\"", "\"");
  return svg;
}

/// In place of a plot: hours of computing must not be lost for a picture.
std::string no_picture(const std::string& why) {
  std::string text;
  for (const char c : why) text += c == '<' || c == '>' || c == '&' ? ' ' : c;
  return fmt::format(
      "<svg viewBox=\"0 0 1000 60\"><text x=\"10\" y=\"35\" font-size=\"14\">This plot could not be drawn: "
      "{}</text></svg>",
      text);
}

/// Plots 0.svg, 1.svg, .. of script.gp in the directory.
std::vector<std::string> pictures(const fs::path& directory, std::size_t count) {
  const std::string wrong = run_gnuplot(directory);
  static std::atomic<bool> said = false;  // a page has many plots
  if (!wrong.empty() && !said.exchange(true)) fmt::print(stderr, "note: plots are missing: {}\n", wrong);
  std::vector<std::string> out;
  for (std::size_t i = 0; i < count; ++i) {
    const fs::path file = directory / fmt::format("{}.svg", i);
    const std::string svg = fs::exists(file) ? element(read_file(file)) : "";
    out.push_back(svg.find("</svg>") != std::string::npos ? svg
                                                          : no_picture(wrong.empty() ? "gnuplot wrote no svg" : wrong));
  }
  return out;
}

}  // namespace

double time_origin(const Eigen::VectorXd& t) {
  constexpr double resolved = 1e-4;
  const double length = t[t.size() - 1] - t[0];
  return std::fabs(t[0]) * resolved > length ? t[0] : 0;
}

std::string time_label(const std::string& axis, double origin) {
  return origin == 0 ? axis : fmt::format("{} after {:.12g}", axis, origin);
}

std::vector<std::string> draw(const std::vector<TorquePlot>& plots) {
  if (plots.empty()) return {};
  // Three curves a plot, in a page about 8 bytes a point (compact_svg) beside 6 kB of frame a plot: a page of six
  // joints and seven logs stays below 2 MB.
  const auto points = std::clamp<Eigen::Index>(310'000 / (24 * static_cast<Eigen::Index>(plots.size())), 100, 1000);
  const TemporaryFolder directory;
  std::string script = settings;
  for (std::size_t i = 0; i < plots.size(); ++i) {
    const TorquePlot& plot = plots[i];
    const double origin = time_origin(plot.t);
    write_file(directory.path() / fmt::format("{}.dat", i),
               curve(plot.t, plot.measured, points, origin) + curve(plot.t, plot.predicted, points, origin) +
                   curve(plot.t, plot.measured - plot.predicted, points, origin));
    script += commands(i, plot);
  }
  write_file(directory.path() / "script.gp", script);
  return pictures(directory.path(), plots.size());
}

std::string draw(const std::vector<Panel>& panels, const std::vector<std::string>& names) {
  constexpr int panel_height = 260;
  constexpr Eigen::Index panel_points = 500;
  const TemporaryFolder directory;
  std::string script = settings;
  script += fmt::format(
      "set terminal svg size 1000,{} dynamic noenhanced font 'sans-serif,13' background '#ffffff'\nset output "
      "'0.svg'\nset multiplot layout {},1\n",
      panel_height * panels.size(), panels.size());
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const Panel& panel = panels[p];
    const double origin = time_origin(panel.t);
    std::string data, lines;
    for (Eigen::Index c = 0; c < panel.columns.cols(); ++c) {
      const auto i = static_cast<std::size_t>(c);
      data += curve(panel.t, panel.columns.col(c), panel_points, origin);
      lines += fmt::format("{}'{}.dat' index {} with lines lw 1.4 lc rgb '{}' title '{}'", c > 0 ? ", " : "", p, c,
                           colours[i % colours.size()], quoted(names[i]));
    }
    write_file(directory.path() / fmt::format("{}.dat", p), data);
    script += fmt::format("set xrange [{:.6g}:{:.6g}]\nset ylabel '{}'\nset xlabel '{}'\nplot {}\n",
                          panel.t[0] - origin, panel.t[panel.t.size() - 1] - origin, panel.label,
                          p + 1 == panels.size() ? time_label("time [s]", origin) : "", lines);
    script += "unset key\n";  // one is enough
  }
  write_file(directory.path() / "script.gp", script + "unset multiplot\nunset output\n");
  return pictures(directory.path(), 1).front();
}

namespace {

/// gnuplot's words for one curve, whose data it writes into the directory.
std::string curve_command(const Trace& one, const fs::path& directory, const std::string& file, double origin) {
  constexpr Eigen::Index chart_points = 600;
  const std::string title = one.title.empty() ? "notitle" : "title '" + quoted(one.title) + "'";
  if (one.y_top.size() > 0) {
    std::string text;
    for (Eigen::Index k = 0; k < one.x.size(); ++k)
      text += fmt::format("{:.5g} {:.5g} {:.5g}\n", one.x[k] - origin, one.y[k], one.y_top[k]);
    write_file(directory / file, text);
    return fmt::format("'{}' using 1:2:3 with filledcurves lc rgb '{}' {}", file, one.colour, title);
  }
  write_file(directory / file, one.path ? path(one.x, one.y, chart_points) : curve(one.x, one.y, chart_points, origin));
  return fmt::format("'{}' with lines lw {} lc rgb '{}' {}", file, one.width, one.colour, title);
}

std::string chart_commands(const Chart& chart, const fs::path& directory, const std::string& name) {
  const bool has_origin = !chart.curves.empty() && !chart.curves[0].path && chart.curves[0].x.size() > 0;
  const double origin = has_origin ? time_origin(chart.curves[0].x) : 0;
  std::string lines;
  for (std::size_t i = 0; i < chart.curves.size(); ++i)
    lines += (i > 0 ? ", " : "") + curve_command(chart.curves[i], directory, fmt::format("{}_{}.dat", name, i), origin);
  const std::string range =
      chart.y_from < chart.y_to ? fmt::format("[{:.6g}:{:.6g}]", chart.y_from, chart.y_to) : "[*:*]";
  return fmt::format("{} logscale y\nset yrange {}\nset format y '{}'\nset xlabel '{}'\nset ylabel '{}'\nplot {}\n",
                     chart.logarithmic ? "set" : "unset", range, chart.logarithmic ? "%.0e" : "%g",
                     quoted(time_label(chart.x_label, origin)), quoted(chart.y_label), lines);
}

}  // namespace

std::vector<std::string> draw(const std::vector<std::vector<Chart>>& all, int columns) {
  constexpr int row_height = 300;
  if (all.empty()) return {};
  const TemporaryFolder directory;
  std::string script = settings;
  for (std::size_t p = 0; p < all.size(); ++p) {
    const int rows = (static_cast<int>(all[p].size()) + columns - 1) / columns;
    script += fmt::format(
        "set terminal svg size 1000,{} dynamic noenhanced font 'sans-serif,12' background '#ffffff'\nset output "
        "'{}.svg'\nset multiplot layout {},{}\n",
        row_height * rows, p, rows, columns);
    for (std::size_t c = 0; c < all[p].size(); ++c)
      script += chart_commands(all[p][c], directory.path(), fmt::format("{}_{}", p, c));
    script += "unset multiplot\nunset output\n";
  }
  write_file(directory.path() / "script.gp", script);
  return pictures(directory.path(), all.size());
}

std::string draw(const std::vector<Chart>& charts, int columns) {
  return draw(std::vector<std::vector<Chart>>{charts}, columns).front();
}

}  // namespace fxdyn

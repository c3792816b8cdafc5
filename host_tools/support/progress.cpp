#include "host_tools/support/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>
#include <utility>

#include "host_tools/support/heap.hpp"
#include "host_tools/support/progress_listener.hpp"
#include "host_tools/support/quiet.hpp"

namespace fxdyn {
namespace {
constexpr std::size_t width = 30;
std::mutex drawing;
bool quiet = false;
ProgressListener told;
bool on_terminal() {
  static const bool yes = ::isatty(STDERR_FILENO) != 0;
  return yes;
}
}  // namespace

void be_quiet() { quiet = true; }
bool is_quiet() { return quiet; }
void set_progress_listener(ProgressListener listener) { told = std::move(listener); }

void Progress::stage(const std::string& name, std::size_t total) {
  give_back_memory();  // the next stage needs other matrices than the last
  done();
  name_ = name;
  total_ = total;
  steps_ = 0;
  if (told) told(name_, 0, total_);
  if (quiet) return;
  if (on_terminal()) {
    draw(0);
  } else {
    fmt::print(stderr, "{}\n", name_);
  }
}

void Progress::step() {
  const std::size_t steps = ++steps_;
  if (told) told(name_, steps, total_);
  if (on_terminal() && !quiet) draw(steps);
}

void Progress::draw(std::size_t steps) {
  const std::lock_guard lock(drawing);
  const std::size_t filled = total_ == 0 ? width : width * std::min(steps, total_) / total_;
  fmt::print(stderr, "\r{:<34} [{:#<{}}{:<{}}] {}/{} ", name_, "", filled, "", width - filled, std::min(steps, total_),
             total_);
  std::fflush(stderr);
}

void Progress::done() {
  if (!name_.empty() && on_terminal() && !quiet) fmt::print(stderr, "\n");
  name_.clear();
}

}  // namespace fxdyn

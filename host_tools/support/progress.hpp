#pragma once

#include <atomic>
#include <string>

namespace fxdyn {

/// A progress bar on stderr, one per stage of work. On a terminal it is redrawn; elsewhere each stage prints one line.
class Progress {
 public:
  /// What went wrong in a stage is printed on a line of its own.
  ~Progress() { done(); }
  /// Starts a stage of `total` steps; ends the one before.
  void stage(const std::string& name, std::size_t total);
  /// One step done; safe from several threads.
  void step();
  void done();

 private:
  void draw(std::size_t steps);
  std::string name_;
  std::size_t total_ = 0;
  std::atomic<std::size_t> steps_ = 0;
};

}  // namespace fxdyn

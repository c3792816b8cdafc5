#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "host_tools/fleet/robot_result.hpp"

namespace fxdyn::fleet {

/// DIR/robots/ID: what a robot has come to stands in files, each written by rename, and nowhere else. result.json is of
/// the inputs that input.sha256 names: it goes before another hash comes, and comes after it.
class RobotFolder {
 public:
  RobotFolder(const std::filesystem::path& directory, const std::string& id) : path_(directory / "robots" / id) {}
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path out() const { return path_ / "out"; }
  std::filesystem::path output() const { return path_ / "output.txt"; }

  bool is_done(const std::string& hash) const;
  /// Neither result nor complaint is there.
  void forget() const;
  /// The same, and whose inputs come next: whoever comes later sees what this run made of them.
  void begin(const std::string& hash) const;
  void finish(const RobotState& state, double seconds) const;
  void fail(const std::string& complaint) const;
  /// A complaint is there, or a result.
  bool is_ended() const;
  std::string complaint() const;  ///< empty: none
  std::optional<RobotState> result() const;
  std::optional<double> seconds() const;  ///< that its program took; none: not known

 private:
  std::filesystem::path path_;
};

/// Half-written files of processes that were killed. For whoever has the folder to himself.
void remove_leftovers(const std::filesystem::path& folder);

/// While it lives, no other process works on the same thing. On a file system without locks nobody is kept away: that
/// costs work, no result.
class Lock {
 public:
  explicit Lock(const std::filesystem::path& file);
  ~Lock();
  Lock(Lock&& other) noexcept : descriptor_(other.descriptor_), taken_(other.taken_) { other.descriptor_ = -1; }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  bool is_mine() const { return !taken_; }

 private:
  int descriptor_ = -1;
  bool taken_ = false;
};

}  // namespace fxdyn::fleet

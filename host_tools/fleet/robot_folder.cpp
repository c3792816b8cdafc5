#include "host_tools/fleet/robot_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <nlohmann/json.hpp>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

}  // namespace

bool RobotFolder::is_done(const std::string& hash) const {
  if (!fs::exists(path_ / "input.sha256") || read_file(path_ / "input.sha256") != hash + "\n") return false;
  try {
    return result().has_value();
  } catch (const InputError&) {
    return false;  // what a power cut left of it: done again
  }
}

void remove_leftovers(const fs::path& folder) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".tmp") fs::remove(entry.path(), error);
  }
}

void RobotFolder::forget() const {
  remove_leftovers(path_);
  std::error_code missing;
  fs::remove(path_ / "result.json", missing);
  fs::remove(path_ / "error.txt", missing);
}

void RobotFolder::begin(const std::string& hash) const {
  forget();
  std::error_code missing;
  // A stage that is left out would leave its old result behind.
  fs::remove_all(out(), missing);
  write_file(path_ / "input.sha256", hash + "\n");
}

void RobotFolder::finish(const RobotState& state, double seconds) const {
  write_file(path_ / "timing.json", json{{"schema", "fxdyn.fleet_timing/1"}, {"seconds", seconds}}.dump(1) + "\n");
  write_file(path_ / "result.json", to_json(state).dump(1) + "\n");
}

void RobotFolder::fail(const std::string& complaint) const {
  std::error_code missing;
  fs::remove(path_ / "result.json", missing);
  write_file(path_ / "error.txt", complaint + "\n");
}

bool RobotFolder::is_ended() const { return fs::exists(path_ / "result.json") || fs::exists(path_ / "error.txt"); }

std::string RobotFolder::complaint() const {
  if (!fs::exists(path_ / "error.txt")) return "";
  std::string text = read_file(path_ / "error.txt");
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

std::optional<RobotState> RobotFolder::result() const {
  const fs::path file = path_ / "result.json";
  if (!fs::exists(file)) return {};
  try {
    return robot_state_of(json::parse(read_file(file)));
  } catch (const json::exception&) {
    throw InputError(file.string() + ": is no result: remove it and start the fleet again");
  }
}

std::optional<double> RobotFolder::seconds() const {
  const fs::path file = path_ / "timing.json";
  if (!fs::exists(file)) return {};
  const json content = json::parse(read_file(file), nullptr, false);
  if (!content.is_object() || !content.contains("seconds")) return {};
  return content.at("seconds").get<double>();
}

Lock::Lock(const fs::path& file) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  taken_ = descriptor_ >= 0 && ::flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace fxdyn::fleet

// What this machine lacks, for which verb, and the command that changes it.

#include <fcntl.h>
#include <fmt/format.h>
#include <net/if_arp.h>
#include <sys/socket.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <vector>

#include "host_tools/cli/verb.hpp"
#include "host_tools/exchange/formats.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn::cli {
namespace {

namespace fs = std::filesystem;

/// Available memory below which a diagnosis of minutes of log may end early [MB]: 20 000 rows of six joints take 178.
constexpr double enough_memory_mb = 500;

struct Finding {
  const char* used_by;  ///< verbs or scripts
  std::string what;     ///< is looked for
  std::string found;    ///< empty: it is missing
  std::string command;  ///< that would change that
  bool host = false;    ///< a verb needs it that runs on this machine alone
};

/// What a shell would start by that name; empty: nothing.
std::string program(const std::string& name) {
  const char* set = std::getenv("PATH");
  std::istringstream folders(set == nullptr ? "/bin:/usr/bin" : set);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path file = fs::path(folder.empty() ? "." : folder) / name;
    std::error_code ignored;
    if (fs::is_regular_file(file, ignored) && ::access(file.c_str(), X_OK) == 0) return file.string();
  }
  return "";
}

std::string as_root(const std::string& command) { return (::geteuid() == 0 ? "" : "sudo ") + command; }
std::string package(const std::string& names) { return as_root("apt-get install " + names); }

Finding needs_program(const char* used_by, const char* name, const char* packages) {
  return {used_by, name, program(name), package(packages)};
}

Finding temporary_folder() {
  const char* set = std::getenv("TMPDIR");
  const std::string folder = set != nullptr && *set != '\0' ? set : "/tmp";
  const bool good = fs::is_directory(folder) && ::access(folder.c_str(), W_OK | X_OK) == 0;
  return {"plots of all verbs", "folder for temporary files", good ? folder : "",
          fmt::format("export TMPDIR=/tmp  # {} can't be written", folder), true};
}

Finding memory() {
  std::ifstream file("/proc/meminfo");
  double available_kb = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("MemAvailable:")) available_kb = std::strtod(line.c_str() + 13, nullptr);
  }
  const double mb = available_kb / 1024;
  const bool good = mb == 0 || mb >= enough_memory_mb;  // 0: this kernel does not say
  return {
      "run, diagnose, train", fmt::format("{:.0f} MB of memory", enough_memory_mb),
      good
          ? (mb == 0 ? "not known" : fmt::format("{:.0f} MB free, {} threads", mb, std::thread::hardware_concurrency()))
          : "",
      fmt::format("ps aux --sort=-rss | head  # only {:.0f} MB are free; shorter logs (from_s, to_s) need less", mb),
      true};
}

/// fxdyn itself writes numbers with a point whatever the locale; a missing one makes other programs complain.
Finding locale() {
  const char* name = nullptr;
  for (const char* variable : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    name = std::getenv(variable);
    if (name != nullptr && *name != '\0') break;
  }
  const bool set = name != nullptr && *name != '\0';
  const bool good = std::setlocale(LC_ALL, "") != nullptr;
  std::setlocale(LC_ALL, "C");
  return {"gnuplot, ± on the terminal", "locale", good ? (set ? name : "C") : "",
          fmt::format("export LC_ALL=C.UTF-8  # {} is not installed", set ? name : "")};
}

/// Network interfaces that are CAN controllers, virtual ones too.
Finding can_interface() {
  const char* used_by = "replay --can";
  const int raw = ::socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC, 1);
  if (raw < 0) return {used_by, "CAN in the kernel", "", as_root("modprobe can_raw") + "  # or a kernel that has it"};
  ::close(raw);
  std::string names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/sys/class/net", ignored)) {
    int type = 0;
    std::ifstream(entry.path() / "type") >> type;
    if (type == ARPHRD_CAN) names += (names.empty() ? "" : ", ") + entry.path().filename().string();
  }
  return {used_by, "a CAN interface", names,
          as_root("ip link set can0 up type can bitrate 1000000") +
              "  # without hardware: " + as_root("ip link add vcan0 type vcan && ") + as_root("ip link set vcan0 up")};
}

Finding gpio_chip() {
  const char* used_by = "the node on Linux (pins)";
  std::string names, locked;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/dev", ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("gpiochip")) continue;
    std::string& list = ::access(entry.path().c_str(), R_OK | W_OK) == 0 ? names : locked;
    list += (list.empty() ? "" : ", ") + name;
  }
  return {used_by, "a GPIO chip", names,
          names.empty() && !locked.empty() ? fmt::format("sudo usermod -aG gpio $USER  # {} is not yours", locked)
                                           : as_root("modprobe gpio-sim") + "  # without hardware: simulated pins"};
}

std::vector<Finding> findings() {
  std::vector<Finding> out{needs_program("run, report, excite, forward", "gnuplot", "gnuplot-nox"), temporary_folder(),
                           memory()};
  out.front().host = true;
  out.push_back(locale());
  out.push_back(needs_program("building fxdyn", "g++", "g++"));
  out.push_back(needs_program("building fxdyn", "cmake", "cmake"));
  out.push_back(needs_program("building fxdyn", "ninja", "ninja-build"));
  out.push_back(needs_program("build_image.sh (firmware)", "arm-none-eabi-g++",
                              "gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib"));
  out.push_back(needs_program("replay --image, demo.sh", "qemu-system-arm", "qemu-system-arm"));
  out.push_back({"export --to sdf", "libsdformat", can_read_sdf() ? "12" : "", package("libsdformat12-12")});
  out.push_back(can_interface());
  out.push_back(gpio_chip());
  out.push_back(needs_program("flashing a board", "openocd", "openocd"));
  return out;
}

void print_json(const std::vector<Finding>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const Finding& one : all) {
    nlohmann::json entry{{"used_by", one.used_by}, {"looked_for", one.what}, {"found", one.found}};
    if (one.found.empty()) entry["command"] = one.command;
    list.push_back(std::move(entry));
  }
  fmt::print("{}\n", list.dump(1));
}

void look(bool as_json) {
  const std::vector<Finding> all = findings();
  if (as_json) return print_json(all);
  std::string missing;
  const Finding* needed = nullptr;
  fmt::print("{:<30}{:<29}{}\n", "used by", "looked for", "found");
  for (const Finding& one : all) {
    fmt::print("{:<30}{:<29}{}\n", one.used_by, one.what, one.found.empty() ? "MISSING" : one.found);
    if (!one.found.empty()) continue;
    missing += fmt::format("  {:<29}{}\n", one.what + ":", one.command);
    if (one.host && needed == nullptr) needed = &one;
  }
  if (missing.empty()) {
    fmt::print("nothing is missing\n");
    return;
  }
  fmt::print("to get what is missing (toolchains/setup.sh installs all packages):\n{}", missing);
  if (needed != nullptr)
    throw DataError(fmt::format("{} is missing, which {} need: {}", needed->what, needed->used_by, needed->command));
  fmt::print("all verbs that need no target run on this machine\n");
}

}  // namespace

Action add_doctor(CLI::App& verb) {
  const auto as_json = std::make_shared<bool>(false);
  verb.add_flag("--json", *as_json, "for machines");
  return [as_json] { look(*as_json); };
}

}  // namespace fxdyn::cli

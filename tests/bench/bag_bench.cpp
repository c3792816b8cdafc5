// fxdyn_bag_bench FILE: seconds to read a log of six joints, and the most memory that the process had [MB]. See
// bags.py.
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>

#include "host_tools/readers/log_reader.hpp"

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const std::vector<std::string> joints{"base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"};
  const std::filesystem::path file = arguments[1];
  const auto begin = std::chrono::steady_clock::now();
  const fxdyn::Log log = fxdyn::read_log(file, joints.size(), std::vector<bool>(joints.size(), true),
                                         fxdyn::with_joint_names(file, {}, joints), {}, {});
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  fmt::print("{:.4f} {:.1f} {}\n", seconds.count(), static_cast<double>(usage.ru_maxrss) / 1000, log.samples());
  return log.samples() > 1000 ? 0 : 1;
}

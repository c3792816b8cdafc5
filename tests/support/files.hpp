#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host_tools/support/error.hpp"

namespace fxdyn::test {

/// A folder of this process: tests run side by side.
inline std::filesystem::path folder() {
  const auto path = std::filesystem::path(testing::TempDir()) / ("fxdyn_test_" + std::to_string(::getpid()));
  std::filesystem::create_directories(path);
  return path;
}

inline std::filesystem::path write(const std::string& name, const std::string& text) {
  std::ofstream(folder() / name, std::ios::binary) << text;
  return folder() / name;
}

/// Bad input and parts of the message that it has to give.
struct Bad {
  std::string name, text;
  std::vector<std::string> message;
};

inline void PrintTo(const Bad& bad, std::ostream* out) { *out << bad.name; }

template <class Action>
void expect_refused(const std::filesystem::path& file, const std::vector<std::string>& parts, Action action) {
  std::string message;
  try {
    action();
  } catch (const InputError& error) {
    message = error.what();
  }
  EXPECT_NE(message.find(file.filename().string()), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  for (const std::string& part : parts)
    EXPECT_NE(message.find(part), std::string::npos) << part << " not in: " << message;
}

}  // namespace fxdyn::test

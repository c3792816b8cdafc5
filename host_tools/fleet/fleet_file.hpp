#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fxdyn::fleet {

/// What one robot's program may take, so that one bad log costs nobody else.
struct Limits {
  double time_s = 3600;           ///< wall time [s]; hand: a minute of log takes seconds
  std::int64_t memory_mb = 4096;  ///< memory that it writes to [MB]; hand: 20 000 rows of six joints take 178
};

struct Member {
  std::string id;
  std::filesystem::path project;                ///< absolute
  std::vector<std::filesystem::path> baseline;  ///< logs of a healthy session, absolute
  std::string overrides;                        ///< TOML that takes the place of the same keys in the project
  int line = 0;                                 ///< in the fleet file
};

/// A fleet file (TOML), see docs/guide/fleet.md. Paths are relative to it.
struct Fleet {
  std::filesystem::path file;  ///< absolute
  std::string verb = "diagnose";
  Limits limits;
  double false_discovery_rate = 0.05;  ///< share of false ones among the robots that are listed; hand
  std::vector<Member> members;         ///< by id
};

/// @throws InputError with file and line: not TOML, an unknown key, no robots, two with one id, a baseline of two. A
/// project that is gone is its robot's failure, not the fleet's.
Fleet read_fleet(const std::filesystem::path& file);

}  // namespace fxdyn::fleet

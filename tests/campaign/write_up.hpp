#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace fxdyn::campaign {

/// How many of how many.
struct Rate {
  std::size_t of = 0, hit = 0;
  double value() const { return of == 0 ? 0 : static_cast<double>(hit) / static_cast<double>(of); }
};

/// One figure beside its goal.
struct Figure {
  std::string what, goal;
  double value = 0;
  std::size_t cases = 0;
  bool met = false;
};
std::vector<Figure> figures(const std::vector<nlohmann::json>& results);

/// The page for docs/findings: figures, confusion matrices, the cases that failed.
/// @param commit what the program was built from
std::string write_up(const std::vector<nlohmann::json>& results, const std::string& command, const std::string& commit);

}  // namespace fxdyn::campaign

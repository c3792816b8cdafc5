#pragma once

#include <string>

namespace fxdyn {

/// A log that a result was made from: file, role and window of the project, hash of its bytes.
struct LogReference {
  std::string file, role, hash;
  double from_s = 0, to_s = 0;
  bool operator==(const LogReference&) const = default;
};

}  // namespace fxdyn

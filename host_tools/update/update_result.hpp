#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fxdyn {

/// Content of update.json.
struct UpdateResult {
  /// RMSE with the coefficients before and after [N*m | N].
  struct Change {
    double before = 0, after = 0;
  };
  struct Joint {
    std::string name, unit;
    double rated_torque = 0;  ///< [N*m | N]
    Change held_out;          ///< on the part of the log that was not refitted
    std::optional<Change> test;
  };
  /// Of the tables' page; none: nothing was replaced.
  struct Page {
    std::uint32_t before = 0;
    std::optional<std::uint32_t> after;
  };
  std::string log, hash;
  double refit_s = 0, held_out_s = 0;
  double forgetting = 1;  ///< what was known a second ago counts this
  std::vector<Joint> joints;
  double mean_log_ratio = 0;  ///< mean over the joints of log(after / before), held out
  Page tables_crc, sequence;
  bool accepted = false;
};
nlohmann::json to_json(const UpdateResult& result);

}  // namespace fxdyn

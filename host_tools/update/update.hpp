#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/update/options.hpp"

namespace fxdyn {

struct UpdateSettings {
  std::filesystem::path log;         ///< of a new session, read like the project's logs
  std::optional<double> forgetting;  ///< what was known a second ago counts this; none: the project's
  bool rebuild = false;              ///< choose formats and layout anew: the firmware has to be built again
};

struct Update {
  bool accepted = false;  ///< false: worse on the held-out part of the log, nothing was replaced
  std::string table;      ///< errors before and after, for people
};

/// The paper's weight updating module (Fig. 4): refits base parameters, the effects' linear coefficients and the BLSs'
/// output weights by recursive least squares, from what DIR/information.cbor stores of all logs before and the first
/// two thirds of the new log. Shapes, input weights and what the fit has no columns for stay. The last third judges old
/// and new, with the project's test logs beside it. Where the new coefficients are better, and the formats and the
/// layout of the exported tables hold them, DIR has new tables that firmware takes without a rebuild; the page before
/// stays as tables.previous.bin. DIR/update.json says what happened.
/// @throws InputError: no trained and exported model in DIR, the log is used already or can't be read.
/// @throws DataError: a joint does not move, the log contradicts itself, the tables' formats do not hold the result.
Update update(Pipeline& pipeline, const UpdateSettings& settings, const UpdateOptions& options = {});

}  // namespace fxdyn

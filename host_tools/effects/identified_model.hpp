#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/base_parameter.hpp"
#include "host_tools/effects/filter_fit.hpp"
#include "host_tools/effects/formats_json.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/effects/lineage.hpp"
#include "host_tools/effects/log_reference.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/effects/session.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/numbers/formats.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// What the layout of exported tables takes from the values in them, beside the formats: it stays when an update
/// replaces the values, so that firmware that is built for the layout takes the new ones.
struct TableLayout {
  std::vector<unsigned> parameters;  ///< per link, bit k: inertial parameter k is computed, else it is zero
  std::vector<int> node_bits;        ///< per joint: fractional bits of the BLS's node coefficients; 0 without one
};

/// Everything that predict, export and simulate need: the content of model.json.
struct IdentifiedModel {
  Robot robot;
  std::vector<LinkInertia<Real>> inertia;  ///< representative: Y [beta; 0] = Y_b beta, DH frames
  std::vector<BaseParameter> base;
  std::vector<JointFit> joints;
  std::vector<EffectFit> body;  ///< payload, gravity_tilt
  FilterFit filter;
  /// How to read logs, by file name; "" stands for logs that the project does not name.
  std::map<std::string, LogFormat> log_formats;
  double tick_s = 0.002;
  std::uint64_t seed = 1;
  std::string project, project_hash;
  std::vector<LogReference> logs;
  std::vector<std::string> notes;     ///< what a reader should know of data and fit
  std::string stage = "identified";   ///< or "diagnosed", "trained"
  std::optional<Session> session;     ///< of the diagnosed logs, where their windows do not overlap
  std::vector<LogReference> updates;  ///< logs that `fxdyn update` has refitted the coefficients with, in their order
  /// Of the exported tables; a stage that changes the model drops them.
  std::optional<Formats> formats;
  std::optional<TableLayout> layout;
  std::uint32_t tables_crc = 0;
  Lineage lineage;

  /// For other tables of the same model.
  void drop_formats() {
    formats.reset();
    layout.reset();
    tables_crc = 0;
  }
  /// It is another model now.
  void drop_tables() {
    drop_formats();
    lineage = {};
  }
};

/// "flexible" of a joint in model.json.
nlohmann::json flexible_json(const FlexibleJoint& joint, const Robot& robot);
/// @throws InputError naming the file and the missing or wrong key.
IdentifiedModel read_model(const std::filesystem::path& file);

}  // namespace fxdyn

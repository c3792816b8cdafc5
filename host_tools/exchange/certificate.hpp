#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/exchange/formats.hpp"

namespace fxdyn {

struct CertificateOptions {
  /// What was read back may differ from what was meant, where friction slides, of the joint's largest torque [-].
  /// Rounding of 17 digits and of another library's rigid body leaves 1e-12; hand.
  double as_meant = 1e-6;
  /// The same of the drive's tables in fixed point: a tenth of the 1 % that export allows at most, of rated torque;
  /// hand.
  double as_meant_fixed = 1e-3;
};

/// What a written file says of one joint, over the held-out logs. [N*m | N]
struct JointCertificate {
  std::string name, unit;
  std::optional<SimpleJoint> written;  ///< nothing: the whole model
  std::vector<std::string> left_out;  ///< effects without a word in the format; of the whole model: those that remember
  std::string friction_model;         ///< what the format calls it; empty: it has one form only
  double cannot_say = 0;              ///< RMS of model minus file, both below the torque's cut-off
  /// What would be left of it if the file were right wherever the joint turns round or stands.
  double cannot_say_in_motion = 0;
  /// What would be left of that if the file had the model's own load friction; nothing: the joint has none in the file.
  std::optional<double> cannot_say_without_load_friction;
  double file_rmse = 0;      ///< of measured minus file
  double model_rmse = 0;     ///< of measured minus model
  double misread = 0;        ///< largest |read back - meant| where friction slides
  double largest = 0;        ///< largest |meant|: what `misread` is compared with
  double sliding_share = 0;  ///< of the samples
  bool as_meant = true;      ///< the format's own library reads what was meant
};

struct Certificate {
  std::string format, file, reader;
  std::string role;               ///< of the logs: "test", or "validate" where there are none
  std::vector<std::string> logs;  ///< their files
  std::vector<JointCertificate> joints;
  bool as_meant() const;
};

/// Reads the file back by its format's own library, replays the logs, and compares the torques with those of the model,
/// with the measured ones, and with what was meant. The file is taken as it is: whoever changed it is found out.
/// @param logs held-out logs, not empty, without a known load
/// @throws DataError: the library refuses the file
Certificate certify(const ExportFormat& format, const std::filesystem::path& file, const SimpleRobot& meant,
                    const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                    const CertificateOptions& options = {});

nlohmann::json to_json(const Certificate& certificate);
/// One line a joint.
std::string certificate_table(const Certificate& certificate);

/// @throws DataError naming the joint that is read back otherwise than it was meant
void require_as_meant(const Certificate& certificate);

}  // namespace fxdyn

#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Which data decides what: see docs/guide. `baseline` serves `diagnose` only.
enum class Role { baseline, train, validate, test };
std::string to_string(Role role);
/// The role of that name. @throws InputError: there is none
Role role_of(std::string_view name);

/// A load on the flange: a point mass at `com` in the last link's URDF frame.
struct Load {
  double mass = 0;                                ///< [kg]
  Eigen::Vector3d com = Eigen::Vector3d::Zero();  ///< [m]
};

/// A measured or simulated log on a uniform time grid, SI units, joint side of the gearbox. Matrices are samples x
/// joints. Signals that the file does not have are empty (0 x 0).
struct Log {
  std::filesystem::path file;
  Role role = Role::train;
  double from_s = 0, to_s = 0;  ///< the half-open window that was cut out
  double step_s = 0;            ///< sampling interval
  bool resampled = false;       ///< the file's time stamps were irregular
  Eigen::VectorXd t;            ///< [s]
  Eigen::VectorXd stamps;       ///< the file's own time stamps in the window [s]; empty: t
  Eigen::MatrixXd q, dq, ddq, tau, qlink;
  Eigen::VectorXd encoder_step;  ///< of a resampled log: encoder_step() of the q that was recorded; empty: of q
  std::optional<Load> load;      ///< known from the project
  std::string time_note;         ///< the unit of its stamps, where it was told from their steps and is not s
  Eigen::Index samples() const { return t.size(); }
  Eigen::Index joints() const { return q.cols(); }
};

/// How to read a log; the defaults are the file format of the design (t, q1.., dq1.., ddq1.., tau1.., qlink1..).
struct LogFormat {
  /// Signal (t q dq ddq tau qlink temp) -> column prefix in the file; empty: what is optional is not read.
  std::map<std::string, std::string> columns{};
  std::vector<double> torque_gain{};      ///< measured column -> N*m; empty: 1
  std::vector<double> position_gain{};    ///< measured position -> rad | m, velocities too; empty: 1
  std::vector<double> position_offset{};  ///< added to the position after its gain [rad | m]; empty: 0
  /// Signal -> one column a joint, in the order of the chain; in place of a prefix. "#3": the fourth column of the
  /// file.
  std::map<std::string, std::vector<std::string>> joint_columns{};
  double time_unit_s = 0;  ///< of the time column [s]; 0: told from its steps
  bool operator==(const LogFormat&) const = default;
};

/// [signals] of a project file; what is not given is chosen from the logs.
struct SignalSettings {
  std::optional<double> position_cutoff_hz, torque_cutoff_hz;
  std::optional<double> torque_lead_s;  ///< see FilterFit
  std::optional<double> edge_s;         ///< dropped at both ends after filtering
};

/// Writes t, q, dq?, ddq?, tau? with 17 significant digits (to a temporary file, then renamed).
void write_log(const std::filesystem::path& file, const Log& log);

/// Smallest step of an encoder [rad | m]: what all differences between neighbouring samples are multiples of; 0 if
/// there is none.
double encoder_step(const Eigen::Ref<const Eigen::VectorXd>& q);

/// Columns sampled at t, linearly interpolated at other instants (ascending).
Eigen::MatrixXd interpolate(const Eigen::MatrixXd& columns, const Eigen::VectorXd& t, const Eigen::VectorXd& at);

}  // namespace fxdyn

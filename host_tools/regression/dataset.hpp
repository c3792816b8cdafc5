#pragma once

#include <Eigen/Dense>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/effects/filter_fit.hpp"
#include "host_tools/effects/model_value.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/signals/whole.hpp"

namespace fxdyn {

/// A log ready for fitting and judging. Held is what can't be made again: the filtered position and the raw torque;
/// velocity and acceleration are differentiated when they are asked for, rows of regressors made in blocks. So a log
/// takes little more memory than its own columns, and one more for each position of which the filter takes motion away.
struct ProcessedLog {
  std::string name;  ///< file name for messages
  Role role = Role::train;
  double from_s = 0, to_s = 0, step_s = 0;
  double ran_s = 0;        ///< of a part of a recording: how long that had run before [s]
  bool continues = false;  ///< a later part of the same recording as the log before: no trajectory of its own
  Eigen::VectorXd t;
  Eigen::MatrixXd q;                          ///< filtered at the position cut-off
  Eigen::MatrixXd measured_dq, measured_ddq;  ///< likewise; empty: differentiated from q
  Eigen::MatrixXd lost_velocity;              ///< of each joint, see lost_velocity(); empty: none at any joint
  Eigen::MatrixXd qlink;                      ///< likewise filtered; empty: no joint has a link encoder
  std::vector<bool> has_link;                 ///< per joint; columns of qlink without an encoder hold q
  Eigen::MatrixXd tau;                        ///< raw; empty without torque
  std::optional<Load> load;                   ///< what the gripper carried
  Eigen::VectorXd q_range, q_noise;           ///< per joint: range of q, RMS of what its filter took out
  Eigen::VectorXd torque_noise;               ///< per joint: noise that stays in the filtered torque, see noise_floor()
  /// Per joint, [from, to) of samples that `identify` must not use: the drive was at its limit.
  std::vector<std::vector<std::array<Eigen::Index, 2>>> saturated;
  /// Per joint: the fit uses none of its rows, as it stands still in every log; empty: it uses all joints.
  std::vector<bool> left_out;
  Eigen::Index first = 0, last = 0;  ///< [first, last) is free of filter transients
  Eigen::Index kept_each = 1;        ///< how many of the recorded samples go into one
  Eigen::Index decimation = 1;       ///< rows for fitting: first, first + decimation, ...
  FilterFit filter;

  Eigen::Index samples() const { return q.rows(); }
  Eigen::Index rows() const { return first < last ? (last - first - 1) / decimation + 1 : 0; }
  /// The motors' motion, samples [from, from + count).
  MotionRows motion(Eigen::Index from, Eigen::Index count) const;
  MotionRows motion() const { return motion(0, samples()); }
  /// The links' motion: measured where there is a link encoder, else the motor's.
  MotionRows link_motion(Eigen::Index from, Eigen::Index count) const;
  /// One joint's motion, all samples.
  MotionRows joint_motion(Eigen::Index joint) const;
  Eigen::VectorXd joint_velocity(Eigen::Index joint) const;
  bool is_left_out(Eigen::Index joint) const { return !left_out.empty() && left_out[static_cast<std::size_t>(joint)]; }
  /// Whether decimated row `row` of the joint is next to a saturated sample.
  bool is_saturated(Eigen::Index joint, Eigen::Index row) const;

  Eigen::MatrixXd filter_columns(const Eigen::Ref<const Eigen::MatrixXd>& full_rate) const;
  /// A filter takes this away of the velocity of one of so many joints, see lost_velocity(); empty: nothing.
  void lose(Eigen::Index joint, Eigen::Index joints, const Eigen::VectorXd& velocity);
  /// The rows that fits use, of a full-rate, filtered matrix.
  Eigen::MatrixXd decimate(const Eigen::Ref<const Eigen::MatrixXd>& filtered) const;
};

/// A piece of a log in which columns of all joints are made, filtered and decimated, so that memory does not grow with
/// the log's length. The pieces overlap by what the filter remembers to 1e-13.
struct RowBlock {
  Eigen::Index begin = 0, samples = 0;  ///< to make the columns for
  Eigen::Index row = 0, rows = 0;       ///< decimated rows that come out
  /// `full`: columns of the samples above -> rows x columns.
  Eigen::MatrixXd filter_and_keep(const ProcessedLog& log, const Eigen::MatrixXd& full) const;
};
std::vector<RowBlock> row_blocks(const ProcessedLog& log);

/// Cut-offs: the project's, else chosen from the logs.
///
/// Position: where the motion sinks into the noise. The error of ddq is the sum of the motion's power above the cut-off
/// and the noise's below it, weighted alike, so it is smallest where the two densities cross; the spectrum of q there
/// is twice the noise's (Welch; the noise's level is that of the highest octave). Twice that frequency, as the filter
/// is not a wall; at least 10 Hz, at most 0.4 of the sampling rate. Motion without noise (simulated, exact) is not
/// filtered.
///
/// Torque and every column: five times the frequency that holds 99.9 % of the velocities' energy (friction reverses
/// faster than the motion), at least 10 Hz, at most 0.4 of the sampling rate. Over all logs and, as shares of each
/// joint's own, over all joints: chosen for the fastest log of the fastest joint, the band of a controlled robot that
/// sticks and comes loose in a slow one is three times as wide. Up there its motion is little more than the encoder's
/// noise, to which the controller answers: regressors and torque share an error, and that looks like structure.
FilterFit choose_filter(const std::vector<Log>& logs, const SignalSettings& settings);

/// What fits need to know beside the filter.
struct ProcessSettings {
  std::vector<double> torque_limits;  ///< the project's, may be empty: torque that stays there is saturated
  double shortest_interval_s = 0;     ///< between the rows for fitting
};

/// @throws DataError where the log is shorter than the edges that the filter needs.
ProcessedLog process(Log log, const FilterFit& filter, const ProcessSettings& settings = {});

/// The model with the log's known load on the flange.
ModelValue with_load_of(const ProcessedLog& log, ModelValue model);

/// How long the robot has run when the log begins: since the start of the model's session, where the log's time stamps
/// say that it belongs to it (up to three of the drift's time constants after its end) and the model drifts; of a model
/// without a session, since the recording began that the log is part of; else 0 [s].
double age_of(const IdentifiedModel& model, const ProcessedLog& log);

/// Whether each joint moves in the train logs by more than its encoder's noise.
std::vector<bool> moving_joints(const std::vector<ProcessedLog>& logs);

/// Effects that bend under their load follow the fourth derivative of the position: above the frequency at which the
/// motion sinks into the noise there is nothing in it but noise. The cut-off [Hz] of the motion that bends them; 0: the
/// log's own.
double bending_hz(const ProcessedLog& log);
/// Whether an effect is such a one.
bool bends(std::string_view effect);
/// The model without them; nothing: it has none.
std::optional<ModelValue> stiffened(const IdentifiedModel& model);

/// Torques of the model over a log, block by block, with the log's known load, as warm as the robot was
/// (age_of()), and at the times at which the log's torque column shows them (torque_lead_s of the model's filter):
/// samples x joints [N*m | N]. What gears bend by follows the motion below bending_hz(), the rest all of it.
Eigen::MatrixXd predict(const IdentifiedModel& model, const ProcessedLog& log);
/// The same times a factor, added: a long log's torques are held once.
/// @param to samples x joints, or as many of these as are asked for @param first of them
void add_prediction(double factor, const IdentifiedModel& model, const ProcessedLog& log, Eigen::MatrixXd& to,
                    Eigen::Index first = 0);
/// The column of one joint: a long log's torques are not held at all.
Eigen::VectorXd predict_joint(const IdentifiedModel& model, const ProcessedLog& log, std::size_t joint);

/// Rigid-body torque of the model over each log as the effects of a tick see it: after deflections, with the log's
/// known load, at the motion's own times.
std::vector<Eigen::MatrixXd> structural_torque(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs);

}  // namespace fxdyn

#include "host_tools/check/column_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace fxdyn {

using Eigen::Index;

namespace {

/// A factor or its inverse, two digits: 1.3, 57, 1000.
std::string times(double value) {
  const double factor = value < 1 ? 1 / value : value;
  const double digit = std::pow(10, std::floor(std::log10(factor)) - 1);
  return fmt::format("{:g}", std::round(factor / digit) * digit);
}

class MoveWords {
 public:
  /// @param signals that the logs have
  MoveWords(const Project& project, std::vector<std::string> signals)
      : project_(project), signals_(std::move(signals)) {
    for (const LogEntry& entry : project.logs) {
      if (entry.role != Role::train) continue;
      format_ = &entry.format;
      table_ = entry.own_format ? "[[log]]" : "[signals]";
    }
  }

  std::string what(const ArrangementMove& move) const {
    const Index j = move.joint;
    switch (move.mistake) {
      case Mistake::swapped_joints:
        return fmt::format("the columns of {} and {} look swapped", joint(j), joint(move.other));
      case Mistake::swapped_motion:
        return fmt::format("q of {} and {} look swapped, their torques not", joint(j), joint(move.other));
      case Mistake::swapped_torques:
        return fmt::format("torques of {} and {} look swapped", joint(j), joint(move.other));
      case Mistake::mirrored_motion:
        return fmt::format("q of {} runs against the URDF's axis, its torque does not", joint(j));
      case Mistake::mirrored_torque:
        return fmt::format("torque of {} has the wrong sign", joint(j));
      case Mistake::mirrored_joint:
        return fmt::format("{} looks mirrored: q and torque run against the URDF's axis", joint(j));
      case Mistake::zero:
        return fmt::format("the zero of {} is off: its q lacks about {:+.0f} degrees", joint(j),
                           180 / std::numbers::pi * std::remainder(move.value, 2 * std::numbers::pi));
      case Mistake::axis:
        return fmt::format("{} turns about another axis than the URDF's: {} in its frame", joint(j),
                           vector(move.direction, 0));
      case Mistake::gravity:
        return fmt::format("gravity points along {} in the base frame, not along {}", vector(move.direction, 1),
                           vector(project_.robot.gravity, 1));
      case Mistake::torque_gain:
        return fmt::format("torque of {} is about {} times too {} beside the others' and the URDF's masses", joint(j),
                           times(move.value), move.value < 1 ? "large" : "small");
      case Mistake::torque_unit:
        return fmt::format(
            "all torques are about {} times too {} for the URDF's masses: currents, another unit, or "
            "masses that are placeholders?",
            times(move.value), move.value < 1 ? "large" : "small");
      case Mistake::position_unit:
        return unit(move);
      case Mistake::spring:
        return fmt::format("{} has a spring or a gravity compensator", joint(j));
    }
    return "";
  }

  /// What to write, and on the lines after it the keys themselves. `now`: all changes that were found together, so that
  /// each key is right whatever else is written.
  std::string fix(const ArrangementMove& move, const Arrangement& now) const {
    switch (move.mistake) {
      case Mistake::swapped_joints:
        return in_signals(columns(now, true, true));
      case Mistake::swapped_motion:
        return in_signals(columns(now, true, false));
      case Mistake::swapped_torques:
        return in_signals(columns(now, false, true));
      case Mistake::mirrored_motion:
      case Mistake::position_unit:
        return in_signals(position_gain(now));
      case Mistake::mirrored_torque:
      case Mistake::torque_gain:
      case Mistake::torque_unit:
        return in_signals(torque_gain(now));
      case Mistake::mirrored_joint:
        return in_signals(position_gain(now) + "\n" + torque_gain(now)) + mirrored_in_urdf(move.joint, now);
      case Mistake::zero:
        return in_signals(fmt::format("position_offset = [{}]", offsets(now)));
      case Mistake::axis:
        return in_urdf(move.joint, move.direction);
      case Mistake::gravity:
        return "in [robot]:\ngravity = " + vector(move.direction, 2);
      case Mistake::spring:
        break;  // diagnosis names it
    }
    return "";
  }

  std::string joint(Index j) const {
    return fmt::format("joint {} ({})", j + 1, project_.robot.joints[static_cast<std::size_t>(j)].name);
  }
  const char* torque_unit(Index j) const { return project_.robot.joints[static_cast<std::size_t>(j)].torque_unit(); }

 private:
  static std::string vector(const Eigen::Vector3d& v, int digits) {
    // No "-0".
    const double unit = std::pow(10, -digits);
    const auto rounded = [&](double x) { return std::round(x / unit) * unit + 0.0; };
    return fmt::format("[{:.{}f}, {:.{}f}, {:.{}f}]", rounded(v.x()), digits, rounded(v.y()), digits, rounded(v.z()),
                       digits);
  }

  std::string unit(const ArrangementMove& move) const {
    const bool turns = project_.robot.joints[static_cast<std::size_t>(move.joint)].type == JointType::revolute;
    return fmt::format("q of {} is not in {}: it looks {} times too {}", joint(move.joint), turns ? "rad" : "m",
                       times(move.value), move.value < 1 ? "large" : "small");
  }

  std::string in_signals(const std::string& lines) const { return "in " + table_ + ":\n" + lines; }

  static std::string axis_element(const Eigen::Vector3d& axis) {
    const Eigen::Vector3d a = axis.array() + 0.0;  // no "-0"
    return fmt::format("<axis xyz=\"{:g} {:g} {:g}\"/>", a.x(), a.y(), a.z());
  }
  std::string in_urdf(Index j, const Eigen::Vector3d& axis) const {
    const Joint& joint = project_.robot.joints[static_cast<std::size_t>(j)];
    return fmt::format("in the URDF, joint '{}', in place of {}:\n{}", joint.name, axis_element(joint.axis),
                       axis_element(axis));
  }
  /// The other way to put a mirrored joint right. What one log alone has wrong is not the URDF's. The keys above turn
  /// all mirrored joints, so that of several the URDF's line alone would turn one of them twice.
  std::string mirrored_in_urdf(Index j, const Arrangement& now) const {
    const bool several = (now.motion_gain.array() < 0).count() > 1;
    if (format_ == nullptr || table_ != "[signals]" || several) return "";
    return "\nor " + in_urdf(j, -now.axis[static_cast<std::size_t>(j)]);
  }

  static std::string quoted(const std::string& name) {
    return name.starts_with('#') ? name.substr(1) : '"' + name + '"';
  }

  /// All columns that are named, those of motion or torque in the order that was found.
  std::string columns(const Arrangement& now, bool motion, bool torque) const {
    std::vector<std::string> keys;
    for (const std::string& signal : signals_) {
      const bool of_torque = signal == "tau";
      const std::vector<Index>& from = of_torque ? now.torque_from : now.motion_from;
      if (signal != "t" && (of_torque ? torque : motion)) {
        keys.push_back(fmt::format("{} = {}", signal, list(signal, from)));
      } else if (format_ != nullptr && format_->joint_columns.contains(signal)) {
        std::vector<Index> in_order(from.size());
        std::iota(in_order.begin(), in_order.end(), 0);
        keys.push_back(fmt::format("{} = {}", signal, list(signal, in_order)));
      } else if (format_ != nullptr && format_->columns.contains(signal)) {
        keys.push_back(fmt::format("{} = {}", signal, quoted(format_->columns.at(signal))));
      }
    }
    // What the project leaves out stays out.
    for (const char* signal : {"dq", "ddq", "qlink"}) {
      if (format_ == nullptr) break;
      const auto given = format_->columns.find(signal);
      if (given != format_->columns.end() && given->second.empty()) keys.push_back(fmt::format("{} = false", signal));
    }
    return fmt::format("columns = {{ {} }}", fmt::join(keys, ", "));
  }

  /// The columns of a signal in another order.
  std::string list(const std::string& signal, const std::vector<Index>& from) const {
    std::vector<std::string> names;
    for (const Index j : from) {
      const auto at = static_cast<std::size_t>(j);
      std::string name = fmt::format("{}{}", signal, j + 1);
      if (format_ != nullptr) {
        if (const auto given = format_->joint_columns.find(signal); given != format_->joint_columns.end()) {
          name = given->second[at];
        } else if (const auto prefix = format_->columns.find(signal); prefix != format_->columns.end()) {
          name = fmt::format("{}{}", prefix->second, j + 1);
        }
      }
      names.push_back(quoted(name));
    }
    return fmt::format("[{}]", fmt::join(names, ", "));
  }

  /// What the project has, as it stands there, times what was found: signs and units as they are, else three digits.
  static std::string product(const std::vector<double>* given, const Eigen::VectorXd& found) {
    std::vector<std::string> out;
    for (Index j = 0; j < found.size(); ++j) {
      const double before = given == nullptr || given->empty() ? 1 : (*given)[static_cast<std::size_t>(j)];
      const double digit = std::pow(10, std::floor(std::log10(std::fabs(found[j]))) - 2);
      const double rounded = std::round(found[j] / digit) * digit;
      const bool unit = std::fabs(found[j] * 180 / std::numbers::pi) == 1;
      out.push_back(fmt::format("{:.10g}", before * (unit ? found[j] : rounded)));
    }
    return fmt::format("[{}]", fmt::join(out, ", "));
  }
  std::string position_gain(const Arrangement& now) const {
    return "position_gain = " + product(format_ ? &format_->position_gain : nullptr, now.motion_gain);
  }
  std::string torque_gain(const Arrangement& now) const {
    return "torque_gain = " + product(format_ ? &format_->torque_gain : nullptr, now.torque_gain);
  }
  std::string offsets(const Arrangement& now) const {
    std::vector<std::string> out;
    for (Index j = 0; j < now.motion_offset.size(); ++j) {
      const bool given = format_ != nullptr && !format_->position_offset.empty();
      const double before = given ? format_->position_offset[static_cast<std::size_t>(j)] : 0;
      const double sum = std::remainder(before + now.motion_offset[j], 2 * std::numbers::pi);
      out.push_back(fmt::format("{:g}", std::round(1e4 * sum) / 1e4 + 0.0));  // no "-0"
    }
    return fmt::format("{}", fmt::join(out, ", "));
  }

  const Project& project_;
  std::vector<std::string> signals_;
  const LogFormat* format_ = nullptr;
  std::string table_ = "[signals]";
};

bool is_as_good(const ArrangementMove& other, const ArrangementFinding& finding, const ArrangementOptions& options) {
  return other.nats > finding.move.nats - options.as_good;
}

/// A gain of other units; a smaller one may be masses that the URDF has wrong. A spring that explains the torque as
/// well is no mistake.
bool is_sure(const ArrangementFinding& finding, const ArrangementOptions& options) {
  const ArrangementMove& move = finding.move;
  if (std::any_of(finding.others.begin(), finding.others.end(), [&](const ArrangementMove& other) {
        return other.mistake == Mistake::spring && is_as_good(other, finding, options);
      }))
    return false;
  if (move.mistake == Mistake::torque_unit) return false;
  return move.mistake != Mistake::torque_gain || move.value > 3 || move.value < 1.0 / 3;
}

/// Gravity and a unit of all torques are of no joint.
std::optional<std::size_t> joint_of(const ArrangementMove& move) {
  if (move.mistake == Mistake::gravity || move.mistake == Mistake::torque_unit) return {};
  return static_cast<std::size_t>(move.joint);
}

/// Names the best of the other explanations, and counts the rest.
void add_others(const ArrangementFinding& finding, const MoveWords& words, const ArrangementOptions& options,
                CheckFinding& out) {
  int unnamed = 0;
  for (const ArrangementMove& other : finding.others) {
    out.others.push_back({to_string(other.mistake), joint_of(other)});
    if (static_cast<int>(out.others.size()) > options.alternatives && !is_as_good(other, finding, options)) {
      ++unnamed;
      continue;
    }
    out.text += fmt::format("; or {}", words.what(other));
    if (const std::string fix = words.fix(other, other.result); !fix.empty()) out.fix += "\nor " + fix;
  }
  if (unnamed > 0) out.text += fmt::format("; or one of {} less likely changes, see `fxdyn check --json`", unnamed);
}

}  // namespace

CheckFinding in_words(const ArrangementFinding& finding, const Arrangement& all, const Project& project,
                      const std::vector<std::string>& signals, const ArrangementOptions& options) {
  const MoveWords words(project, signals);
  CheckFinding out;
  out.error = is_sure(finding, options) && finding.after < options.sure * finding.before;
  out.kind = to_string(finding.move.mistake);
  out.joint = joint_of(finding.move);
  const double odds = finding.move.nats / std::numbers::ln10;
  out.text = words.what(finding.move);
  // Errors before and after may be in different units. A fit that is hardly better may still need far less likely
  // bodies.
  if (finding.move.mistake == Mistake::torque_unit || finding.after > options.hardly * finding.before) {
    out.text += fmt::format(" (odds 10^{:.0f})", odds);
  } else {
    out.text +=
        fmt::format(": with that the torque error of {} falls from {:.3g} to {:.3g} {} (odds 10^{:.0f})",
                    words.joint(finding.felt), finding.before, finding.after, words.torque_unit(finding.felt), odds);
  }
  out.fix = words.fix(finding.move, all);
  add_others(finding, words, options, out);
  return out;
}

CheckFinding in_words(const TorqueLead& lead) {
  return {
      false,
      "torque_lead",
      {},
      "",
      fmt::format("torque is recorded {:.0f} ms {} the motion: {:.0f} % of it is not explained, {:.0f} % with it moved",
                  1000 * std::fabs(lead.seconds), lead.seconds > 0 ? "ahead of" : "behind", 100 * lead.before,
                  100 * lead.after),
      fmt::format("in [signals]:\ntorque_lead_s = {:.3g}", lead.seconds)};
}

}  // namespace fxdyn

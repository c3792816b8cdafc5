#include "host_tools/logs/log.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>

#include "host_tools/logs/recorded_log.hpp"
#include "host_tools/logs/time_grid.hpp"
#include "host_tools/logs/units.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

using Eigen::Index;

namespace {

void append(std::string& out, double value) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 17).ptr;
  out.append(text.data(), end);
}

}  // namespace

std::string to_string(Role role) {
  switch (role) {
    case Role::baseline:
      return "baseline";
    case Role::train:
      return "train";
    case Role::validate:
      return "validate";
    case Role::test:
      return "test";
  }
  return "";
}

Role role_of(std::string_view name) {
  for (const Role role : {Role::baseline, Role::train, Role::validate, Role::test}) {
    if (to_string(role) == name) return role;
  }
  throw InputError(fmt::format("'{}' is no role of a log; use baseline, train, validate or test", name));
}

namespace {

/// The project's gains and offsets, so that the columns are what Log says.
void to_si_units(Log& log, const LogFormat& format) {
  const auto scale = [](Eigen::MatrixXd& columns, const std::vector<double>& gains) {
    if (columns.size() == 0) return;
    for (std::size_t joint = 0; joint < gains.size(); ++joint) columns.col(static_cast<Index>(joint)) *= gains[joint];
  };
  scale(log.tau, format.torque_gain);
  for (Eigen::MatrixXd* columns : {&log.q, &log.dq, &log.ddq, &log.qlink}) scale(*columns, format.position_gain);
  for (std::size_t joint = 0; joint < format.position_offset.size(); ++joint) {
    for (Eigen::MatrixXd* columns : {&log.q, &log.qlink})
      if (columns->size() > 0) columns->col(static_cast<Index>(joint)).array() += format.position_offset[joint];
  }
}

}  // namespace

Log uniform_log(const ReadRecording& read, const std::filesystem::path& file, std::size_t joints,
                const std::vector<bool>& revolute, const LogFormat& format, std::optional<double> from_s,
                std::optional<double> to_s, bool torque_required) {
  const std::string where = file.string();
  for (const auto& [key, values] :
       {std::pair("torque_gain", &format.torque_gain), std::pair("position_gain", &format.position_gain),
        std::pair("position_offset", &format.position_offset)}) {
    if (!values->empty() && values->size() != joints)
      throw InputError(fmt::format("{}: {} has {} values for {} joints", where, key, values->size(), joints));
  }
  LogRequest request{.file = file, .joints = joints, .columns = format, .torque_required = torque_required};
  if (from_s) request.from = *from_s;
  if (to_s) request.to = *to_s;
  RecordedLog recorded = read(request);
  Log log = std::move(recorded.log);
  if (log.samples() < 2) {
    throw InputError(fmt::format("{}: the window [{:.9g}, {:.9g}) s holds {} rows; the file has {:.9g} to {:.9g} s",
                                 where, request.from, request.to, log.samples(), recorded.first_t, recorded.last_t));
  }
  to_si_units(log, format);
  log.file = file;
  log.step_s = check_stamps(log, where);
  log.from_s = from_s.value_or(log.t[0]);
  log.to_s = to_s.value_or(log.t[log.t.size() - 1] + log.step_s);
  for (Index joint = 0; joint < log.joints(); ++joint) {
    if (!revolute[static_cast<std::size_t>(joint)]) continue;
    unwrap(log.q.col(joint));
    if (log.qlink.size() > 0) unwrap(log.qlink.col(joint));
  }
  check_units(log, revolute, where, recorded.time_is_known);
  if (log.resampled) {
    log.stamps = log.t;
    log.encoder_step.resize(log.joints());  // between samples there are no steps
    for (Index joint = 0; joint < log.joints(); ++joint) log.encoder_step[joint] = encoder_step(log.q.col(joint));
    resample(log, log.step_s);
  }
  return log;
}

void write_log(const std::filesystem::path& file, const Log& log) {
  std::string out = "t";
  std::vector<std::pair<const Eigen::MatrixXd*, Index>> columns;
  const auto signals = signals_of(log);
  for (std::size_t s = 0; s < signal_count; ++s) {
    for (Index joint = 0; joint < signals[s]->cols(); ++joint) {
      if (signals[s]->rows() > 0 && std::isnan((*signals[s])(0, joint))) continue;  // no second encoder
      out += fmt::format(",{}{}", signal_names[s], joint + 1);
      columns.emplace_back(signals[s], joint);
    }
  }
  out += '\n';

  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  std::filesystem::path temporary = file;
  temporary += ".tmp";
  std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
  for (Index i = 0; i < log.samples(); ++i) {
    append(out, log.t[i]);
    for (const auto& [signal, joint] : columns) {
      out += ',';
      append(out, (*signal)(i, joint));
    }
    out += '\n';
    if (out.size() > (1U << 20)) {
      stream.write(out.data(), static_cast<std::streamsize>(out.size()));
      out.clear();
    }
  }
  stream.write(out.data(), static_cast<std::streamsize>(out.size()));
  stream.close();
  if (!stream) throw InputError(file.string() + ": can't be written; check that the directory exists and has room");
  std::filesystem::rename(temporary, file);
}

}  // namespace fxdyn

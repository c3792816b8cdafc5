#include "host_tools/regression/fit_data.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto per_link = static_cast<Index>(parameters_per_link);

void check_motion(const Robot& robot, const std::vector<ProcessedLog>& logs) {
  const std::vector<bool> moving = moving_joints(logs);
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const auto k = static_cast<Index>(j);
    if (moving[j] || logs.front().is_left_out(k)) continue;
    double range = 0;
    for (const ProcessedLog& log : logs) range = std::max(range, log.role == Role::train ? log.q_range[k] : 0.0);
    throw DataError(
        fmt::format("joint {} ({}) never moves in the train logs (range {:.1e} {}): record a log in which it does",
                    j + 1, robot.joints[j].name, range, robot.joints[j].position_unit()));
  }
}

void check_length(const std::vector<LogRows>& logs, Index joints, Index parameters) {
  Index train_rows = 0;
  for (const LogRows& log : logs) train_rows += log.role == Role::train ? log.rows : 0;
  if (train_rows * joints >= 2 * parameters) return;
  throw DataError(
      fmt::format("{} rows (after filtering) for {} parameters: record a longer log", train_rows * joints, parameters));
}

/// Base columns and load torque of one block of samples, of all joints side by side: joint j has columns starts[j] ..
/// starts[j + 1] - 1, the load's the last of them.
MatrixXd block_columns(const FitData& data, const ProcessedLog& log, const RowBlock& block,
                       const std::vector<Index>& starts) {
  const auto& columns = data.base.columns;
  const auto nb = static_cast<Index>(columns.size()), n = static_cast<Index>(data.robot.size());
  Regressor regressor(data.chain);
  const MotionRows motion = log.link_motion(block.begin, block.samples);
  MatrixXd full(block.samples, starts.back());
  VectorXd load = VectorXd::Zero(per_link);
  if (log.load) {
    const auto values = to_array(with_load({}, log.load->mass, log.load->com, data.chain));
    load = Eigen::Map<const VectorXd>(values.data(), per_link);
  }
  for (Index k = 0; k < block.samples; ++k) {
    const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
    for (Index j = 0; j < n; ++j) {
      Index column = starts[static_cast<std::size_t>(j)];
      for (Index c = data.first_base[static_cast<std::size_t>(j)]; c < nb; ++c)
        full(k, column++) = y(j, columns[static_cast<std::size_t>(c)]);
      full(k, column) = y.row(j).tail(per_link).dot(load);
    }
  }
  return full;
}

void fill_rows(FitData& data, Index rows) {
  const auto nb = static_cast<Index>(data.base.columns.size());
  const std::size_t n = data.robot.size();
  std::vector<Index> starts{0};
  for (std::size_t j = 0; j < n; ++j) {
    starts.push_back(starts.back() + nb - data.first_base[j] + 1);
    data.base_rows.emplace_back(rows, nb - data.first_base[j]);
    data.load_rows.emplace_back(rows);
  }
  struct Piece {
    const ProcessedLog* log;
    Index row;
    RowBlock block;
  };
  std::vector<Piece> pieces;
  for (std::size_t l = 0; l < data.logs->size(); ++l) {
    for (const RowBlock& block : row_blocks((*data.logs)[l]))
      pieces.push_back({&(*data.logs)[l], data.first_row[l] + block.row, block});
  }
  parallel_for(pieces.size(), [&](std::size_t p) {
    const auto& [log, row, block] = pieces[p];
    const MatrixXd kept = block.filter_and_keep(*log, block_columns(data, *log, block, starts));
    for (std::size_t j = 0; j < n; ++j) {
      const Index count = starts[j + 1] - starts[j] - 1;
      data.base_rows[j].middleRows(row, kept.rows()) = kept.middleCols(starts[j], count);
      data.load_rows[j].segment(row, kept.rows()) = kept.col(starts[j] + count);
    }
  });
}

void mark_usable(FitData& data, Index rows) {
  for (std::size_t j = 0; j < data.robot.size(); ++j) {
    const auto k = static_cast<Index>(j);
    VectorXd& usable = data.usable.emplace_back(VectorXd::Ones(rows));
    for (std::size_t l = 0; l < data.logs->size(); ++l) {
      const ProcessedLog& log = (*data.logs)[l];
      if (log.is_left_out(k)) usable.segment(data.first_row[l], log.rows()).setZero();
      if (log.saturated[j].empty()) continue;
      for (Index r = 0; r < log.rows(); ++r) {
        if (log.is_saturated(k, r)) usable[data.first_row[l] + r] = 0;
      }
    }
  }
}

}  // namespace

FitData make_fit_data(const Robot& robot, const std::vector<ProcessedLog>& logs, Index own_parameters) {
  FitData data;
  data.robot = robot;
  data.logs = &logs;
  data.chain = to_dh(robot);
  data.base = find_base(data.chain);
  const auto& columns = data.base.columns;
  const auto n = static_cast<Index>(robot.size());
  check_motion(robot, logs);
  for (Index j = 0; j < n; ++j) {  // links before a joint do not load it
    const auto first = std::lower_bound(columns.begin(), columns.end(), j * per_link);
    data.first_base.push_back(first - columns.begin());
  }
  std::vector<LogRows> log_rows;
  Index rows = 0;
  for (const ProcessedLog& log : logs) {
    data.first_row.push_back(rows);
    if (log.continues && !log_rows.empty()) {
      log_rows.back().rows += log.rows();
    } else {
      log_rows.push_back({log.role, log.rows()});
    }
    rows += log.rows();
  }
  check_length(log_rows, n, static_cast<Index>(columns.size()) + own_parameters);
  fill_rows(data, rows);
  mark_usable(data, rows);
  data.blocks = make_blocks(log_rows);
  data.split = make_split(log_rows);
  data.one_recording = log_rows.size() == 1;
  return data;
}

}  // namespace fxdyn

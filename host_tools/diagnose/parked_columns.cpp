#include "host_tools/diagnose/parked_columns.hpp"

#include "host_tools/support/error.hpp"
#include "host_tools/support/heap.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;

ParkedColumns::ParkedColumns(std::vector<ProcessedLog>& logs, double samples) {
  double all = 0;
  bool linked = false;
  for (const ProcessedLog& log : logs) {
    all += static_cast<double>(log.samples());
    linked |= log.qlink.size() > 0;
  }
  if (linked || all < samples) return;
  open();
  if (!file_) return;
  for (ProcessedLog& log : logs) {
    for (MatrixXd* columns : {&log.q, &log.tau, &log.lost_velocity}) {
      if (!park(*columns)) return;  // the rest stays
    }
  }
  give_back_memory();
}

ParkedColumns::ParkedColumns(std::vector<MatrixXd>& matrices, double bytes) {
  double all = 0;
  for (const MatrixXd& columns : matrices)
    all += static_cast<double>(sizeof(double)) * static_cast<double>(columns.size());
  if (all < bytes) return;
  open();
  if (!file_) return;
  for (MatrixXd& columns : matrices) {
    if (!park(columns)) return;
  }
  give_back_memory();
}

void ParkedColumns::open() {
  file_.reset(std::tmpfile());
  // Written at once: what a full disk had no room for must not be tried again where the rest is read.
  if (file_) std::setvbuf(file_.get(), nullptr, _IONBF, 0);
}

bool ParkedColumns::park(MatrixXd& columns) {
  const auto size = static_cast<std::size_t>(columns.size());
  if (size == 0) return true;
  if (std::fwrite(columns.data(), sizeof(double), size, file_.get()) != size || std::fflush(file_.get()) != 0)
    return false;
  parked_.push_back({&columns, columns.cols()});
  columns.resize(columns.rows(), 0);
  return true;
}

void ParkedColumns::take_back() {
  if (!parked_.empty()) give_back_memory();  // holes of what was looked at meanwhile are too small for these columns
  if (file_ && std::fseek(file_.get(), 0, SEEK_SET) != 0)
    throw DataError("what a temporary file held meanwhile can't be read again");
  for (const auto& [columns, count] : parked_) {
    columns->resize(columns->rows(), count);
    const auto size = static_cast<std::size_t>(columns->size());
    if (std::fread(columns->data(), sizeof(double), size, file_.get()) != size)
      throw DataError("what a temporary file held meanwhile can't be read again");
  }
  parked_.clear();
}

}  // namespace fxdyn::diagnosis

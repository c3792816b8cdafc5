#include "host_tools/diagnose/parked_columns.hpp"

#include "host_tools/support/error.hpp"

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
  file_.reset(std::tmpfile());
  if (!file_) return;
  for (ProcessedLog& log : logs) {
    for (MatrixXd* columns : {&log.q, &log.tau, &log.lost_velocity}) {
      const auto count = static_cast<std::size_t>(columns->size());
      if (count == 0) continue;
      const bool written =
          std::fwrite(columns->data(), sizeof(double), count, file_.get()) == count && std::fflush(file_.get()) == 0;
      if (!written) return;  // the rest stays
      parked_.push_back({columns, columns->cols()});
      columns->resize(columns->rows(), 0);
    }
  }
}

void ParkedColumns::take_back() {
  if (file_) std::rewind(file_.get());
  for (const auto& [columns, joints] : parked_) {
    columns->resize(columns->rows(), joints);
    const auto count = static_cast<std::size_t>(columns->size());
    if (std::fread(columns->data(), sizeof(double), count, file_.get()) != count)
      throw DataError("the logs, which a temporary file held meanwhile, can't be read again");
  }
  parked_.clear();
}

}  // namespace fxdyn::diagnosis

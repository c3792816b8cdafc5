#pragma once

#include <cstdio>
#include <memory>
#include <vector>

#include "host_tools/identify/options.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Columns of logs that nothing looks at for a while: in a file without a name, not in memory. A search sees windows of
/// a long log, and takes as much memory as the log itself. Logs that fill little stay where they are; so do those that
/// the disk has no room for, and those with encoders of links, which a search looks at.
class ParkedColumns {
 public:
  /// @param samples of all logs together, from which on they are parked
  explicit ParkedColumns(std::vector<ProcessedLog>& logs, double samples = fxdyn::GateOptions().long_logs);
  /// What an outcome keeps while another one is searched, likewise.
  /// @param bytes of all matrices together, from which on they are parked
  explicit ParkedColumns(std::vector<Eigen::MatrixXd>& matrices, double bytes = 32e6);
  /// What was not taken back is lost with its logs.
  ~ParkedColumns() = default;
  ParkedColumns(const ParkedColumns&) = delete;
  ParkedColumns& operator=(const ParkedColumns&) = delete;

  /// @throws DataError: they can't be read again
  void take_back();

 private:
  void open();
  /// @returns whether there was room
  bool park(Eigen::MatrixXd& columns);

  struct Parked {
    Eigen::MatrixXd* columns;
    Eigen::Index count;
  };
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  std::vector<Parked> parked_;
};

}  // namespace fxdyn::diagnosis

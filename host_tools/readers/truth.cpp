#include "host_tools/readers/truth.hpp"

#include "host_tools/readers/log_reader.hpp"

namespace fxdyn {

Eigen::MatrixXd read_truth(const std::filesystem::path& file, std::size_t joints, std::optional<double> from_s,
                           std::optional<double> to_s) {
  // The file has no positions: the torques are taken for them.
  return read_log(file, joints, std::vector<bool>(joints, false), {{{"q", "tau"}}, {}}, from_s, to_s).tau;
}

}  // namespace fxdyn

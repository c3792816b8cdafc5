#include "host_tools/compare/efficiency.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/check/check.hpp"
#include "host_tools/compare/compare.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/simulate/recordings.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

const std::vector<double> seconds{5, 10, 20, 40, 60, 120};
const std::vector<double> mixed_seconds{10, 60};
const std::vector<double> slow_shares{0, 0.25, 0.5, 0.75, 1};
const std::vector<std::string> methods{"rigid_ls",    "friction_ls",   "rls",          "mlp",
                                       "bls_default", "bls_physical",  "lugre",        "lugre_physical",
                                       "named",       "named_trained", "known_shapes", "bound"};
const std::vector<std::string> mixed_methods{"friction_ls", "lugre", "lugre_physical"};

struct Source {
  LogEntry entry;
  double from_s = 0, length_s = 0, speed = 0;
};

/// Fast and slow logs part where two groups of log(speed) are tightest, least sum of squares about their means (Otsu
/// 1979): the speed of the slowest fast one. 0: the fast ones are not twice as fast as the slow ones.
double speed_between(const std::vector<Source>& sources) {
  std::vector<double> speeds;
  for (const Source& source : sources) speeds.push_back(std::log(source.speed));
  std::sort(speeds.begin(), speeds.end());
  const Eigen::Map<const Eigen::VectorXd> all(speeds.data(), static_cast<Eigen::Index>(speeds.size()));
  const auto spread = [](const auto& part) { return (part.array() - part.mean()).square().sum(); };
  double tightest = 1e300, between = 0;
  for (Eigen::Index slow = 1; slow < all.size(); ++slow) {
    const auto low = all.head(slow), high = all.tail(all.size() - slow);
    const double both = spread(low) + spread(high);
    if (both >= tightest) continue;
    tightest = both;
    between = high.mean() - low.mean() > std::log(2) ? std::exp(all[slow]) : 0;
  }
  return between * (1 - 1e-9);
}

class Efficiency {
 public:
  Efficiency(const fs::path& project, const fs::path& directory)
      : project_(read_project(project)), directory_(directory) {
    std::size_t next = 0;
    std::vector<Log> logs = read_logs(project_, Role::train, directory);
    for (const LogEntry& entry : project_.logs) {
      if (entry.role != Role::train) continue;
      const Log& log = logs[next++];
      const Eigen::Index rows = log.q.rows();
      const double step = (log.t[rows - 1] - log.t[0]) / static_cast<double>(rows - 1);
      const double speed =
          (log.q.bottomRows(rows - 1) - log.q.topRows(rows - 1)).norm() / step / std::sqrt(static_cast<double>(rows));
      sources_.push_back({entry, log.t[0], step * static_cast<double>(rows), speed});
    }
    const double between = speed_between(sources_);
    for (const Source& source : sources_) (source.speed < between ? slow_ : fast_).push_back(source);
    if (slow_.empty()) {
      throw DataError(fmt::format("{}: efficiency needs fast and slow train logs (less than half as fast)",
                                  project_.file.string()));
    }
  }

  /// @throws DataError: the logs can't be what the project says
  void check_logs() const {
    const std::vector<LogFacts> of_train = facts_of_train_logs(project_, directory_);
    GateData data = read_gate_data(project_, directory_);
    for (const std::string& note : check_before_fit(project_, directory_, data, of_train))
      fmt::print(stderr, "note: {}\n", note);
  }

  EfficiencyResult run() {
    EfficiencyResult out{.project_hash = project_hash(project_), .made_from = made_from(project_, directory_, false)};
    for (const double s : seconds) add(out.curve, s, 0.5, methods);
    for (const double s : mixed_seconds) {
      for (const double share : slow_shares) add(out.mix, s, share, mixed_methods);
    }
    return out;
  }

 private:
  /// Nothing where the logs are shorter.
  void add(std::vector<EfficiencyPoint>& to, double s, double slow_share, const std::vector<std::string>& names) {
    Project part = project_;
    std::erase_if(part.logs, [](const LogEntry& entry) { return entry.role == Role::train; });
    if (!take(part, fast_, s * (1 - slow_share)) || !take(part, slow_, s * slow_share)) return;
    EfficiencyPoint point{.seconds = s, .slow_share = slow_share};
    for (const std::string& name : names) {
      try {
        point.percent_rated[name] = compare_methods(part, directory_, {name}).methods.front().mean_percent_rated;
      } catch (const DataError& error) {
        point.percent_rated[name] = std::nullopt;
        point.failed = error.what();
      }
    }
    to.push_back(std::move(point));
  }

  static bool take(Project& part, const std::vector<Source>& from, double s) {
    for (const Source& source : from) {
      if (s <= 1e-9) return true;
      LogEntry entry = source.entry;
      entry.from_s = source.from_s;
      entry.to_s = source.from_s + std::min(s, source.length_s);
      part.logs.push_back(entry);
      s -= source.length_s;
    }
    return s <= 1e-9;
  }

  Project project_;
  fs::path directory_;
  std::vector<Source> sources_, fast_, slow_;
};

}  // namespace

EfficiencyResult efficiency(const fs::path& project, const fs::path& directory) {
  Efficiency study(project, directory);
  study.check_logs();
  EfficiencyResult result = study.run();
  write_file(directory / "efficiency.json", to_json(result).dump(1) + "\n");
  return result;
}

std::string efficiency_table(const EfficiencyResult& result) {
  const auto cell = [](const EfficiencyPoint& point, const std::string& name) {
    const auto found = point.percent_rated.find(name);
    if (found == point.percent_rated.end() || !found->second) return fmt::format("{:>15}", "-");
    return fmt::format("{:>15.3g}", *found->second);
  };
  std::string out = "test error, % of rated, mean of the joints\n   seconds  slow";
  for (const std::string& name : methods) out += fmt::format("{:>15}", name);
  for (const auto* part : {&result.curve, &result.mix}) {
    out += "\n";
    for (const EfficiencyPoint& point : *part) {
      out += fmt::format("{:>10g} {:>4.0f} %", point.seconds, 100 * point.slow_share);
      for (const std::string& name : methods) out += cell(point, name);
      if (!point.failed.empty()) out += "  -: " + point.failed;
      out += "\n";
    }
  }
  return out;
}

}  // namespace fxdyn

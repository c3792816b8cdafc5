#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/log_reference.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

struct PhysicalFit;
struct Formats;
struct GateData;

/// The stages of `fxdyn run`, each continuing from DIR/model.json where project and logs are still those it was made
/// from, and running the missing stages first otherwise.
class Pipeline {
 public:
  Pipeline(const std::filesystem::path& project, std::filesystem::path directory);
  ~Pipeline();

  void identify();
  /// Always from base parameters and nominal effects; needs nothing of the stages before.
  void diagnose();
  /// From the diagnosed model.
  void train();
  void export_tables();
  void report();
  /// The bytes of all stages one after another. What identify writes, diagnose writes anew without reading it: that
  /// stage is left out.
  void run();

  const Project& project() const { return project_; }
  const std::filesystem::path& directory() const { return directory_; }
  /// DIR/model.json, made by the stages up to training if it is missing or out of date.
  IdentifiedModel model();
  /// DIR/model.json, if training made it from project and logs as they are now; makes nothing.
  std::optional<IdentifiedModel> trained();
  /// DIR/model.json with the tables that a drive may run on; makes nothing.
  /// @throws InputError: the verb that has to come first
  IdentifiedModel exported();
  /// Logs of one role with the model's filter.
  std::vector<ProcessedLog> logs(Role role);
  /// Tables of the model in these formats and export.json; the model says what is in them.
  void write_export(IdentifiedModel& model, const Formats& formats, const std::filesystem::path& directory);
  /// Errors of the model on all logs, under a stage's name.
  StageErrors stage_errors(const IdentifiedModel& model, const std::string& stage);

 private:
  /// Read on first use, and checked before anything is fitted; see check_before_fit().
  /// @throws DataError: the logs can't be what the project says
  GateData& data();
  /// References of train, validate and baseline logs: what a diagnosed model depends on.
  const std::vector<LogReference>& diagnosed_logs();
  bool is_current(const IdentifiedModel& model);
  /// DIR/model.json, if it is current and one of these stages made it.
  std::optional<IdentifiedModel> written(std::initializer_list<std::string_view> stages);
  void check_motion();
  /// Index (from 1) and name of a joint about which diagnosis could say nothing.
  std::optional<std::pair<int, std::string>> not_excited() const;
  /// @throws DataError: there is one
  void check_excited() const;
  /// The same as a function, for training.
  std::function<StageErrors(const IdentifiedModel& model, const std::string& stage)> stage_errors();
  /// The stages before training that DIR/metrics.json holds.
  std::vector<StageErrors> diagnosed_stages() const;
  /// DIR/identified.urdf, where there are bodies.
  void write_possible_bodies(const std::optional<PhysicalFit>& bodies) const;

  Project project_;
  std::filesystem::path directory_;
  std::unique_ptr<GateData> data_;
  std::vector<std::string> data_notes_;  ///< of reading the logs alone
  std::optional<std::vector<LogReference>> diagnosed_logs_;
  Progress progress_;
};

}  // namespace fxdyn

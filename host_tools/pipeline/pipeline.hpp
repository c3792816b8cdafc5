#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "host_tools/identify/identify.hpp"

namespace fxdyn {

/// The stages of `fxdyn run`, each continuing from DIR/model.json where project and logs are still those it was made
/// from, and running the missing stages first otherwise.
class Pipeline {
 public:
  Pipeline(const std::filesystem::path& project, std::filesystem::path directory);

  void identify();
  /// Always from base parameters and nominal effects; needs nothing of the stages before.
  void diagnose();
  void train();
  void export_tables();
  void report();
  void run();

  const Project& project() const { return project_; }
  const std::filesystem::path& directory() const { return directory_; }
  /// DIR/model.json, made by the stages up to training if it is missing or out of date.
  IdentifiedModel model();
  /// Logs of one role with the model's filter.
  std::vector<ProcessedLog> logs(Role role);

 private:
  enum class Stage { identified, trained };
  GateData& data();
  bool is_current(const IdentifiedModel& model);
  std::unique_ptr<Fitter> fitter_from(const IdentifiedModel& model);
  void finish(const Fitter& fitter, Stage stage, const nlohmann::json& training);
  nlohmann::json stage_metrics(const IdentifiedModel& model, const std::string& stage);

  Project project_;
  std::filesystem::path directory_;
  std::unique_ptr<GateData> data_;
  Progress progress_;
};

/// `fxdyn predict`: torque of the model over one log.
void predict_log(const std::filesystem::path& model, const std::filesystem::path& log, bool fixed,
                 const std::filesystem::path& directory);

/// `fxdyn payload`: the load of a second log, payload.json and the model with it, model.json.
void identify_payload(const std::filesystem::path& model, const std::filesystem::path& log,
                      const std::filesystem::path& directory);

struct Replay {
  bool same = false;           ///< every torque and saturation count
  std::filesystem::path file;  ///< replay.json: in DIR, or in DIR/joint_N for the drive of one joint
};
/// `fxdyn replay`: streams the test logs (and a perturbed copy) to the firmware image under QEMU.
Replay replay(Pipeline& pipeline, const std::filesystem::path& image, Eigen::Index max_ticks);

}  // namespace fxdyn

#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/regression/metrics.hpp"

namespace fxdyn {

struct DhChain;
struct PhysicalFit;

/// A parameter of a possible body, and how much of it the data decided (DataShare).
struct BodyFigure {
  double value = 0, data_share = 0;
};

/// The body that a fit gives a link, in the link's URDF frame [kg, m, kg m].
struct LinkResult {
  std::string link;
  BodyFigure mass;
  std::array<BodyFigure, 3> centre, first_moment;
  double smallest_eigenvalue = 0;  ///< of its pseudo-inertia
  struct Given {
    double mass = 0;
    std::array<double, 3> centre{}, first_moment{};
  };
  std::optional<Given> urdf;
};

/// See PhysicalFit.
struct PhysicalResult {
  bool constrained = false;
  std::string prior;
  BodyFigure mass;                  ///< of all links
  std::optional<double> urdf_mass;  ///< where all links have one
  std::vector<LinkResult> links;
};
PhysicalResult physical_result(const Robot& robot, const DhChain& chain, const PhysicalFit& fit);

/// What a fit of the coefficients says beside the model.
struct FitResult {
  std::string method;
  double condition_number = 0;  ///< not finite: not known
  struct Weak {
    std::string parameter;
    double share_of_rated = 0;
    std::string joint_to_move;
  };
  std::vector<Weak> weak;
  std::vector<std::int64_t> saturated_rows;  ///< per joint
  std::optional<PhysicalResult> physical;
  /// Method rls: estimates on the way through the logs, one row a moment.
  struct Recursion {
    double forgetting = 1;
    std::vector<double> t;
    std::vector<std::vector<double>> estimates;
  };
  std::optional<Recursion> recursion;
};

/// What became of the BLS on one joint.
struct TrainedJoint {
  struct Choice {
    std::string by;
    std::int64_t nodes = 0;
    int windows = 1;
    std::string activation, inputs;
    double ridge = 0, scale = 0, reference_velocity = 0, value = 0;
    std::optional<std::vector<double>> distances;    ///< of inputs that have them, as the next two
    std::optional<double> stribeck_velocity, share;  ///< bristles
    std::optional<int> generations;                  ///< of a swarm
  };
  std::string joint, unit;
  double held_out_without = 0, held_out_with = 0;
  bool kept = false;
  int evaluations = 0;
  std::optional<Choice> choice;
};

/// Errors of the stages at one joint on what judges [N*m | N]: RMS over the validate logs, else over train logs that
/// judge one another, each by a fit of the others. And the stage that the joint has in model.json.
struct GateErrors {
  std::string joint, unit;
  std::optional<double> friction;  ///< none: nominal.json is not there
  double diagnosed = 0, bls = 0;
  std::string exported;  ///< diagnosed or bls
};

/// Content of metrics.json.
struct MetricsResult {
  std::vector<LogErrors> logs;
  /// Of a prediction: what computed it, real or fixed. Else empty, and what follows is there.
  std::string numbers{};
  std::string gate{};
  std::size_t base_parameters = 0;
  std::vector<std::string> notes{};
  std::vector<StageErrors> stages{};
  std::optional<FitResult> fit{};                       ///< none: the diagnosis made the model
  std::optional<std::vector<TrainedJoint>> training{};  ///< none: not trained
  std::vector<GateErrors> gate_errors{};                ///< empty: not trained
};
nlohmann::json to_json(const MetricsResult& result);
MetricsResult metrics_of(const nlohmann::json& file);

}  // namespace fxdyn

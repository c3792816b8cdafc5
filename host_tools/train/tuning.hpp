#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/project/project.hpp"
#include "host_tools/regression/fitter.hpp"

namespace fxdyn {

/// Hyperparameters of one joint's BLS.
struct BlsShape {
  std::string activation = "tanh";  ///< tanh, sigmoid, relu
  Eigen::Index nodes = 20;
  int windows = 1;
  double ridge = 1e-4;
  double scale = 1;                  ///< of the nodes' input weights in the first window
  double distance = 1e-3;            ///< middle presliding distance, of the joint's range
  double spread = 3;                 ///< between two presliding distances
  double reference_velocity = 0.02;  ///< of the joint's top speed
  double stribeck = 0.03;            ///< Stribeck velocity of the inputs "bristles", of the joint's top speed
  double share = 0.7;                ///< Coulomb's of static friction there
};

/// Makes designs of one joint: the fitter's own with a BLS in it.
class BlsDesigner {
 public:
  /// @param fitter must outlive it where features are sparse: they are made from its logs
  BlsDesigner(const Fitter& fitter, std::size_t joint, const TrainSettings& settings);
  /// Random features: weights are drawn once (paper Eqs. 23 and 25). Sparse ones: sparse_weights(). Either way fewer
  /// nodes are the first of more. Window w of W has weights of scale * 3^(w / (W - 1)): coarse and fine ones.
  ///
  /// A sigmoid is tanh with half the weights and an offset (TanhNodes); a joint without an offset gets that effect.
  JointFit operator()(const BlsShape& shape) const;

 private:
  Eigen::MatrixXd random_weights(Eigen::Index nodes, Eigen::Index inputs) const;

  const Fitter* fitter_;
  std::size_t joint_;
  TrainSettings settings_;
  JointFit nominal_;
  std::uint64_t seed_;
  bool revolute_ = true;
  double low_ = 0, high_ = 0, top_speed_ = 0, top_acceleration_ = 0;
};

/// The design with the first nodes of its BLS only.
JointFit first_nodes(JointFit design, Eigen::Index nodes);

/// The search space of a swarm. Lengths, scales and the ridge on logarithms. Inputs with bristles have two dimensions
/// more, the activation is the last one where there is a choice.
class BlsSpace {
 public:
  explicit BlsSpace(const TrainSettings& settings);
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }
  BlsShape operator()(const Eigen::VectorXd& x) const;

 private:
  std::vector<std::string> activations_;
  bool bristles_;
  Eigen::VectorXd lower_, upper_;
};

/// Whether fixed point can hold the coefficients: sums of |c| above so many times rated torque would show.
bool is_quiet(const Judgement& judgement, double rated_torque);

/// J of train(), ten times that where the coefficients are not quiet [of rated torque].
double fitness_of(const Judgement& judgement, const JointFit& design);

/// What a search of one joint's BLS minimises over BlsSpace: fitness_of(). The fitter must outlive it; any number of
/// threads may ask at once.
class BlsFitness {
 public:
  BlsFitness(const Fitter& fitter, std::size_t joint, const TrainSettings& settings);
  const BlsSpace& space() const { return space_; }
  struct Outcome {
    BlsShape shape;
    JointFit design;
    Judgement judgement;
    bool quiet = false;
    double value = 0;  ///< J, of rated torque
  };
  Outcome operator()(const Eigen::VectorXd& x) const;

 private:
  const Fitter* fitter_;
  std::size_t joint_;
  BlsSpace space_;
  BlsDesigner design_of_;
};

}  // namespace fxdyn

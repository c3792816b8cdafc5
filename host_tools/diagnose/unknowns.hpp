#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "host_tools/diagnose/block_solver.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/robot_columns.hpp"

namespace fxdyn::diagnosis {

struct Models;
struct Rotor;

/// An effect of Models::current: of joints[joint].effects, or of body.
struct EffectId {
  bool body = false;
  std::size_t joint = 0, effect = 0;
  bool operator==(const EffectId&) const = default;
};

/// One scalar that is fitted.
struct Unknown {
  enum class Kind {
    base,    ///< base parameter
    linear,  ///< coefficient of an effect
    width,   ///< logarithm of a joint's sign width
    shape,   ///< logarithm of an effect's shape parameter
    rotor,   ///< inertia that is the rotor's and not the link's: the base parameters give what it takes
  };
  Kind kind = Kind::base;
  std::size_t joint = 0, effect = 0, index = 0;  ///< base: index; shape and linear: of the current model's effect
  std::size_t healthy_effect = 0;                ///< the same in the healthy model
  bool body = false;                             ///< effect of IdentifiedModel::body
  bool change = false;                           ///< what the current session has more than the healthy one
  double lower = 0, upper = 1e300;               ///< shape, width: its bounds; rotor: at most
  Eigen::VectorXd in_base{};                     ///< rotor: see Rotor
  double value = 0;                              ///< in the model; 0 for logarithms, whose steps are fitted
  double width = 0;                              ///< width: in the model
  double prior = 0, prior_std = 0;               ///< std 0: none

  /// What `value` can be.
  double most() const { return kind == Kind::rotor ? upper : kind == Kind::width ? std::log(upper / width) : 1e300; }
  bool is_logarithm() const { return kind == Kind::shape || kind == Kind::width; }
};

/// Columns of one effect with one shape: a candidate, or one that the model has by name.
struct Group {
  EffectCandidate candidate;
  bool on_body = false;
  bool in_model = false;  ///< columns are d torque / d (unknown) around the named effect `id`
  EffectId id{};
  Eigen::Index first = 0;                ///< column
  Eigen::Index count = 0;                ///< columns
  int nonlinear = 0;                     ///< shape parameters that were searched
  std::shared_ptr<const Rotor> rotor{};  ///< of a candidate that would separate it from the base parameters, else null
  double rotor_inertia = 0;              ///< .. what of them is taken for the rotor's [kg m^2 | kg]
  double log_grid = 0;                   ///< ln of the number of independent shapes tried
  std::vector<double> lower{};           ///< bounds of the coefficients
};

/// What is fitted around two models. First the nuisance: base parameters, nominal effects and widths, and how they
/// changed since the baseline; then the named effects.
struct Unknowns {
  std::vector<Unknown> all;
  std::vector<Eigen::Index> nuisance;  ///< places in `all`
  std::vector<Group> named;            ///< `first` is a place in `all`

  std::vector<Prior> priors() const;
};

Unknowns make_unknowns(const Models& models);

/// Bounds of a shape parameter, as far as these logs can show it: a delay is so many steps of the finest log, and what
/// happens within a step of the encoder does not show.
std::pair<double, double> shape_limits(const Models& models, std::size_t joint, const EffectInfo& info,
                                       const ParameterInfo& shape);

/// The effect of an unknown that is neither base parameter nor width.
const EffectFit& effect_of(const IdentifiedModel& model, const Unknown& unknown);
/// The unknown as it lies in the healthy model.
Unknown in_healthy(Unknown unknown);
/// Moves an unknown in a model.
void add_to(IdentifiedModel& model, const Unknown& unknown, double step);

/// Moves the models by a share of the step to a fit's coefficients; columns behind the unknowns are left out.
void update(Models& models, const std::vector<Unknown>& unknowns, const LinearFit& fit, double share);

}  // namespace fxdyn::diagnosis

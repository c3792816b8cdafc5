#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>

namespace fxdyn {

/// How a swarm searches (paper Eqs. 31-38). What the paper leaves open or prints wrong is put right here:
/// - Eq. 33 is chi = 2 / |2 - phi - sqrt(phi^2 - 4 phi)|, phi = c_1 + c_2 > 4 (Clerc and Kennedy 2002).
/// - chi multiplies the inertia weight too (Eq. 34), which damps twice; `first_inertia` and `last_inertia` are what is
///   left of it, chi w, so that the usual figures hold.
/// - Eq. 34 knows one best of all: a swarm follows it into the first basin it finds. Here g is the best among a
///   particle's neighbours in a ring (Kennedy and Mendes 2002) for the first part of the search.
/// - Eq. 38 would stop at the first generation in which nothing was found: here after `stall` of them.
struct SwarmSettings {
  int particles = 30;
  int iterations = 40;                             ///< generations after the first
  int stall = 10;                                  ///< stop after so many without progress
  double tolerance = 1e-4;                         ///< progress: the best falls by more than this share
  double cognitive = 2.05, social = 2.05;          ///< c_1, c_2
  double first_inertia = 0.6, last_inertia = 0.3;  ///< chi w, falling linearly (Eq. 37)
  int neighbours = 2;                              ///< on either side
  double neighbourly = 0.6;                        ///< share of the generations in which only neighbours are followed
  double largest_step = 0.3;                       ///< velocity's bound, of the box
  std::uint64_t seed = 1;
};

/// Particle swarm optimisation in a box, generation by generation: the caller evaluates positions() in any order and on
/// as many threads as it likes, and hands back the values with tell(). Random numbers belong to (seed, generation,
/// particle), so that nothing else has a say in the outcome; a state that was written and read again goes on as if
/// nothing had happened.
///
///   v <- chi [w v + c_1 r_1 (p - x) + c_2 r_2 (g - x)],  x <- x + v,  cut to the box (paper Eqs. 34, 32, 36)
///
/// r_1, r_2 uniform per element; p the particle's best, g its neighbours', later the swarm's. At a wall the velocity
/// across it ends.
class Swarm {
 public:
  /// @param lower, upper the box, one element a dimension
  Swarm(Eigen::VectorXd lower, Eigen::VectorXd upper, const SwarmSettings& settings);

  /// Dimensions x particles: what is to be evaluated now.
  const Eigen::MatrixXd& positions() const { return x_; }
  /// Values of positions(), to be minimised. Not finite: worse than any.
  void tell(const Eigen::VectorXd& values);
  /// All generations done, or stalled.
  bool finished() const;
  /// Generations whose values are known.
  int generation() const { return generation_; }
  const Eigen::VectorXd& best() const { return best_; }
  double best_value() const { return best_value_; }

  nlohmann::json to_json() const;
  /// @throws nlohmann::json::exception, InputError: not the state of such a swarm
  void from_json(const nlohmann::json& state);

 private:
  void move();
  /// Where the best of the particle's neighbours was, itself included.
  Eigen::VectorXd best_near(Eigen::Index particle) const;

  Eigen::VectorXd lower_, upper_;
  SwarmSettings settings_;
  int generation_ = 0, stalled_ = 0;
  Eigen::MatrixXd x_, v_, own_best_;
  Eigen::VectorXd own_value_, best_;
  double best_value_;
  double milestone_;  ///< best value when the search last made progress
};

}  // namespace fxdyn

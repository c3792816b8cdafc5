#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/diagnose/gain.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn::diagnosis {

/// A set of effects beside the nuisance.
struct Choice {
  std::vector<std::size_t> groups;
  LinearFit fit;
  /// -sum N ln(RSS / N) over the joints - sum over effects of ((linear + nonlinear) ln N + 2 ln grid)
  double score = -1e300;
  std::size_t impossible = 0;  ///< effects whose coefficients don't keep their bounds

  bool possible() const { return impossible == 0; }
};

/// Place in the fit's coefficients at which those of its groups begin.
Eigen::Index first_of_groups(const Linearised& problem, const Choice& choice);

struct Alternative {
  EffectCandidate candidate;
  double behind = 0;  ///< score of the set with it in place of the chosen one, less
};

/// The effect that comes nearest to a chosen one.
struct Rival {
  Group group;
  Eigen::VectorXd coefficients;  ///< beside the rest of the set
  /// What the set with the chosen one is better by on data that fitted neither [noise variances], and by the penalty of
  /// the rival's further parameters: no data refute what has the chosen one as a special case.
  double gain = 0;
};

/// One effect of the outcome.
struct Found {
  std::size_t group = 0;
  double score = 0;  ///< what the set loses without it
  std::vector<Alternative> alternatives;
  std::optional<Rival> rival{};  ///< none: nothing else explains any of it
};

struct SearchSettings {
  std::size_t max_effects = 3;  ///< per joint
  std::size_t robot_effects = 2;
  std::size_t most = 8;  ///< of the whole robot: what needs more is not explained by the catalogue
};

/// What a search is asked for.
struct SearchTask {
  SearchSettings settings;
  std::vector<EffectCandidate> never;  ///< effects that are not tried
};

/// Beam search forward, swaps, backward elimination.
class Search {
 public:
  Search(Linearised& problem, const SearchTask& task) : problem_(problem), task_(task) {}

  /// @param start groups to begin with (named effects of the model)
  Choice run(const std::vector<std::size_t>& start, Progress& progress);
  /// The choice with an effect that unites others (EffectTraits::unites) in place of those of them that it has, joint
  /// by joint, where that scores better; and with its parts where it does not.
  Choice unite(Choice best);
  /// What speaks for each effect of a choice. One whose rival is clearly better on data that fitted neither gives way.
  std::vector<Found> explain(Choice& choice);
  /// @param better the choice with the rival that is best on data that fitted neither, where one is clearly better
  std::vector<Found> explain(const Choice& choice, std::optional<Choice>& better);
  Choice evaluate(const std::vector<std::size_t>& groups) const;
  /// Squares that a choice leaves on the folds' judges, in variances of what it leaves where it was fitted.
  double held_out(const Choice& choice, const Eigen::VectorXd& weights) const;
  /// By group, at the start of run(): share of its columns that the nuisance and the named effects do not absorb (the
  /// largest over their directions), squared.
  const std::vector<double>& not_absorbed() const { return kept_; }
  /// Scores that an effect of a joint must reach to be believed: from residuals shifted in time against the motion.
  const Eigen::VectorXd& thresholds() const { return thresholds_; }

 private:
  struct Scored {
    std::size_t group;
    double score;
  };
  /// Candidates' columns once a state's have taken their part.
  struct Candidates {
    Eigen::Index first = 0;         ///< column of the first candidate
    Eigen::MatrixXd by_state;       ///< coefficients of the state's columns in each candidate column
    std::vector<Reduced> products;  ///< by group
    std::vector<Gain> gain;         ///< by group
    std::vector<char> usable;       ///< by group: may be added, and something of it is left
  };
  Eigen::VectorXd weights_of(const LinearFit& fit) const;
  Candidates project(const Choice& state);
  double absorbed(const Group& group, const Gain& gain) const;
  void estimate_thresholds(const Choice& state, const Candidates& candidates);
  Eigen::VectorXd scores_of_noise(std::size_t joint, const Choice& state, const Candidates& candidates) const;
  std::vector<Scored> score_all(const Choice& state, bool with_thresholds);
  std::vector<Scored> worth_trying(const std::vector<Scored>& scored) const;
  /// One effect on the robot for several of others: it is added whatever it brings beside them, and what is not needed
  /// any more goes. Swaps, one for one, don't get from two gains of joints to one load.
  bool trade(Choice& best);
  Choice pruned(Choice choice, std::size_t kept) const;
  std::size_t refine(const Choice& state, std::size_t group);
  std::optional<Choice> united(const Choice& choice, const EffectInfo& info, std::size_t joint);
  std::optional<Choice> divided(const Choice& choice, const EffectInfo& info, std::size_t joint);
  std::optional<Choice> with_best(const std::vector<std::size_t>& others, const std::vector<Group>& candidates);
  bool is_better_held_out(const std::vector<std::size_t>& groups, const std::vector<std::size_t>& than,
                          std::size_t joint) const;
  double penalty(std::size_t group) const;
  double threshold(std::size_t group) const;
  const SearchOptions& options() const;
  bool is_of_links(const Group& group) const;
  bool allowed(const Choice& state, std::size_t group) const;
  void find_ripples(const Choice& state, std::optional<std::size_t> joint);
  double samples() const;

  Linearised& problem_;
  SearchTask task_;
  Eigen::VectorXd thresholds_;
  std::vector<double> kept_;
};

}  // namespace fxdyn::diagnosis

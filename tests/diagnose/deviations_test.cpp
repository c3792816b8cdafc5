// Deviations are written into the model whose unknowns they are, whatever a search left.

#include "host_tools/diagnose/deviations.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "host_tools/diagnose/explore.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

class BackToStart : public ::testing::Test {
 protected:
  /// A search's outcome around these models, no name left.
  Outcome outcome_of(const Models& models) const {
    Outcome out;
    out.models = models;
    out.whitening = test::no_whitening();
    out.look_again(logs_);
    return out;
  }

  const Models start_ = test::around(test::fitted_puma());
  const std::vector<SessionLog> logs_{test::small_session_log(start_.current, Role::train, 1)};
};

void expect_same_deviations(const IdentifiedModel& model, const IdentifiedModel& right) {
  for (std::size_t j = 0; j < right.joints.size(); ++j) {
    const std::vector<EffectFit>&now = model.joints[j].effects, &wanted = right.joints[j].effects;
    ASSERT_EQ(now.size(), wanted.size());
    for (std::size_t e = 0; e < wanted.size(); ++e) {
      EXPECT_EQ(now[e].effect, wanted[e].effect);
      ASSERT_EQ(now[e].linear_std.size(), wanted[e].linear.size());
      EXPECT_GT(now[e].linear_std[0], 0);
      EXPECT_DOUBLE_EQ(now[e].linear_std[0], wanted[e].linear_std[0]) << j << " " << now[e].effect;
    }
  }
}

// The search's problem has one effect more than the model: its deviations have no place there.
TEST_F(BackToStart, AnEffectThatIsLeftWithoutANameIsDroppedWithItsProblem) {
  Outcome right = outcome_of(start_);
  back_to_start(right, start_, logs_);
  Models longer = start_;
  longer.current->joints[1].effects.push_back(test::effect("stribeck", {0.2}, {0.5}));
  Outcome outcome = outcome_of(longer);
  back_to_start(outcome, start_, logs_);
  expect_same_deviations(outcome.models.current, right.models.current);
}

// As many effects, but not the same: the deviations would be another effect's.
TEST_F(BackToStart, AnotherEffectInItsPlaceIsDropped) {
  Outcome right = outcome_of(start_);
  back_to_start(right, start_, logs_);
  Models other = start_;
  other.current->joints[1].effects.back() = test::effect("viscous_cubic", {}, {0.1});
  Outcome outcome = outcome_of(other);
  back_to_start(outcome, start_, logs_);
  expect_same_deviations(outcome.models.current, right.models.current);
}

TEST_F(BackToStart, TheProblemStaysWhereItIsTheModels) {
  Outcome outcome = outcome_of(start_);
  const Linearised* problem = outcome.problem.get();
  back_to_start(outcome, start_, logs_);
  EXPECT_EQ(outcome.problem.get(), problem);
}

TEST_F(BackToStart, DeviationsOfAnotherModelAreRefused) {
  Models longer = start_;
  longer.current->joints[1].effects.push_back(test::effect("stribeck", {0.2}, {0.5}));
  const Outcome outcome = outcome_of(longer);
  Models models = start_;
  EXPECT_THROW(add_deviations(models, *outcome.problem), std::out_of_range);
}

/// Deviations of a delay on the second joint off none.
double of_delay(double time) {
  Models models = test::around(test::fitted_puma());
  models.current->joints[1].effects.push_back(test::named_effect("delay", {time}, {1}));
  const std::vector<SessionLog> logs{test::small_session_log(models.current, Role::train, 1)};
  return deviations_off_nothing(Linearised(models, logs, test::no_whitening()), {0})[0];
}

// Its only coefficient is 1: how far it is off nothing is how well its time is known.
TEST(DeviationsOffNothing, OfADelayAreThoseOfItsTime) {
  const double long_one = of_delay(0.02), short_one = of_delay(1e-5);
  EXPECT_GT(long_one, 10);
  EXPECT_LT(short_one, 2);
  EXPECT_GT(short_one, 0);
}

}  // namespace
}  // namespace fxdyn::diagnosis

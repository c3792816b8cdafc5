// The scalars that are fitted, their priors, and what a fit makes of the models.

#include "host_tools/diagnose/unknowns.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/diagnose/sessions.hpp"
#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/regression/encoder_noise.hpp"

#include <gtest/gtest.h>

#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Kind = Unknown::Kind;

std::size_t count(const Unknowns& unknowns, Kind kind) {
  return static_cast<std::size_t>(
      std::count_if(unknowns.all.begin(), unknowns.all.end(), [&](const Unknown& u) { return u.kind == kind; }));
}

/// A fit that says `value` of one unknown and leaves the others where they are.
LinearFit only(const Unknowns& unknowns, std::size_t of, double value) {
  LinearFit fit;
  fit.x.resize(static_cast<Index>(unknowns.all.size()));
  for (std::size_t i = 0; i < unknowns.all.size(); ++i) {
    fit.columns.push_back(static_cast<Index>(i));
    fit.x[static_cast<Index>(i)] = i == of ? value : unknowns.all[i].value;
  }
  return fit;
}

class UnknownsOfAModel : public testing::Test {
 protected:
  UnknownsOfAModel() { models_ = test::around(test::fitted_puma()); }
  Models models_;
};

TEST_F(UnknownsOfAModel, ALoadsCentreHasAPriorAndItsMassNone) {
  models_.current->body.push_back(test::named_effect("payload", {}, {2, 0.1, 0, 0.2}));
  const Unknowns unknowns = make_unknowns(models_);
  ASSERT_EQ(unknowns.named.size(), 1U);
  const auto first = static_cast<std::size_t>(unknowns.named[0].first);
  EXPECT_EQ(unknowns.all[first].prior_std, 0);
  for (std::size_t i = 1; i < 4; ++i) {  // first moments, whose mean is none
    EXPECT_DOUBLE_EQ(unknowns.all[first + i].prior_std, 2 * models_.options.prior.load_centre);
    EXPECT_EQ(unknowns.all[first + i].prior, 0);
  }
}

TEST_F(UnknownsOfAModel, AreBaseParametersThenFrictionThenNames) {
  models_.current->joints[1].effects.push_back(test::named_effect("ripple", {12}, {0.3, 0.4}));
  const Unknowns unknowns = make_unknowns(models_);
  EXPECT_EQ(count(unknowns, Kind::base), models_.current->base.size());
  EXPECT_EQ(count(unknowns, Kind::width), 6U);
  EXPECT_EQ(count(unknowns, Kind::shape), 1U);
  EXPECT_EQ(count(unknowns, Kind::linear), 6U * 3 + 2);
  ASSERT_EQ(unknowns.named.size(), 1U);
  const Group& ripple = unknowns.named[0];
  EXPECT_EQ(ripple.count, 3);
  EXPECT_EQ(ripple.first, static_cast<Index>(unknowns.nuisance.size()));
  EXPECT_EQ(unknowns.all[static_cast<std::size_t>(ripple.first)].value, 0.3);
}

TEST_F(UnknownsOfAModel, FrictionMayChangeALittleFromSessionToSession) {
  models_.has_baseline = true;
  models_.healthy = models_.current;
  models_.current->joints[0].effects[1].linear[0] = 2.5;  // Coulomb: 2 before
  const Unknowns unknowns = make_unknowns(models_);
  const auto change = std::find_if(unknowns.all.begin(), unknowns.all.end(),
                                   [](const Unknown& u) { return u.change && u.joint == 0 && u.effect == 1; });
  ASSERT_NE(change, unknowns.all.end());
  EXPECT_NEAR(change->value, 0.5, 1e-12);
  EXPECT_NEAR(change->prior_std, std::hypot(0.1 * 2, 1e-3 * 100), 1e-12);
  EXPECT_EQ(change->prior, 0);
  // What is in proportion to the velocity changes with the grease's warmth: coefficient 1, at most 3 rad/s
  const auto viscous = std::find_if(unknowns.all.begin(), unknowns.all.end(),
                                    [](const Unknown& u) { return u.change && u.joint == 0 && u.effect == 0; });
  ASSERT_NE(viscous, unknowns.all.end());
  EXPECT_NEAR(viscous->prior_std, std::hypot(0.3 * 1, 1e-3 * 100 / 3), 1e-12);
}

TEST_F(UnknownsOfAModel, AGainMayChangeByAShareOfItselfAndOfTheRatedTorque) {
  models_.has_baseline = true;
  models_.current->joints[0].effects.push_back(test::effect("torque_gain", {}, {0.05}));
  models_.healthy = models_.current;
  const Unknowns unknowns = make_unknowns(models_);
  const std::size_t last = models_.current->joints[0].effects.size() - 1;
  const auto change = std::find_if(unknowns.all.begin(), unknowns.all.end(),
                                   [&](const Unknown& u) { return u.change && u.joint == 0 && u.effect == last; });
  ASSERT_NE(change, unknowns.all.end());
  EXPECT_NEAR(change->prior_std, std::hypot(0.1 * 0.05, 1e-3), 1e-12);
}

TEST_F(UnknownsOfAModel, StribeckIsWiderThanTheSign) {
  const EffectInfo &stribeck = *find_effect("stribeck"), &lugre = *find_effect("lugre");
  EXPECT_DOUBLE_EQ(shape_limits(models_, 1, stribeck, stribeck.shape[0]).first, 1.5 * 0.02);
  EXPECT_EQ(shape_limits(models_, 1, lugre, lugre.shape[1]).first, lugre.shape[1].lower);  // its bristles turn it over
}

TEST_F(UnknownsOfAModel, APathIsNoShorterThanTheEncoderKnowsWhereAJointTurnsBack) {
  const EffectInfo& presliding = *find_effect("presliding");
  const auto least = [&](double step, double noise) {
    models_.current->filter.encoder_step.assign(6, step);
    models_.current->filter.position_noise.assign(6, noise);
    return shape_limits(models_, 1, presliding, presliding.shape[0]).first;
  };
  EXPECT_DOUBLE_EQ(least(1e-4, 3e-5), 3e-4);
  EXPECT_DOUBLE_EQ(least(0, 3e-5), std::sqrt(12.0) * 3e-5) << "white noise";
}

TEST_F(UnknownsOfAModel, ASignIsNoNarrowerThanWhatShows) {
  models_.least_width = {0.019, 0.03};
  const Unknowns unknowns = make_unknowns(models_);
  const auto width = [&](std::size_t joint) {
    const auto found = std::find_if(unknowns.all.begin(), unknowns.all.end(),
                                    [&](const Unknown& u) { return u.kind == Kind::width && u.joint == joint; });
    return static_cast<std::size_t>(found - unknowns.all.begin());
  };
  for (std::size_t joint = 0; joint < 3; ++joint) update(models_, unknowns.all, only(unknowns, width(joint), -0.2), 1);
  EXPECT_DOUBLE_EQ(models_.current->joints[0].sign_width, 0.019);
  EXPECT_DOUBLE_EQ(models_.current->joints[1].sign_width, 0.03) << "it began below";
  EXPECT_DOUBLE_EQ(models_.current->joints[2].sign_width, 0.02 * std::exp(-0.2)) << "not known";
}

TEST_F(UnknownsOfAModel, ASignBesideALawOfTheNominalModelOnlyGetsNarrower) {
  models_.current->joints[1].effects.push_back(test::effect("lugre", {0.005, 0.05, 0.7}, {3, 1}));
  for (const bool named : {false, true}) {
    models_.current->joints[1].effects.back().named = named;
    for (const Unknown& u : make_unknowns(models_).all) {
      if (u.kind != Kind::width) continue;
      EXPECT_EQ(u.most() < 1e-12, u.joint == 1 && !named) << u.joint << ": " << u.most();
    }
  }
  models_.current->joints[1].effects.back().named = false;
  const auto after = [&](double step) {
    Models moved = models_;
    const Unknowns unknowns = make_unknowns(moved);
    for (std::size_t i = 0; i < unknowns.all.size(); ++i) {
      if (unknowns.all[i].kind == Kind::width && unknowns.all[i].joint == 1)
        update(moved, unknowns.all, only(unknowns, i, step), 1);
    }
    return moved.current->joints[1].sign_width;
  };
  EXPECT_DOUBLE_EQ(after(0.2), 0.02);
  EXPECT_DOUBLE_EQ(after(-0.2), 0.02 * std::exp(-0.2));
}

TEST_F(UnknownsOfAModel, WhatOfASignShowsFollowsFromTheNoiseAndTheSpeed) {
  std::vector<SessionLog> logs{test::small_session_log(models_.current, Role::train, 1),
                               test::small_session_log(models_.current, Role::validate, 2)};
  double speed = 0;
  for (const SessionLog& entry : logs) {
    const ProcessedLog& log = entry.log;
    speed = std::max(speed, log.joint_velocity(0).segment(log.first, log.last - log.first).cwiseAbs().maxCoeff());
  }
  EXPECT_DOUBLE_EQ(least_widths(logs)[0], narrowest_sign * speed) << "no noise";
  logs[0].log.filter.position_noise[0] = 1e-2;
  logs[1].log.filter.position_noise[0] = 1e-3;
  const double noise = velocity_noise(logs[1].log.filter, 0, logs[1].log.step_s);
  ASSERT_GT(noise, narrowest_sign * speed);
  EXPECT_DOUBLE_EQ(least_widths(logs)[0], noise) << "of the log that has less";
  logs[0].log.measured_dq = logs[0].log.motion().dq;
  EXPECT_DOUBLE_EQ(least_widths(logs)[0], narrowest_sign * speed) << "a velocity that was measured";
  EXPECT_TRUE(least_widths(std::vector<SessionLog>{}).empty());
}

TEST_F(UnknownsOfAModel, AGapThatTheLargestLoadDoesNotCloseIsNone) {
  const EffectInfo& backlash = *find_effect("backlash");
  models_.largest_load = {5, 50};
  EXPECT_DOUBLE_EQ(shape_limits(models_, 1, backlash, backlash.shape[0]).second, 0.4 * 50);
  EXPECT_DOUBLE_EQ(shape_limits(models_, 2, backlash, backlash.shape[0]).second, backlash.shape[0].upper);  // unknown
  models_.largest_load[0] = 0;
  const auto [least, most] = shape_limits(models_, 0, backlash, backlash.shape[0]);
  EXPECT_EQ(least, most);
}

// model.json with more damping would be refused: bristles would drive the joint.
TEST_F(UnknownsOfAModel, LuGreStaysFriction) {
  models_.current->joints[1].effects.push_back(test::named_effect("lugre", {0.01, 0.02, 0.6}, {5, 30}));
  const Unknowns unknowns = make_unknowns(models_);
  const auto damping = std::find_if(unknowns.all.begin(), unknowns.all.end(), [](const Unknown& u) {
    return u.kind == Kind::linear && u.joint == 1 && u.effect == 3 && u.index == 1;
  });
  ASSERT_NE(damping, unknowns.all.end());
  update(models_, unknowns.all, only(unknowns, static_cast<std::size_t>(damping - unknowns.all.begin()), 1e5), 1);
  const JointFit& joint = models_.current->joints[1];
  EXPECT_EQ(why_it_does_not_brake(joint, joint.dq_limit), std::nullopt);
  EXPECT_NEAR(joint.find("lugre")->linear[1], *most_that_brakes(joint, *joint.find("lugre"), joint.dq_limit), 1);
}

TEST_F(UnknownsOfAModel, HowMuchIsAThreshold) {
  models_.has_baseline = true;
  models_.healthy = models_.current;
  models_.options.prior = {.dry_friction_change = 0.5, .smallest_change = 0};
  const Unknowns unknowns = make_unknowns(models_);
  const auto change = std::find_if(unknowns.all.begin(), unknowns.all.end(),
                                   [](const Unknown& u) { return u.change && u.joint == 0 && u.effect == 1; });
  ASSERT_NE(change, unknowns.all.end());
  EXPECT_NEAR(change->prior_std, 0.5 * 2, 1e-12);
}

TEST_F(UnknownsOfAModel, AFitMovesTheModel) {
  const Unknowns unknowns = make_unknowns(models_);
  const std::size_t coulomb = models_.current->base.size() + 2;  // behind width and viscous
  Models moved = models_;
  update(moved, unknowns.all, only(unknowns, coulomb, 3), 0.5);
  EXPECT_NEAR(moved.current->joints[0].effects[1].linear[0], 2.5, 1e-12);
  EXPECT_EQ(moved.current->joints[0].effects[0].linear[0], 1);
  // The logarithm of a width, by 0.4 at most.
  update(moved, unknowns.all, only(unknowns, models_.current->base.size(), 5), 1);
  EXPECT_NEAR(moved.current->joints[0].sign_width, 0.02 * std::exp(0.4), 1e-12);
  // A base parameter, with the inertia that stands for it.
  update(moved, unknowns.all, only(unknowns, 3, models_.current->base[3].value + 0.25), 1);
  const std::size_t column = models_.current->base[3].column;
  const auto inertia = [&](const IdentifiedModel& model) {
    return to_array(model.inertia[column / parameters_per_link])[column % parameters_per_link];
  };
  EXPECT_NEAR(moved.current->base[3].value, models_.current->base[3].value + 0.25, 1e-12);
  EXPECT_NEAR(inertia(moved.current), inertia(models_.current) + 0.25, 1e-12);
}

TEST_F(UnknownsOfAModel, APayloadIsMassAndFirstMoment) {
  models_.current->body = {test::named_effect("payload", {}, {2, 0.1, 0, 0.05})};
  const Unknowns unknowns = make_unknowns(models_);
  const auto mass = static_cast<std::size_t>(unknowns.named[0].first);
  EXPECT_NEAR(unknowns.all[mass + 1].value, 0.2, 1e-12);
  update(models_, unknowns.all, only(unknowns, mass, 4), 1);
  const std::vector<double>& load = models_.current->body[0].linear;
  EXPECT_EQ(load[0], 4);
  EXPECT_NEAR(load[0] * load[1], 0.2, 1e-12);  // the first moment stays
}

}  // namespace
}  // namespace fxdyn::diagnosis

#include "host_tools/regression/judgement.hpp"
#include "host_tools/effects/joint_fit.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

Judgement of(double rmse, std::vector<double> blocks) {
  Judgement out;
  out.rmse = rmse;
  out.blocks = std::move(blocks);
  return out;
}

TEST(Judgement, BetterByItsWorthOnThreeBlocksInFour) {
  const Judgement before = of(1, {1, 1, 1, 1});
  EXPECT_TRUE(of(0.97, {0.9, 0.9, 0.9, 1.1}).beats(before, 0.02));
  EXPECT_FALSE(of(0.97, {0.8, 0.8, 1.1, 1.1}).beats(before, 0.02));
  EXPECT_FALSE(of(0.99, {0.9, 0.9, 0.9, 0.9}).beats(before, 0.02));
}

TEST(Judgement, BlocksOfOneLogAskForFourTimesAsMuchOnEveryBlock) {
  const Judgement before = of(1, {1, 1, 1, 1});
  Judgement after = of(0.93, {0.9, 0.9, 0.9, 0.9});
  EXPECT_TRUE(after.beats(before, 0.02));
  after.blocks_of_one_log = true;
  EXPECT_FALSE(after.beats(before, 0.02));
  after.rmse = 0.91;
  EXPECT_TRUE(after.beats(before, 0.02));
  after.blocks[3] = 1.01;
  EXPECT_FALSE(after.beats(before, 0.02));
}

TEST(Judgement, WhatIsNotPhysicalNeverBeats) {
  Judgement after = of(0.5, {0.5});
  after.physical = false;
  EXPECT_FALSE(after.beats(of(1, {1}), 0.02));
}

TEST(Judgement, OnlyTheLastEffectHasToKeepItsBounds) {
  JointFit design;
  design.effects.resize(2);
  design.effects[0].effect = "viscous";
  design.effects[1].effect = "coulomb";
  EXPECT_TRUE(last_is_physical(design, Eigen::Vector2d(-0.1, 2)));
  EXPECT_FALSE(last_is_physical(design, Eigen::Vector2d(0.1, -2)));
  design.bls.emplace();  // beside a BLS one coefficient means nothing
  EXPECT_TRUE(last_is_physical(design, Eigen::Vector2d(0.1, -2)));
}

}  // namespace
}  // namespace fxdyn

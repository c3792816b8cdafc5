// Effects that the host finds by what they declare: the catalogue has one for each part.

#include "host_tools/effects/effect_roles.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

TEST(EffectRoles, TheCatalogueHasOneForEach) {
  EXPECT_EQ(load_effect().name, "payload");
  EXPECT_EQ(rotor_effect().name, "rotor_inertia");
  EXPECT_EQ(dry_friction_effect().name, "coulomb");
  EXPECT_EQ(viscous_friction_effect().name, "viscous");
  EXPECT_EQ(friction_of_load_effect().name, "load_friction");
  EXPECT_EQ(constant_effect().name, "offset");
  EXPECT_EQ(presliding_effect().name, "presliding");
  EXPECT_EQ(compliance_effect().name, "elasticity");
  EXPECT_EQ(play_effect().name, "backlash");
  EXPECT_EQ(once_a_turn_effect().name, "eccentricity");
  for (const EffectInfo& info : effect_infos()) {
    EXPECT_EQ(is_load(info.name), info.name == "payload") << info.name;
    EXPECT_EQ(is_compliance(info), info.name == "elasticity") << info.name;
  }
}

TEST(EffectRoles, AreFoundOnAJoint) {
  JointFit joint;
  EXPECT_EQ(dry_friction_of(joint), nullptr);
  EXPECT_EQ(compliance_of(joint), nullptr);
  for (const char* effect : {"viscous", "backlash", "elasticity", "coulomb"}) {
    joint.effects.emplace_back();
    joint.effects.back().effect = effect;
  }
  EXPECT_EQ(dry_friction_of(joint), &joint.effects[3]);
  EXPECT_EQ(compliance_of(joint), &joint.effects[2]);
}

/// What the fit leaves alone: choices from a list, a curve's knots, and a time constant that one session can't show.
TEST(EffectRoles, ListedShapesAreThoseOfCouplingsAndCurves) {
  for (const EffectInfo& info : effect_infos()) {
    for (const ParameterInfo& shape : info.shape)
      EXPECT_EQ(shape.values.search == ShapeSearch::list, shape.name == "joint" || shape.name == "ratio" || info.curve)
          << info.name << " " << shape.name;
    EXPECT_EQ(info.drifts(), info.name == "friction_drift") << info.name;
  }
}

}  // namespace
}  // namespace fxdyn

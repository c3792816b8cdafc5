#pragma once

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Least squares over everything that is not fixed (base parameters, friction, widths, named effects with their shapes)
/// by gauss_newton(), the model linearised again at every step: large delays, gaps, tilts and loads come out right.
/// Only logs that fit are looked at. A joint whose friction has no form that the model knows keeps no other from being
/// fitted: where steps do no good, its widths and shapes are held.
/// @param rounds of step and judgement; steps that do no good, four for each time that joints are held, come on top
/// @param only by joint: whether its effects are fitted, all else stays; empty: everything is
void refit(Models& models, const std::vector<SessionLog>& logs, const std::vector<Eigen::VectorXd>& whitening,
           int rounds, const std::vector<bool>& only = {});

/// Puts an effect into the current model as one that was named. Payload is given in mass and first moment. What the
/// link's torque does (friction in proportion to the load, a gear that bends) brings the rotor's inertia with it where
/// that is part of the base parameters: the gear carries the link, not the rotor.
EffectId name(Models& models, const Group& group, const Eigen::VectorXd& theta);
/// Makes some of the base parameters' inertia a rotor's, in both models.
void bring_rotor(Models& models, const Rotor& rotor, double inertia);
/// Takes a named effect out of the current model; `ids` of others follow.
void take_back(Models& models, std::vector<EffectId>& ids, const EffectId& id);
/// Likewise the rotor that name() brought; false: it brought none.
bool forget_rotor(Models& models, std::vector<EffectId>& ids, std::size_t joint);

}  // namespace fxdyn::diagnosis

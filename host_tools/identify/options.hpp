#pragma once

namespace fxdyn {

/// Thresholds of the identification: what decides, and not what makes a computation finer. They are no settings of a
/// project. A line each: unit; meaning; where the value comes from, as in host_tools/diagnose/options.hpp.

/// Choice of effects and of the torque's lead.
struct StructureOptions {
  /// share of the rows; a joint whose torque is at its limit for longer says nothing; hand
  double most_saturated = 0.5;
  /// share of the held-out error; what an effect or a lead must take away; hand
  double worth_keeping = 0.02;
  /// share of worth_keeping; a coupling's width is searched only where it brings that already; hand
  double worth_a_search = 0.5;
  /// share of the lead; joints whose own best leads are nearer agree; hand
  double same_lead = 0.2;
  /// share of the joints; how many must agree on the lead; hand
  double agreeing = 0.8;
  /// share of the torque cut-off's period; longest lead that is tried; hand
  double longest_lead = 0.2;
  /// s; longest lead that is tried; hand
  double longest_lead_s = 0.010;
  /// share of rated torque; standard deviation of a base parameter that gets a note; hand
  double worrying_error = 0.1;
  /// share of the largest eigenvalue of the scaled information; a direction with less has none; hand
  double no_information = 1e-12;
  /// share of a parameter's square; with more of it in such directions it is not identifiable; hand
  double lost = 0.1;
};

/// Reading of the logs, and the limits that they suggest.
struct GateOptions {
  /// rows of all logs together; longer logs are decimated more; hand: enough for a fit of a few hundred unknowns
  double most_rows = 60'000;
  /// samples of all logs together; from there on memory counts more than time, and one thread works; hand
  double long_logs = 1'500'000;
  /// rad | m; a joint that moves less may be parked, its drive off; hand
  double parked = 1e-3;
  /// times the largest in the logs; limits that nobody gave; hand
  double margin = 1.2;
  /// times the largest in the logs; velocity and torque limits of the URDF that are wider are placeholders; hand
  double widest_limit = 10;
  /// turns; likewise a revolute joint's position limits; hand: more than any gear's hoses allow
  double widest_turns = 8;
  /// times the range in the logs; likewise a slide's; hand
  double widest_slide = 10;
  /// share of the fastest dq; width of the sign before it is fitted; hand
  double sign_width = 0.01;
};

/// Signs and units of the torque. Scores are sums over joints of ln(residual square).
struct PlausibleOptions {
  /// score; another sign must gain; theory: exp(-1 / 2), a joint's RMS falls by 40 %; the level by hand
  double flip = 1;
  /// score; another unit must gain; theory: likewise by 63 %; the level by hand
  double unit = 2;
  /// -; a smaller factor of one joint's torque is a gain, which check reports; theory: between 5 and 10
  double unit_factor = 7;
  /// score; units that are nearer to the best are as good; hand
  double as_good = 1;
  /// share of the torque's RMS; residuals below count as this; hand: perfect fits are not better than perfect
  double perfect = 1e-3;
  /// standard deviations; a sign or a mass is sure; theory: 2 Phi(-5) = 6e-7
  double sure = 5;
  /// share of the poses; where the own inertia is negative; hand: nearly all
  double negative_poses = 0.9;
  /// share of the torque's RMS; friction that counts; hand
  double material_friction = 0.05;
  /// share of the torque's RMS; inertia that counts; hand
  double material_inertia = 0.2;
  /// kg/m^3; least mass over reach^3: more is in other units; hand: real arms have 2 .. 70
  double heaviest = 1000;
  /// kg/m^3; likewise less; hand
  double lightest = 0.1;
  /// m; reach of anything smaller; hand
  double shortest = 0.3;
  /// share of the robot's reach; joints with less say nothing of the mass; hand
  double least_reach = 0.2;
  /// share of the largest; gravity of the URDF's masses that is compared; hand
  double least_gravity = 0.1;
  /// -; gravity over that of the URDF's masses, or one over it, for a warning; hand
  double other_gravity = 10;
};

/// Gears seen by a link encoder.
struct FlexibleOptions {
  /// s; residuals further apart count as independent; hand
  double block_s = 0.5;
  /// standard deviations; compliance against none, other causes by Wald's test; theory: 2 Phi(-5) = 6e-7
  double significant = 5;
  /// share of the deflection's power; what the load explains at least; hand
  double least_share = 0.02;
  /// share of the residual's power; what another cause explains at least; hand
  double cause = 0.1;
  /// share of the deflection's power; .. and of all of it; hand
  double cause_of_all = 1e-4;
  /// share of the deflection's power; what follows the load for most of it; theory: more than half
  double most = 0.5;
  /// standard deviations; damping against none; theory: 2 Phi(-2) = 4.6 %
  double damped = 2;
};

/// Load on the last link.
struct LoadOptions {
  /// share of a column's square; what the others leave of one that is identifiable; hand
  double least_share_left = 1e-6;
  /// share of the largest column's length; a shorter column is no column; hand
  double no_column = 1e-9;
  /// of a unit vector; part that a parameter has in a direction without information, from which on it is not
  /// identifiable; hand
  double part = 0.03;
  /// share of the residual's power; the autocovariance is summed until it falls below; hand
  double faded = 0.02;
  /// N*m; a joint at which 1 kg weighs less does not lift the load; hand
  double least_lift = 0.1;
  /// kg/m^3; the ball that stands for a load of which nothing but the mass is known; hand: plastic
  double density = 2000;
  /// relative standard deviation; a mass that is known no better is none; hand
  double largest_uncertainty = 0.3;
  /// relative standard deviation; a joint whose gain a known load gives no better did not feel it; theory: three of
  /// them are the 3 % that a gain is wanted to
  double largest_gain_deviation = 0.01;
  /// share of the velocities' RMS; logs with and without a known load that differ more are of two motions; hand: up to
  /// 9 % every gain that was called known was right to 3 % (simulated arm, 120 pairs of logs with an amplitude apart)
  double other_motion = 0.1;
  /// s; one of them begins later by no more; hand: both are started by hand
  double longest_delay_s = 10;
  /// share; their sampling intervals differ by no more; hand: clocks
  double same_rate = 0.001;
};

struct IdentifyOptions {
  StructureOptions structure;
  PlausibleOptions plausible;
  FlexibleOptions flexible;
};

}  // namespace fxdyn

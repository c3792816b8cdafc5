#pragma once

namespace fxdyn::diagnosis {

/// Thresholds of the diagnosis: what decides, and not what makes a computation finer. They are no settings of a
/// project. A line each: unit; meaning; where the value comes from.
///   theory          the formula is given
///   hand            set by hand while the diagnosis was developed on the campaign's cases and the real logs
///                   (docs/findings/2026-11-21-diagnosis.md); no other reason is recorded
/// What halving and doubling does to those that decide a verdict: docs/findings/thresholds.md. An entry in
/// tests/campaign/thresholds.cpp each.

/// Noise of the rows.
struct NoiseOptions {
  /// noise variances; doubt of friction from which a row shows no direction; theory: doubt equals noise
  double doubtful = 1;
  /// rows; prior |b|^2 of a background's function of RMS 1, in noise variances; hand
  double background_prior = 4;
  /// times the noise; a residual from there on is mostly gap and gives no colour; hand, decision 0005
  double mostly_gap = 3;
};

/// What is known of parameters before the logs are looked at. All are standard deviations.
struct PriorOptions {
  /// share of itself; change of a coefficient between two healthy sessions, of friction in proportion to the velocity:
  /// the grease's warmth; hand, decision 0005
  double friction_change = 0.3;
  /// share of itself; .. of any other: dry friction changes little with warmth; hand
  double dry_friction_change = 0.1;
  /// share of Coulomb friction; change of the offset, beside that of itself; hand
  double offset_change = 0.05;
  /// share of rated torque; change of a coefficient that is zero; hand
  double smallest_change = 1e-3;
  /// share of rated torque over largest acceleration; inertia of a rotor that nothing shows; hand
  double rotor = 0.3;
  /// share of itself; inertia of a rotor that a link encoder shows; hand
  double link_rotor = 0.1;
  /// share of itself; the same once the load is that of the model that knows the rest. It is the deflection's: with
  /// 0.1 the torque took those of demo/vibration's first two joints from 9 and 3 % off to 59 and 79 %; hand
  double refitted_rotor = 0.005;
  /// m; a load's centre off the last link's frame; hand: tools are not longer. What these motions don't show of it, as
  /// along an axis that all joints have in common, would else go far off, and its second moment with it
  double load_centre = 0.5;
  /// kg; a load that is as good as none has that prior of its centre; hand
  double smallest_load = 1e-3;
  /// -; a share that is 1 by definition; theory: any value far below the data's own deviation holds it at 1
  double share = 1e-3;
};

/// Logs, before anything is fitted.
struct SessionOptions {
  /// rows a period of the torque cut-off; decimation; theory: Nyquist. Above it there is no noise, so that errors of
  /// the model would count there a hundred times as much
  double rows_per_period = 2.0;
  /// Hz; torque cut-off at most; hand: faster there is nothing that has a name, and many rows
  double highest_cutoff_hz = 40;
  /// s; a robot that rested longer begins a new session; hand: it has cooled
  double longest_pause_s = 1800;
  /// times the band of the motion; cut-off of the positions; hand, decision 0005
  double position_band = 12;
  /// Hz; cut-off of the positions at least; hand
  double lowest_position_hz = 2;
  /// samples a period of the torque's cut-off; what a faster log is thinned to; theory: what folds back is 1e-3
  double torque_samples = 16;
  /// samples a period of the positions' cut-off; .. and for those; theory: seven of them differentiate to 2e-3
  double position_samples = 8;
  /// Hz; .. and at least that; theory: the drive's tick of 2 ms, at which effects with memory have to hold
  double thinned_hz = 500;
  /// rows of all logs, times joints; what a diagnosis has room for. Longer recordings are looked at in windows; hand:
  /// 333 s of six joints at 25 rows a second; with 2 000 000 rows of a log half a gigabyte
  double most_rows = 50'000;
  /// s; of all logs together that stay, however many rows a second they have; hand: 160 s and as much of a baseline
  double least_kept_s = 320;
  /// share of its range in the logs; a joint that moves less in the windows would not be known: then none are cut; hand
  double least_in_windows = 0.1;
  /// s; length of such a window; hand: a few reversals of a slow motion
  double window_s = 20;
  /// s; before and after it, at least; what effects with memory were before the window fades; hand
  double run_in_s = 1;
  /// periods of the cut-off; dropped at both ends, where the filter swings; hand
  double edge_periods = 3;
  /// s; train logs or baseline at least, after filtering; hand
  double shortest_s = 2;
  /// s; a block of a single log at least; hand
  double shortest_block_s = 1;
  /// times the encoder's noise in the velocity; a joint whose largest velocity is less stands still; hand
  double still = 6;
  /// share of rated torque; white noise on the torque of a joint that stands still; hand: it counts next to nothing
  double mute_noise = 0.1;
  /// share of the torque's power; what no fit explains in two sessions of one robot; hand
  double other_robot = 0.2;
  /// times the noise's power; .. and at least that, where a joint carries little; hand
  double other_robot_noise = 4;
  /// share of the torque's power; what is the model's torque times a factor; hand
  double other_units = 0.9;
  /// -; such a factor, or one over it; hand: more than any load or change makes of all joints
  double other_units_factor = 3;
};

/// Search for effects. Scores are differences of -BIC, that is 2 ln of the Bayes factor (Schwarz 1978).
struct SearchOptions {
  /// score; what an effect must gain; theory: a Bayes factor of exp(4) = 55; the level by hand
  double least_score = 8;
  /// score; the most that is asked for; hand: a residual full of structure looks like more than noise at other times
  double most_score = 25;
  /// chance; noise passes the threshold of a joint, per level; theory: Gumbel's quantile; the level by hand
  double false_alarm = 1e-3;
  /// -; coefficient of an effect that is 1 by definition (delay, saturation); hand
  double least_share = 0.4, most_share = 2;
  /// encoder steps; over which friction with memory turns over, at least; hand: where it turns back is known to one
  double least_path = 3;
  /// standard deviations; a coefficient further below its bound is another effect; theory: Phi(-3) = 0.13 %
  double beyond_bound = 3;
  /// share of the threshold; candidates whose first score is less are not refined; hand: refining rarely doubles it
  double refine_from = 0.5;
  /// score; a swap's candidate may begin so far behind; hand
  double swap_behind = 20;
  /// score; a swap must gain; hand: so that swaps end
  double swap_gain = 1;
  /// share of the wavenumber; ripples that are nearer are the same; hand
  double same_ripple = 0.1;
  /// score; an alternative is at most so far behind; theory: a Bayes factor of exp(5) = 150; the level by hand
  double alternative = 10;
};

/// Structure in what a fit leaves.
struct LackOfFitOptions {
  /// chance; noise resembles a function of the state as much; hand: F's tail is used far beyond where it is exact
  double state = 1e-8;
  /// chance; .. so that an error of a law (GateOptions::law_error) is not one of the own motion alone; hand
  double suspected = 1e-6;
  /// chance; .. so that a free curve is tried at a joint without a name, and judged on data that did not fit it; hand:
  /// one of some 40 healthy joints
  double curve = 1e-5;
  /// chance; noise resembles something periodic or slow in time as much; hand
  double time = 1e-6;
  /// chance; lines that noise makes as seldom count as a share of the residual; hand
  double line = 0.01;
  /// chance; slow changes likewise; hand
  double slow_change = 1e-3;
  /// s; means over such stretches are compared for slow changes; hand
  double stretch_s = 2;
  /// share of the torque cut-off; lines are looked for below; theory: the filter's slope, 1 / (1 + 0.8^8) = 0.86
  double line_band = 0.8;
  /// share of the functions' rank; fewer free rows than that say nothing; hand
  double free_rows = 0.3;
};

/// What judges names on data that fitted no coefficient.
struct GateOptions {
  /// noise variances; what an effect must bring, and from where on a joint feels one on the robot; theory: chi^2 of one
  /// coefficient, 4.6 % of noise brings more
  double least_gain = 4;
  /// noise variances; theory: 4 deviations of one coefficient, 6e-5 of noise brings more. What brings that beside free
  /// curves of all other variables is believed whatever else is missing
  double sure_gain = 16;
  /// share of the gap at its joint; .. and that where the joint has structure left; hand, decision 0005: it is no noise
  double least_share_in_structure = 0.02;
  /// times the plain error before; a name may raise it so far; hand
  double worse = 1.02;
  /// times the plain error before, on train logs, where no others judge; what is worse is no fit of them; hand: names
  /// are fitted to whitened rows, which may cost some of the error in the whole band
  double worse_fitted = 1.1;
  /// share of the gap above the noise; what a name closes, and what the names of a joint with a sure name close
  /// together; hand: more than is left. Likewise of what a free curve of its variable closes in its place
  double least_closure = 0.5;
  /// share of the gap above the noise; .. where structure remains; hand: another effect may only resemble it. Likewise
  /// of what a free curve closes: several names in one variable, those that are believed whatever else is missing, and
  /// those that the curve is more likely than by 1000 to 1
  double sure_closure = 0.8;
  /// share of what a free curve closes; .. several names in the own position where the curve is more likely by 1000 to
  /// 1; hand: in the place of a stop or a square wave they closed 0.72 and 0.82, beside a small bump a true pair closes
  /// more
  double several_closure = 0.95;
  /// share of an effect's power; logs that fit show, else parts of each log judge; hand: a tenth of its amplitude, at
  /// which what the model lacks may hide it
  double least_shown = 0.01;
  /// share of the noise's power; structure that is more remains, however small a part of the gap it is; hand: 12 % more
  /// error than noise
  double beyond_noise = 0.25;
  /// share of the gap; a law of friction may leave in the own motion and load, as its form is never exact; hand
  double law_error = 0.02;
  /// share of the dry friction's power; .. and the smooth sign of the nominal model likewise; hand: 3 % of its torque
  double sign_error = 1e-3;
  /// standard deviations; coefficients of a name are off nothing by, or those of a healthy session off where they were;
  /// theory: 2 Phi(-2) = 4.6 % of noise is further off
  double sure_deviations = 2;
  /// log10 odds against nothing and against the closest rival; an effect is established; theory: 1000 to 1
  double established = 3;
  /// standard deviations; .. and its coefficients are off nothing by; theory: 2 Phi(-4) = 6e-5 of noise is further off
  double established_deviations = 4;
  /// log10 odds likewise; an effect is likely; theory: 20 to 1. So little apart, two effects are not told apart
  double likely = 1.3;
};

/// Free curves of what has no name.
struct CurveOptions {
  /// times the RMS of what is left; deviation of a curve's heights beforehand; theory: rows by the hundred outweigh it,
  /// and what they don't decide stays small
  double height = 1;
  /// share of the error's power on what judges; a curve takes away; hand: for less twelve numbers are too many
  double least_share = 0.1;
  /// s; a curve over time is judged by stretches of it that it did not fit; hand: noise that remembers half a second
  /// does not reach across
  double left_out_s = 2;
  /// s; from one of its knots to the next, at least; hand: half of that
  double finest_s = 1;
};

/// Impacts that are shorter than the torque's band shows.
struct ImpactOptions {
  /// standard deviations; an impact; theory: noise at 500 Hz does so once in 12 days, 2 Phi(-6) = 2e-9
  double beyond = 6;
  /// standard deviations of the velocity; within them friction may be anything; theory: 6e-5 of its noise is beyond
  double of_velocity = 4;
  /// s; samples that are nearer are one impact; hand
  double together_s = 0.02;
  /// times the healthy session's rate; structure; hand
  double times = 3;
  /// impacts; added to those of the healthy session; theory: with none seen there are below 3 at 95 % (Poisson)
  double added = 3;
};

/// What link encoders show.
struct DeflectionOptions {
  /// score; what an effect must gain; theory: a Bayes factor of exp(6) = 400; the level by hand
  double least_score = 12;
  /// share of the deflection's power on data that did not fit it; what a set of effects closes; hand
  double least_closure = 0.5;
  /// share of all parts' power; a smaller part is no finding; hand: errors of the torque show too
  double least_part = 0.05;
  /// share of the healthy session's size; a part that differs by less has not changed; hand
  double same = 0.33;
  /// times the noise's power; a deflection without a name that leaves the joint unexplained; hand
  double noted = 2;
  /// share of the load; uncertainty of the load in a direction that is not followed; hand
  double load_uncertainty = 1e-3;
  /// -; closure that the second fit, with what else was missing, may lose; hand
  double lost_closure = 0.01;
};

/// What is said beside the verdict: notes and regions.
struct ReportOptions {
  /// times the error before; on test logs, for a note; hand
  double risen = 1.05;
  /// times the error of the logs that judged; on test logs, for a note; hand
  double much_larger = 2;
  /// share of the rows; without a direction, for a note; hand
  double much_doubt = 0.1;
  /// -; sine between the first axis and gravity below which a robot stands upright; hand
  double upright = 1e-3;
  /// share of the gap less share of the samples; a region that is listed beside the first; hand
  double least_contrast = 0.15;
  /// chance; an error that has nothing to do with the motion makes as clear a region of any signal; theory: the
  /// clearest of 49 errors, each shifted in time against the motion (time: the same spectrum, stationary)
  double region_chance = 0.02;
  /// share of the evidence; by which another joint's position has to be clearer than the joint's own motion, which it
  /// follows on a planned motion; hand
  double other_joint = 0.1;
};

/// Faults of a recording, that compete with the robot's effects.
struct RecordingOptions {
  /// score; more than what the search found explains; theory: 2 ln of odds of 1000 to 1
  double least_score = 14;
  /// share of what any function of the state explains of today's logs; hand: as a name's
  double least_closure = 0.8;
  /// rad | m; shift of a joint's zero that is tried first; hand: any, the next ones are where the last one led
  double first_shift = 1e-2;
  /// rad | m; a shift that is worth a complaint; hand: less is an encoder's mounting
  double least_shift = 1e-3;
  /// samples; lag that two clocks gather over a log; theory: less is within the step of the samples
  double least_drift = 1;
  /// standard deviations; off nothing that a fault's parameter must be; theory: 2 Phi(-4) = 6e-5
  double deviations = 4;
};

struct Options {
  NoiseOptions noise;
  PriorOptions prior;
  SessionOptions session;
  SearchOptions search;
  LackOfFitOptions lack_of_fit;
  GateOptions gate;
  CurveOptions curve;
  ImpactOptions impact;
  DeflectionOptions deflection;
  ReportOptions report;
  RecordingOptions recording;
};

}  // namespace fxdyn::diagnosis

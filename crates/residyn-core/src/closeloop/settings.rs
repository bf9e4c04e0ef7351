//! Every tuning constant of closing the loop, with its reason and unit: one struct a stage, in the order of the stages.

use std::num::NonZeroUsize;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sim::FINE_FIT_S;

/// Declares a struct of settings, each default beside its reason.
macro_rules! settings {
    ($(#[$about:meta])* $name:ident {
        $($(#[$doc:meta])* $field:ident: $kind:ty = $default:expr,)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[non_exhaustive]
        pub struct $name {
            $(
                $(#[$doc])*
                #[doc = concat!("\n\nDefault: `", stringify!($default), "`")]
                pub $field: $kind,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}

impl ScoreSettings {
    /// The horizon (s) at which models are compared in one number.
    pub fn middle_s(&self) -> f64 {
        self.horizons_s[self.horizons_s.len() / 2]
    }
}

impl SelectSettings {
    /// Effects of one set at most, in a model of so many joints.
    pub(super) fn most_effects_of(&self, joints: usize) -> usize {
        self.most_effects.max(self.most_effects_per_joint * joints)
    }
}

/// How the loop is closed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Settings {
    pub split: SplitSettings,
    pub fit: FitSettings,
    pub select: SelectSettings,
    pub establish: EstablishSettings,
    pub remainder: RemainderSettings,
    pub curves: CurveSettings,
    pub proposal: ProposalSettings,
    pub notes: NoteSettings,
    pub discriminate: DiscriminateSettings,
    pub refine: RefineSettings,
    pub learn: LearnSettings,
    pub score: ScoreSettings,
    pub verdict: VerdictSettings,
    pub calibrate: CalibrateSettings,
}

settings! {
    /// Stage 1: which logs are set apart.
    SplitSettings {
        /// Share of the logs, or of each log, that is kept for the test.
        test_share: f64 = 0.25,
        /// From this many logs on, whole logs are kept for the test. Of fewer the end of each is, since a whole one would be too
        /// large a part of them.
        whole_logs_from: usize = 3,
        /// Time in s between what is learned from and what it is judged on, where both come from one log: longer than
        /// the memory of a drive.
        gap_s: f64 = 0.5,
        /// Shortest time in s that the end of a log is judged on: two windows of 0.5 s.
        shortest_test_s: f64 = 1.0,
        /// Largest share of a log that goes into the gap and the test together: a short log is to leave something to learn from.
        largest_share: f64 = 0.5,
    }
}

settings! {
    /// Stage 3: how models are fitted.
    FitSettings {
        /// Length in s of the windows of the first fit: even a poor start does not diverge in them.
        short_window_s: f64 = 0.15,
        /// Length in s of the windows over which models are fitted and compared: most effects show in them.
        window_s: f64 = 0.5,
        /// Windows on which the starting points of a candidate are compared, spread evenly over the logs.
        sample_windows: usize = 24,
        /// Share of a joint's top speed in the logs over which dry friction is smoothed: a joint that sticks creeps at
        /// most at such a speed, a milliradian in half a second on a lab rig. A share, so that the width means the
        /// same on a slow axis and on a fast arm.
        sign_width_share: f64 = 5e-4,
        /// Shares of a joint's top speed that are tried as wider smoothings of dry friction: with the usual friction where torques
        /// are compared, which are smoothed like the motion, and with the chosen effects where the motion is, since the friction of
        /// some rigs reverses over such widths.
        wider_sign_shares: [f64; 5] = [5e-4, 5e-3, 1e-2, 2e-2, 5e-2],
        /// Torques are compared, not the motion, where the share of the motion that stays unexplained is this many times that of the
        /// torques. Arms under stiff position control are at 34 and more, pendulums below 1.
        motion_over_torque: f64 = 10.0,
        /// Most joints of a model whose errors of the motion are looked at to choose between motion and torques; with more, a fit of
        /// the motion takes minutes before any search begins, and torques are compared.
        most_joints_by_motion: usize = 3,
        /// Share of the farthest way of a joint in a window (as squares) below which the joint is at rest there: shares of a way
        /// that is no way say nothing.
        at_rest_share: f64 = 1e-2,
        /// Starting values that are tried of a model that diverges with those in its file, before it is said that none works.
        most_starts: u32 = 512,
        /// Factor, up or down, by which the values of the last of these starts are off.
        farthest_start: f64 = 10.0,
        /// Fits from such starts of which the best counts: one alone may end in a local minimum.
        fitted_starts: usize = 3,
    }
}

settings! {
    /// Stage 4: which sets of effects are tried, and which one is chosen.
    SelectSettings {
        /// Most effects of one set in a model of few joints; `most_effects_per_joint` allows more in one of many.
        most_effects: usize = 12,
        /// Most effects of one set for each joint of the model, where that is more than `most_effects`.
        most_effects_per_joint: usize = 4,
        /// Most logs in which effects with a value for each log are looked for: the time for one set grows with the
        /// third power of its values.
        most_logs_of_own_values: usize = 64,
        /// Most steps of the beam search over predicted losses, each of which adds or drops one effect.
        beam_steps: usize = 12,
        /// Sets that lead from one step of the beam search to the next.
        beam_width: usize = 4,
        /// Sets of a round that are fitted, after all have been compared by predicted loss.
        fitted_sets: usize = 8,
        /// Sets of a round, the most promising first, that are fitted to the end; the others only while they may still do better than
        /// these.
        fitted_to_the_end: usize = 2,
        /// Most rounds of prediction and fits.
        most_rounds: usize = 8,
        /// Share by which a round must lower the loss on left-out stretches for another one to follow.
        round_gain: f64 = 0.02,
        /// Share of the loss on left-out stretches from which on a round that lowers it by so much is taken as it is. After a smaller
        /// gain exchanges are tried before anything is added.
        large_gain: f64 = 0.5,
        /// Share by which an exchange of one effect for another must lower the loss on left-out stretches: more than fits that end
        /// early err.
        exchange_gain: f64 = 0.003,
        /// Exchanges that leave a set as good with as many values, and are looked at for effects that they make needless.
        simplified_exchanges: usize = 4,
        /// Standard errors by which a set may raise the open-loop error on left-out stretches and still be chosen. One that raises it
        /// by more, and by more than `worse_share`, is not, however much it lowers the loss.
        worse_standard_errors: f64 = 1.0,
        /// Share of its square by which a set may raise the open-loop error on left-out stretches and still be chosen; see
        /// `worse_standard_errors`.
        worse_share: f64 = 0.02,
        /// Share by which the loss on left-out stretches may rise, whatever its standard error, where a simpler set takes the place
        /// of a richer one.
        negligible_rise: f64 = 0.01,
        /// Standard errors by which the loss on left-out stretches may rise, up to `simpler_rise`, where a simpler set takes the place
        /// of a richer one: stretches of a log are alike, so that twice as many are asked for as by the rule of one standard error
        /// (Breiman et al. 1984).
        simpler_standard_errors: f64 = 2.0,
        /// Share by which the loss on left-out stretches may rise at most where a simpler set takes the place of a richer one: what
        /// acts in a few fast stretches only has a large standard error. Effects that save less than this and are no more
        /// certain than `simpler_standard_errors` raised the error on logs of other motion more often than not.
        simpler_rise: f64 = 0.2,
        /// Fewest groups of stretches that are left out of a fit together. A group is a whole log; fewer logs than this are left out in
        /// parts.
        fewest_groups: usize = 8,
        /// Factor by which predicted losses may be wrong: what they exclude by more is not fitted.
        prediction_slack: f64 = 3.0,
        /// Candidates that are fitted in place of each established effect.
        rivals_per_effect: usize = 3,
        /// Standard errors by which the loss with a rival in place of an effect may be larger for it to explain the logs as well.
        rival_standard_errors: f64 = 2.0,
        /// Share of what an effect saves of the loss that a rival in its place must save to explain the logs as well.
        rival_saving: f64 = 0.8,
        /// Times the loss beside an effect that a rival in its place may leave and explain the logs as well, a seventh more in error:
        /// few stretches may fail to tell models apart of which one leaves plainly more.
        rival_loss: f64 = 1.3,
        /// Share of the information on an effect that must be its own beside the rest of the set, for the logs to tell the two apart.
        own_information: f64 = 1e-4,
        /// What is known of each value without the windows that are left out, as a share of the information of all: what they
        /// alone determine stays where it is.
        kept_information: f64 = 1e-2,
        /// Most numbers in the normal equations of all windows and candidates that are linearised at once: 2 GB. Of more candidates
        /// those that promise most alone are kept.
        most_numbers: usize = 1 << 28,
    }
}

settings! {
    /// Stage 4, second half: which of the selected effects are established.
    EstablishSettings {
        /// Probability of a false alarm for one effect, over all candidates and all their starting points.
        false_alarm: f64 = 0.05,
        /// Probability of a false alarm, without a correction for the number of candidates, at which an effect that plainly helps is
        /// established: few stretches cannot give as small a probability as `false_alarm` over all candidates.
        uncorrected_false_alarm: f64 = 0.01,
        /// Share by which an effect must lower the loss on left-out stretches, and thus the error by a twentieth: less
        /// is of no use, and on real rigs it is what a wrong effect saves by imitating others.
        worthwhile_gain: f64 = 0.1,
        /// Share of the loss on stretches that it was not fitted to from which on an effect plainly helps: chance does not take away
        /// so much.
        plain_gain: f64 = 0.5,
        /// Probability of a fall by chance up to which an effect is confirmed by the loss on the half of the stretches that its size
        /// was not fitted to.
        confirming_false_alarm: f64 = 0.1,
        /// Share of the loss from which on effects that leave it do not explain an unexplained remainder that stays either: they would
        /// mask the real cause, and none is established.
        masking_share: f64 = 0.5,
        /// Part of an unexplained remainder that an effect must take away to be established beside it: one that takes less may be a
        /// part of the real cause's shape.
        outweighed_share: f64 = 0.5,
        /// Share of what the bodies' departure from the declared ones costs that a load at the tip must take away to be established.
        payload_share: f64 = 0.5,
        /// Masses of the loads that fits of a load at the tip start from, in those of the last body: a fit from a light one may end
        /// where the bodies stand for the load.
        payload_masses: [f64; 4] = [0.5, 1.0, 2.0, 4.0],
    }
}

settings! {
    /// Stage 5: what counts as an unexplained remainder.
    RemainderSettings {
        /// Probability below which the remainder is significant.
        significance: f64 = 0.01,
        /// Share of the residuals' variance (or of the loss, for a probe) below which a remainder is of no practical
        /// interest.
        noteworthy_share: f64 = 0.05,
        /// Part of what is more than noise that a probe must save to locate the remainder.
        located_share: f64 = 0.25,
        /// Share of the declared model's residual variance above noise from which on a remainder matters that no probe locates, a
        /// tenth of its error: less is what the smoothing of dry friction leaves.
        unlocated_share: f64 = 0.01,
        /// Half periods up to which cosines over a window are slow: a force that a model lacks reaches the
        /// positions through two integrations, so that little of it is left in faster ones.
        slow_waves: usize = 6,
        /// Draws of the sensor's noise that the residuals are compared with.
        noise_draws: usize = 999,
        /// Draws of the sensors' noise where torques are compared: each smooths the logs once more.
        torque_noise_draws: usize = 299,
        /// Step in rad (or m), and in rad/s (or m/s), by which a start state is varied for its derivative: small against what a
        /// model's curvature shows, large against rounding.
        start_step: f64 = 1e-5,
        /// Length in s of the stretches of constant residual force: short against a swing, long enough that encoder
        /// noise of 1 mrad makes an error of 0.3 rad/s^2.
        stretch_s: f64 = 0.15,
    }
}

settings! {
    /// Stage 5: smooth curves of the residual force (Eilers and Marx 1996).
    CurveSettings {
        /// Points of a curve.
        points: usize = 40,
        /// Quantiles of a variable's values between which a curve covers it: beyond them samples are too few.
        quantiles: [f64; 2] = [0.01, 0.99],
        /// Fewest stretches of two seconds that give a confidence band.
        fewest_stretches: usize = 5,
        /// Parts in which the stretches are left out to choose the smoothness.
        folds: usize = 8,
        /// Smoothness that is tried: the penalty per sample, as powers of ten.
        penalty_exponents: [i32; 9] = [-6, -5, -4, -3, -2, -1, 0, 1, 2],
        /// Rounds over the variables; the choice settles in two.
        rounds: usize = 2,
        /// Scales from the curves beyond which forces weigh less (Huber 1964).
        huber_scales: f64 = 3.0,
    }
}

settings! {
    /// Stage 5: a formula for the remainder.
    ProposalSettings {
        /// Most terms of a formula: longer ones explain everything.
        most_terms: usize = 3,
        /// Terms that are fitted after all have been screened.
        fitted_terms: usize = 4,
    }
}

settings! {
    /// What fitted models say of the logs that audits alone do not see.
    NoteSettings {
        /// Share of its loss that the model leaves with all torques reversed at which they are said to be reversed: half the error.
        reversed_loss: f64 = 0.25,
        /// Share of the declared gravity in the logged torques below which, or above whose inverse, gravity is contradicted: bodies from
        /// a drawing are off by a third, a torque without gravity by all.
        least_gravity: f64 = 0.5,
        /// Share of a joint's torque by which its gravity must vary, both as standard deviations, for the joint to tell of gravity.
        gravity_spread: f64 = 0.3,
        /// Standard deviations of the others beyond which a residual force counts as a push.
        push_deviations: f64 = 8.0,
        /// Share of the joint's largest torque from which on a residual force counts as a push: less is what the smoothing of friction
        /// leaves of a clean log.
        push_torque: f64 = 0.1,
        /// Standard deviations of the others beyond which stretches next to the strongest one belong to a push.
        push_edge_deviations: f64 = 4.0,
        /// Fewest stretches of a push: an end stop or a joint that sticks is over in one.
        push_stretches: usize = 2,
    }
}

settings! {
    /// Stage 6: which experiments are simulated, and when one of them suffices.
    DiscriminateSettings {
        /// Alternatives, the best ones, against which experiments are simulated: each costs as much as a few fits.
        alternatives: usize = 3,
        /// Twice the loss by which the true model must lead for the other to fall behind by two standard errors with a
        /// probability of 95 %: the lead has the mean of half and the standard deviation of the root of this number.
        lead: f64 = 4.0 * (2.0 + 1.645) * (2.0 + 1.645),
        /// Times the top speed of the logs beyond which motion is not what the rig was built for.
        top_speeds: f64 = 5.0,
        /// Windows that stand for the present logs.
        present_windows: usize = 40,
        /// Position in rad (or m) than which none is measured more finely.
        finest_position: f64 = 1e-6,
        /// Scale of the residuals in refits: so large that the robust loss is plain least squares.
        refit_scale: f64 = 100.0,
        /// Step in s below which logs are taken to be sampled as fast as the encoder can be read.
        fastest_sampling_s: f64 = 4e-3,
        /// Length in s of a motion: long enough for another torque to show, short enough that no controller is missed.
        motion_s: f64 = 2.0,
        /// Period of the torque ramps in s.
        ramp_period_s: f64 = 8.0,
        /// Motions of one experiment.
        motions: usize = 10,
        /// Time in s for which the rig stands between the motions of one log, under the torque that the next begins with: longer than
        /// any memory of its drive.
        pause_s: f64 = 2.0,
        /// Most rows of a motion: logs may be denser than any motion needs.
        most_rows: f64 = 1e5,
        /// Share of a parameter that a known payload adds to it.
        payload_share: f64 = 0.5,
        /// Length in s below which experiments are equally short.
        equally_short_s: f64 = 10.0,
        /// Longest time in s that anybody records to tell two explanations apart.
        longest_s: f64 = 600.0,
        /// Share of the noise below which a difference is less than what every model gets wrong.
        visible_share: f64 = 0.1,
    }
}

settings! {
    /// Stage 7: the final estimate. Smoothing and steps shift dry friction by a few parts in a thousand, more than the
    /// noise of long logs does.
    RefineSettings {
        /// Longest step of the integrator in s: half a millisecond.
        step_s: f64 = FINE_FIT_S,
        /// Share of the width that effects were selected with over which dry friction is smoothed, unless the model
        /// file gives the width.
        sign_width_factor: f64 = 0.5,
    }
}

settings! {
    /// Stage 8: how the residual network is trained.
    LearnSettings {
        /// Time in s within which rows are averaged: the network is to learn a force, not the encoder's noise.
        step_s: f64 = 0.01,
        /// Steps that a segment unrolls.
        steps: usize = 8,
        /// Segments, about, that are enough for a network of some hundred weights.
        segments: usize = 1200,
        /// Length in s of the stretches that are trained on or kept to choose the epoch.
        stretch_s: f64 = 2.0,
        /// Parts of the logs that are left out in turn to see whether a network helps at all.
        check_parts: usize = 3,
        /// Ratio of the errors with and without a network, on all left-out parts together, up to which the network is used.
        helpful_ratio: f64 = 0.95,
        /// Ratio of the errors with and without a network, on any left-out part, above which no network is used.
        harmful_ratio: f64 = 1.02,
        /// Stretches of which one is kept to choose the epoch.
        validation_every: usize = 5,
        /// Passes over all segments.
        epochs: usize = 250,
        /// Step size of Adam (Kingma and Ba 2015).
        learning_rate: f64 = 0.003,
        /// Penalty on the network's output: it takes over only what pays for it.
        alpha: f64 = 1e-3,
        /// Epochs from one entry of the training's history to the next.
        record_every: NonZeroUsize = const { NonZeroUsize::new(10).unwrap() },
    }
}

settings! {
    /// Stage 9: how models are scored.
    ScoreSettings {
        /// Horizons of the reported errors in s; models are compared in one number at the middle one. Those that are
        /// longer than any test log are left out.
        horizons_s: Vec<f64> = vec![0.1, 0.5, 1.0],
        /// Time in s, from the beginning of a test log, on which its sensors' zeros are estimated where they differ from log to log:
        /// what a user gets who zeroes the rig before a run.
        zeroed_on_s: f64 = 1.0,
        /// Test logs from which on whole ones are resampled for intervals; of fewer, stretches of two seconds are.
        whole_logs_from: usize = 5,
        /// Fewest logs or stretches that give an interval.
        fewest_blocks: usize = 3,
        /// Most training logs to each of which the chosen model is fitted alone: the time grows with them.
        most_logs_fitted_alone: usize = 32,
        /// Most training logs on each of which the fits to the others are scored: the table grows with their square.
        most_logs_crossed: usize = 8,
    }
}

settings! {
    /// When the logs allow a verdict.
    VerdictSettings {
        /// Fewest windows that allow a conclusion.
        fewest_windows: usize = 8,
        /// Factor by which effects may raise the error on the test logs and still be trusted: noise in the
        /// windows' start states raises it by less.
        trusted_rise: f64 = 1.05,
    }
}

settings! {
    /// Stage 10: what the logs can show.
    CalibrateSettings {
        /// Standard normal quantile of the share of logs in which an effect of the smallest size is to be named: 80 %.
        power_quantile: f64 = 0.841_6,
        /// Share of the information on an effect that must be its own for the logs to tell it from the rest of the model.
        own_information: f64 = 1e-6,
        /// Times its smallest size at which an effect is hidden.
        hidden_multiple: f64 = 1.5,
        /// Pause between the windows of simulated logs, in half widths of a start state's estimate, each of four median
        /// steps or more: windows end at pauses of five.
        pause_half_widths: f64 = 1.5,
    }
}

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
        self.most_effects.max(self.most_of_joint * joints)
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
        /// With this many logs whole ones are kept for the test: with fewer, one would be too large a part of them.
        whole_logs: usize = 3,
        /// Time in s between what is learned from and what it is judged on, where both come from one log: longer than
        /// the memory of a drive.
        gap_s: f64 = 0.5,
        /// Time in s that is judged on at least: two windows of 0.5 s.
        shortest_s: f64 = 1.0,
        /// No more than this share of a log goes into the gap and the test.
        most: f64 = 0.5,
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
        /// Dry friction is smoothed over this share of a joint's top speed in the logs: a joint that sticks creeps at
        /// most at such a speed, a milliradian in half a second on a lab rig. A share, so that the width means the
        /// same on a slow axis and on a fast arm.
        sign_width: f64 = 5e-4,
        /// Torques are compared where so many times more of the motion than of them is left unexplained.
        prescribed: f64 = 10.0,
        /// Wider ones that are tried: by the usual friction where torques are compared, which are smoothed like the motion, and by
        /// the chosen effects where the motion is.
        sign_widths: [f64; 5] = [5e-4, 5e-3, 1e-2, 2e-2, 5e-2],
    }
}

settings! {
    /// Stage 4: which sets of effects are tried, and which one is chosen.
    SelectSettings {
        /// Effects of one set at most,
        most_effects: usize = 12,
        /// or so many for each joint, where that is more.
        most_of_joint: usize = 4,
        /// Effects with a value for each log are looked for in so many logs at most: the time for one set grows with the
        /// third power of its values.
        most_by_log: usize = 64,
        /// Steps of the search over predicted losses, each of which adds or drops one effect.
        depth: usize = 12,
        /// Sets that lead from one of these steps to the next.
        beam: usize = 4,
        /// Sets that are fitted after all have been compared by predicted loss.
        fitted: usize = 8,
        /// The first of them are fitted to the end; the others only while they may still do better than these.
        first: usize = 2,
        /// Rounds of prediction and fits.
        rounds: usize = 8,
        /// A round must lower the loss on left-out stretches by this share for another one to follow.
        step: f64 = 0.02,
        /// One that lowers it by this share is taken as it is; otherwise exchanges are tried before anything is added.
        large: f64 = 0.5,
        /// An exchange of one effect for another must lower it by this share: more than fits that end early err.
        exchange: f64 = 0.003,
        /// Of those after which a set is as good with as many values, so many are looked at for others that they make needless.
        exchanged: usize = 4,
        /// A set is not chosen, however much it lowers the loss, that raises the open-loop error on left-out stretches by
        /// more than so many standard errors
        worse_by: f64 = 1.0,
        /// and by more than this share of its square.
        worse: f64 = 0.02,
        /// A simpler set takes the place of a richer one where the loss on left-out stretches rises by less than this
        /// share,
        negligible: f64 = 0.01,
        /// or by less than so many standard errors: stretches of a log are alike, so that twice as many are asked for as by
        /// the rule of one standard error (Breiman et al. 1984),
        simplest: f64 = 2.0,
        /// and this share: what acts in a few fast stretches only has a large standard error. Effects that save less than
        /// this and are no more certain than this raised the error on logs of other motion more often than not.
        simpler: f64 = 0.2,
        /// A whole log is left out at a time; fewer logs than this are left out in parts, at least so many altogether.
        fewest_groups: usize = 8,
        /// Predicted losses may be wrong by this factor: what they exclude by more is not fitted.
        slack: f64 = 3.0,
        /// Candidates that are fitted in place of each established effect.
        rivals: usize = 3,
        /// Those within this many standard errors of the chosen one explain the logs as well as it does,
        as_good: f64 = 2.0,
        /// if they also save this share of what it saves,
        as_much: f64 = 0.8,
        /// and leave at most this many times the loss that it leaves, a seventh more in error: few stretches may fail
        /// to tell models apart of which one leaves plainly more.
        as_little: f64 = 1.3,
    }
}

settings! {
    /// Stage 4, second half: which of the selected effects are established.
    EstablishSettings {
        /// Probability of a false alarm for one effect, over all candidates and all their starting points.
        false_alarm: f64 = 0.05,
        /// A load at the tip is established if it takes away this share of what the bodies' departure from the declared ones costs.
        of_departure: f64 = 0.5,
        /// Few stretches cannot give so small a probability. With them an effect that plainly helps is established at
        /// this level, without a correction for the number of candidates.
        significant_alone: f64 = 0.01,
        /// An effect must lower the loss on left-out stretches by this share, and thus the error by a twentieth: less
        /// is of no use, and on real rigs it is what a wrong effect saves by imitating others.
        worthwhile: f64 = 0.1,
        /// An effect plainly helps that takes away this share of the loss on stretches that it was not fitted to:
        /// chance does not do that.
        plain: f64 = 0.5,
        /// An effect is confirmed that lowers the loss on the half of the stretches that its size was not fitted to with
        /// at most this probability of doing so by chance.
        confirmed: f64 = 0.1,
        /// Where an unexplained remainder stays, effects that leave more than this share of the loss do not explain
        /// it either: they would mask the real cause, and none is established.
        masking: f64 = 0.5,
        /// Where an unexplained remainder stays, an effect that takes away less than this part of it is not established: it
        /// may be a part of the real cause's shape.
        outweighed: f64 = 0.5,
    }
}

settings! {
    /// Stage 5: what counts as an unexplained remainder.
    RemainderSettings {
        /// Below this probability the remainder is significant.
        significance: f64 = 0.01,
        /// Share of the residuals' variance (or of the loss, for a probe) below which a remainder is of no practical
        /// interest.
        noteworthy: f64 = 0.05,
        /// A probe locates the remainder if it saves this part of what is more than noise.
        located: f64 = 0.25,
        /// A remainder that no probe locates matters from this share of the declared model's residual variance above
        /// noise on, a tenth of its error: less is what the smoothing of dry friction leaves.
        unlocated: f64 = 0.01,
        /// Cosines over a window with up to this many half periods are slow: a force that a model lacks reaches the
        /// positions through two integrations, so that little of it is left in faster ones.
        slow_waves: usize = 6,
        /// Draws of the sensor's noise that the residuals are compared with.
        noise_draws: usize = 999,
        /// The same where torques are compared, each of which smooths the logs once more.
        torque_draws: usize = 299,
        /// A start state is varied by this many rad (or m) and rad/s (or m/s) for its derivative: small against what a
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
        /// A curve covers a variable's values between these quantiles: beyond them samples are too few.
        quantiles: [f64; 2] = [0.01, 0.99],
        /// Fewer stretches of two seconds than this give no confidence band.
        fewest_stretches: usize = 5,
        /// Parts in which the stretches are left out to choose the smoothness.
        folds: usize = 8,
        /// Smoothness that is tried: the penalty per sample, as powers of ten.
        penalties: [i32; 9] = [-6, -5, -4, -3, -2, -1, 0, 1, 2],
        /// Rounds over the variables; the choice settles in two.
        rounds: usize = 2,
        /// Forces farther from the curves than this many scales weigh less (Huber 1964).
        huber: f64 = 3.0,
    }
}

settings! {
    /// Stage 5: a formula for the remainder.
    ProposalSettings {
        /// Terms of a formula at most: longer ones explain everything.
        most_terms: usize = 3,
        /// Terms that are fitted after all have been screened.
        fitted: usize = 4,
    }
}

settings! {
    /// Stage 6: which experiments are simulated, and when one of them suffices.
    DiscriminateSettings {
        /// Experiments are simulated for this many alternatives, the best ones: each costs as much as a few fits.
        alternatives: usize = 3,
        /// Twice the loss by which the true model must lead for the other to fall behind by two standard errors with a
        /// probability of 95 %: the lead has the mean of half and the standard deviation of the root of this number.
        lead: f64 = 4.0 * (2.0 + 1.645) * (2.0 + 1.645),
        /// Motion faster than this many times the top speed of the logs is not what the rig was built for.
        fastest: f64 = 5.0,
        /// Windows that stand for the present logs.
        present_windows: usize = 40,
        /// Finer than this (rad or m) no position is measured.
        finest: f64 = 1e-6,
        /// Scale of the residuals in refits: so large that the robust loss is plain least squares.
        scale: f64 = 100.0,
        /// Logs with a shorter step than this (s) are taken to be sampled as fast as the encoder can be read.
        fastest_sampling_s: f64 = 4e-3,
        /// Length in s of a motion: long enough for another torque to show, short enough that no controller is missed.
        motion_s: f64 = 2.0,
        /// Period of the torque ramps in s.
        ramps_s: f64 = 8.0,
        /// Motions of one experiment.
        motions: usize = 10,
        /// Share of a parameter that a known payload adds to it.
        payload: f64 = 0.5,
        /// Experiments of less than this (s) are equally short.
        short_s: f64 = 10.0,
        /// Nobody records for longer than this (s) to tell two explanations apart.
        long_s: f64 = 600.0,
        /// A difference below this share of the noise is less than what every model gets wrong.
        visible: f64 = 0.1,
    }
}

settings! {
    /// Stage 7: the final estimate. Smoothing and steps shift dry friction by a few parts in a thousand, more than the
    /// noise of long logs does.
    RefineSettings {
        /// Longest step of the integrator in s: half a millisecond.
        step_s: f64 = FINE_FIT_S,
        /// Dry friction is smoothed over this share of the width that effects were selected with, unless the model
        /// file gives the width.
        narrower: f64 = 0.5,
    }
}

settings! {
    /// Stage 8: how the residual network is trained.
    LearnSettings {
        /// Rows nearer than this (s) are averaged: the network is to learn a force, not the encoder's noise.
        step_s: f64 = 0.01,
        /// Steps that a segment unrolls.
        steps: usize = 8,
        /// About this many segments are enough for a network of some hundred weights.
        segments: usize = 1200,
        /// Length in s of the stretches that are trained on or kept to choose the epoch.
        stretch_s: f64 = 2.0,
        /// Parts of the logs that are left out in turn to see whether a network helps at all:
        parts: usize = 3,
        /// it is used if it lowers the error on all of them together to this share or less,
        helpful: f64 = 0.95,
        /// and raises it on none of them to more than this share.
        harmful: f64 = 1.02,
        /// One stretch of this many is kept to choose the epoch.
        every: usize = 5,
        epochs: usize = 250,
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
        /// Where zeros of the sensors differ from log to log, those of each test log are estimated on its first seconds, as
        /// many as this: what a user gets who zeroes the rig before a run.
        zeroed_on_s: f64 = 1.0,
        /// With this many test logs whole ones are resampled; with fewer, stretches of two seconds.
        whole_logs: usize = 5,
        /// Fewer logs or stretches than this give no interval.
        fewest: usize = 3,
    }
}

settings! {
    /// When the logs allow a verdict.
    VerdictSettings {
        /// Fewer windows than this allow no conclusion.
        fewest_windows: usize = 8,
        /// Effects that raise the error on the test logs by more than this factor are not to be trusted: noise in the
        /// windows' start states raises it by less.
        worse: f64 = 1.05,
    }
}

settings! {
    /// Stage 10: what the logs can show.
    CalibrateSettings {
        /// Standard normal quantile of the share of logs in which an effect of the smallest size is to be named: 80 %.
        power: f64 = 0.841_6,
        /// An effect of which less than this share of the information is its own is not told from the rest of the
        /// model.
        own_information: f64 = 1e-6,
        /// Effects are hidden at this multiple of their smallest size.
        hidden: f64 = 1.5,
        /// Pause between the windows of simulated logs, in half widths of a start state's estimate, each of four median
        /// steps or more: windows end at pauses of five.
        pause: f64 = 1.5,
    }
}

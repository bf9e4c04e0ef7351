//! All tuning constants of closing the loop, with reasons and units: one struct per stage, in the order of the stages.

use std::num::NonZeroUsize;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sim::FINE_FIT_S;

/// Declares structs of settings, each default next to its reason.
macro_rules! settings {
    ($($(#[$about:meta])* $name:ident {
        $($(#[$doc:meta])* $field:ident: $kind:ty = $default:expr,)*
    })*) => {$(
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
    )*};
}

impl ScoreSettings {
    /// The horizon (s) at which models are compared in one number.
    pub fn middle_s(&self) -> f64 {
        self.horizons_s[self.horizons_s.len() / 2]
    }
}

impl Settings {
    /// The same settings with errors at these horizons (s), and fits over windows of the middle one.
    #[must_use]
    pub fn with_horizons(mut self, mut horizons_s: Vec<f64>) -> Self {
        horizons_s.sort_by(f64::total_cmp);
        self.score.horizons_s = horizons_s;
        self.fit.window_s = self.score.middle_s();
        self
    }
}

impl SelectSettings {
    /// The largest number of effects in one set, in a model with this many joints.
    pub(super) fn most_effects_of(&self, joints: usize) -> usize {
        self.most_effects.max(self.most_effects_per_joint * joints)
    }
}

/// These settings say how the loop is closed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Settings {
    pub split: SplitSettings,
    pub fit: FitSettings,
    pub select: SelectSettings,
    pub establish: EstablishSettings,
    pub diagnostics: DiagnosticsSettings,
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
    /// Stage 1 sets the test logs apart.
    SplitSettings {
        /// This share of the logs, or of each log, is kept for the test.
        test_share: f64 = 0.25,
        /// With at least this many logs, whole logs are kept for the test. With fewer, the end of each log is kept,
        /// since a whole log would be too large a part of the data.
        whole_logs_from: usize = 3,
        /// Training and test data that come from one log are separated by this time in s: longer than the memory of a
        /// drive.
        gap_s: f64 = 0.5,
        /// The test at the end of a log lasts at least this time in s: two windows of 0.5 s.
        shortest_test_s: f64 = 1.0,
        /// The gap and the test together take at most this share of a log: a short log must leave something to learn
        /// from.
        largest_share: f64 = 0.5,
    }

    /// Stage 3 fits the models.
    FitSettings {
        /// The windows of the first fit have this length in s: even a poor start does not diverge in them.
        short_window_s: f64 = 0.15,
        /// Models are fitted and compared over windows of this length in s: most effects show in them.
        window_s: f64 = 0.5,
        /// The free motion of a joint that nothing drives is compared over windows of this many swings, as far as the
        /// logs hold enough of them: light damping takes several swings to show.
        swings: f64 = 3.0,
        /// The starting points of a candidate are compared on this many windows, spread evenly over the logs.
        sample_windows: usize = 24,
        /// Dry friction is smoothed over this share of a joint's top speed in the logs: a sticking joint creeps at most
        /// at this speed, a milliradian in half a second on a lab rig. As a share, the width means the same on a slow
        /// axis and on a fast arm.
        smoothing_velocity_share: f64 = 5e-4,
        /// If dry friction brings a joint to rest faster than the usual steps of the integrator can follow, they are
        /// made shorter, down to this in s: a fifth of the steps of the final estimate. In steps that are too long a
        /// joint at rest chatters.
        shortest_step_s: f64 = 1e-4,
        /// These shares of a joint's top speed are tried as wider smoothing velocities of dry friction: with the
        /// baseline friction if torques are compared, which are smoothed like the motion, and with the chosen effects
        /// if the motion is, since friction on some rigs reverses over such widths.
        wider_sign_shares: [f64; 5] = [5e-4, 5e-3, 1e-2, 2e-2, 5e-2],
        /// Torques are compared instead of the motion if the unexplained share of the motion is at least this many
        /// times that of the torques. Arms under stiff position control are at 34 and more, pendulums below 1.
        motion_over_torque: f64 = 10.0,
        /// If a motion is imposed on the rig, it explains the torques: the declared model with the usual forces leaves
        /// less than this share of their standard deviation, a tenth of their variance.
        imposed_torque_share: f64 = 0.316,
        /// A motion is imposed if accelerating the declared model takes less than this share of the torques: an inertia a
        /// tenth of the true one would still take more on a rig that its torques move.
        imposed_inertia: f64 = 0.02,
        /// A motion is imposed if the torques leave, of its distance from a uniform motion, more than this many times
        /// the share that it leaves of the torques. On a rig moved by its torques they leave a tenth of that.
        imposed_motion: f64 = 2.0,
        /// Up to this many joints, the errors of the motion are examined to choose between motion and torques; with
        /// more joints, a fit of the motion takes minutes before any search begins, and torques are compared.
        most_joints_by_motion: usize = 3,
        /// Torques are taken as a sensor's readings or as means, unless the model file says what they are, if the model
        /// with the usual friction leaves less than this share of what it leaves if they are held. The wrong one of the
        /// three leaves several times as much where it matters.
        other_torque_share: f64 = 0.9,
        /// A joint is at rest in a window if it moves less than this share of its farthest travel in any window (as
        /// squares): errors relative to no travel are meaningless.
        at_rest_share: f64 = 1e-2,
        /// If a model diverges with the starting values in its file, up to this many others are tried before it is
        /// reported that none works.
        most_starts: u32 = 512,
        /// The last starting values that are tried for a diverging model are off by up to this factor, up or down.
        farthest_start: f64 = 10.0,
        /// A model that diverges with the starting values in its file is fitted from this many others, and the best fit
        /// is kept: a single fit may end in a local minimum.
        fitted_starts: usize = 3,
    }

    /// Stage 4 tries sets of effects and chooses one.
    SelectSettings {
        /// A set has at most this many effects in a model of few joints; `most_effects_per_joint` allows more in a
        /// model of many.
        most_effects: usize = 12,
        /// A set has at most this many effects per joint of the model, if that is more than `most_effects`.
        most_effects_per_joint: usize = 6,
        /// A plainer model takes the place of the chosen one if its error on whole logs that the fit has not seen is lower
        /// by this share: less is chance.
        plainer_gain: f64 = 0.02,
        /// Effects with a value for each log are considered for at most this many logs: the time for one set grows with
        /// the cube of the number of its values.
        most_logs_of_own_values: usize = 64,
        /// The beam search over predicted losses takes at most this many steps, each of which adds or drops one effect.
        beam_steps: usize = 12,
        /// Each step of the beam search passes this many sets on to the next.
        beam_width: usize = 4,
        /// In each round, this many sets are fitted after all have been compared by predicted loss.
        fitted_sets: usize = 8,
        /// In each round, this many sets, the most promising first, are fitted to the end; the others only while they
        /// may still do better than these.
        fitted_to_the_end: usize = 2,
        /// The search takes at most this many rounds of prediction and fits.
        most_rounds: usize = 8,
        /// If more than this share of the declared model's residual variance above noise remains, fits may have ended in a
        /// false minimum: another search begins over short windows, from the declared values.
        false_minimum_share: f64 = 0.05,
        /// A round must lower the loss on left-out blocks by this share for another round to follow.
        round_gain: f64 = 0.02,
        /// A transmission is fitted to all windows if fits to a sample of them lower its cost by this share: half of what a
        /// round must bring, since a sample differs from the whole.
        sampled_gain: f64 = 0.01,
        /// A round that lowers the loss on left-out blocks by this share is taken as it is. After a smaller gain,
        /// exchanges are tried before anything is added.
        large_gain: f64 = 0.5,
        /// An exchange of one effect for another must lower the loss on left-out blocks by this share: more than the
        /// error of fits that end early.
        exchange_gain: f64 = 0.003,
        /// Of the exchanges that leave a set as good with as many values, this many are checked for effects that they
        /// make redundant.
        simplified_exchanges: usize = 4,
        /// A set that raises the open-loop error on left-out blocks by more than this many standard errors, and by more
        /// than `worse_share`, is not chosen, however much it lowers the loss.
        worse_standard_errors: f64 = 1.0,
        /// A set that raises the squared open-loop error on left-out blocks by more than this share, and by more than
        /// `worse_standard_errors`, is not chosen.
        worse_share: f64 = 0.02,
        /// When a simpler set replaces a richer one, the loss on left-out blocks may rise by this share, whatever its
        /// standard error.
        negligible_rise: f64 = 0.01,
        /// When a simpler set replaces a richer one, the loss on left-out blocks may rise by this many standard errors,
        /// up to `simpler_rise`: blocks of a log are alike, so this is twice what the one-standard-error rule asks
        /// (Breiman et al. 1984).
        simpler_standard_errors: f64 = 2.0,
        /// When a simpler set replaces a richer one, the loss on left-out blocks may rise by at most this share:
        /// effects that act only in a few fast blocks have a large standard error. Effects that save less than this and
        /// are no more certain than `simpler_standard_errors` raised the error on logs of other motion more often than
        /// not.
        simpler_rise: f64 = 0.2,
        /// Blocks are left out of a fit in at least this many groups. A group is a whole log; fewer logs than this are
        /// left out in parts.
        fewest_groups: usize = 8,
        /// Predicted losses may be wrong by this factor: sets that they rule out by more are not fitted.
        prediction_slack: f64 = 3.0,
        /// This many candidates are fitted in place of each established effect.
        rivals_per_effect: usize = 3,
        /// A rival that replaces an effect explains the logs as well only if the loss rises by at most this many
        /// standard errors.
        rival_standard_errors: f64 = 2.0,
        /// A rival that replaces an effect explains the logs as well only if it saves more than this share of the loss
        /// that the effect saves.
        rival_saving: f64 = 0.8,
        /// A rival that replaces an effect explains the logs as well only if it leaves at most this many times the
        /// loss, a seventh more in error: few blocks may fail to distinguish models even if one leaves plainly more.
        rival_loss: f64 = 1.3,
        /// For the logs to distinguish an effect from the rest of a set, at least this share of the information on it
        /// must be independent of the rest.
        own_information: f64 = 1e-4,
        /// Of each value, this share of the information is taken to be known without the windows that are left out:
        /// values that these windows alone determine stay where they are.
        kept_information: f64 = 1e-2,
        /// The normal equations of all windows and candidates that are linearised at once hold at most this many
        /// numbers: 2 GB. If there are more candidates, those with the largest predicted gain alone are kept.
        most_numbers: usize = 1 << 28,
    }

    /// The second half of stage 4 decides which of the selected effects are established.
    EstablishSettings {
        /// The probability of a false alarm for one effect is at most this, over all candidates and all their starting
        /// points.
        false_alarm: f64 = 0.05,
        /// An effect that plainly helps is established at this probability of a false alarm, without a correction for
        /// the number of candidates: few blocks cannot give as small a probability as `false_alarm` over all
        /// candidates.
        uncorrected_false_alarm: f64 = 0.01,
        /// An effect must lower the loss on left-out blocks by this share, and thus the error by a twentieth: less is
        /// of no use, and on real rigs it is what a wrong effect saves by imitating others.
        worthwhile_gain: f64 = 0.1,
        /// An effect plainly helps if it lowers the loss on blocks that it was not fitted to by this share: chance does
        /// not remove that much.
        plain_gain: f64 = 0.5,
        /// An effect is confirmed if the fall of the loss on the half of the blocks that its size was not fitted to has
        /// at most this probability by chance.
        confirming_false_alarm: f64 = 0.1,
        /// An effect is not established if it raises the open-loop error of a log set apart by more than this many
        /// standard errors over the log's windows: with a few logs and effects, one raises it by one by chance.
        worse_standard_errors: f64 = 2.0,
        /// If the effects leave more than this share of the loss and an unexplained residual stays, none is
        /// established: they would mask the real cause.
        masking_share: f64 = 0.5,
        /// To be established despite an unexplained residual, an effect must remove at least this share of the
        /// residual's size: an effect that removes less may be a part of the real cause's shape.
        outweighed_share: f64 = 0.5,
        /// To be established, a load at the tip must remove more than this share of the prior cost of the bodies'
        /// departure from the declared ones.
        payload_share: f64 = 0.5,
        /// Fits of a load at the tip start from these masses, in multiples of the last body's mass: a fit from a light
        /// load may end where the bodies stand for the load.
        payload_masses: [f64; 4] = [0.5, 1.0, 2.0, 4.0],
    }

    /// Stage 5 decides what counts as an unexplained residual.
    DiagnosticsSettings {
        /// The unexplained residual is significant below this probability.
        significance: f64 = 0.01,
        /// An unexplained residual below this share of the residuals' variance (or of the loss, for a probe) is of no
        /// practical interest.
        noteworthy_share: f64 = 0.05,
        /// To locate the unexplained residual, a probe must save this share of what is more than noise.
        located_share: f64 = 0.25,
        /// An unexplained residual that no probe locates matters only above this share of the declared model's residual
        /// variance above noise, a tenth of its error: the smoothing of dry friction leaves less.
        unlocated_share: f64 = 0.01,
        /// Cosines over a window are slow up to this many half periods: a force that a model lacks reaches the
        /// positions through two integrations, so that little of it is left in faster ones.
        slow_waves: usize = 6,
        /// The residuals are compared with this many draws of the sensors' noise.
        noise_draws: usize = 999,
        /// If torques are compared, this many draws of the sensors' noise are made: each smooths the logs once more.
        torque_noise_draws: usize = 299,
        /// A start state is varied by this step, in rad (or m) and in rad/s (or m/s), for its derivative: small enough
        /// that a model's curvature does not show, large relative to rounding.
        start_step: f64 = 1e-5,
        /// The residual force is constant over blocks of this length in s: short relative to a swing, long enough that
        /// encoder noise of 1 mrad makes an error of 0.3 rad/s^2.
        block_s: f64 = 0.15,
    }

    /// Stage 5 fits smooth curves to the residual force (Eilers and Marx 1996).
    CurveSettings {
        /// A curve has this many points.
        points: usize = 40,
        /// A curve covers a variable between these quantiles of the variable's values: beyond them samples are too few.
        quantiles: [f64; 2] = [0.01, 0.99],
        /// A confidence band needs at least this many blocks of two seconds.
        fewest_blocks: usize = 5,
        /// To choose the smoothness, the blocks are left out in this many parts.
        folds: usize = 8,
        /// These smoothness penalties per sample are tried, as powers of ten.
        penalty_exponents: [i32; 9] = [-6, -5, -4, -3, -2, -1, 0, 1, 2],
        /// The choice of smoothness goes over the variables this many times; it settles in two.
        rounds: usize = 2,
        /// Forces more than this many scales away from the curves weigh less (Huber 1964).
        huber_scales: f64 = 3.0,
    }

    /// Stage 5 proposes a formula for the unexplained residual.
    ProposalSettings {
        /// A formula has at most this many terms: longer ones explain everything.
        most_terms: usize = 3,
        /// This many terms are fitted after all have been screened.
        fitted_terms: usize = 4,
    }

    /// Fitted models show problems of the logs that audits alone do not see.
    NoteSettings {
        /// The torques are reported as reversed if reversing all of them leaves less than this share of the loss: half
        /// the error.
        reversed_loss: f64 = 0.25,
        /// Gravity is contradicted if the logged torques hold less than this share of the declared gravity, or more
        /// than its inverse: bodies from a drawing are off by a third, a torque without gravity by all.
        least_gravity: f64 = 0.5,
        /// The gravity torque of a joint must vary by this share of the joint's torque, both as standard deviations,
        /// for the joint to show gravity.
        gravity_spread: f64 = 0.3,
        /// A residual force counts as an external force beyond this many standard deviations of the others.
        push_deviations: f64 = 8.0,
        /// A residual force counts as an external force above this share of the joint's largest torque: the smoothing
        /// of friction leaves less in a clean log.
        push_torque: f64 = 0.1,
        /// Blocks next to the strongest one belong to an external force beyond this many standard deviations of the
        /// others.
        push_edge_deviations: f64 = 4.0,
        /// An external force lasts at least this many blocks: an end stop or a joint that sticks is over in one.
        external_force_blocks: usize = 2,
    }

    /// Stage 6 simulates experiments and decides when one of them suffices.
    DiscriminateSettings {
        /// Experiments are simulated against this many of the best alternatives: each costs as much as a few fits.
        alternatives: usize = 3,
        /// Twice the lead of the true model in loss must reach this for the other model to fall behind by two standard
        /// errors with a probability of 95 %: the lead has a mean of half this number and a standard deviation of its
        /// square root.
        lead: f64 = 4.0 * (2.0 + 1.645) * (2.0 + 1.645),
        /// Motion beyond this many times the top speed of the logs is not what the rig was built for.
        top_speeds: f64 = 5.0,
        /// This many windows stand for the present logs.
        present_windows: usize = 40,
        /// No position is measured more finely than this, in rad (or m).
        finest_position: f64 = 1e-6,
        /// Refits use this scale of the residuals: so large that the robust loss is plain least squares.
        refit_scale: f64 = 100.0,
        /// Logs with a step below this, in s, are taken to be sampled as fast as the encoder can be read.
        fastest_sampling_s: f64 = 4e-3,
        /// A motion lasts this time in s: long enough for another torque to show, short enough that it needs no
        /// controller.
        motion_s: f64 = 2.0,
        /// The torque ramps have this period in s; chirps and reversals last as long.
        ramp_period_s: f64 = 8.0,
        /// An experiment has this many motions.
        motions: usize = 10,
        /// Between the motions of one log the rig stands for this time in s, under the torque that the next motion
        /// begins with: longer than any memory of its drive.
        pause_s: f64 = 2.0,
        /// A motion has at most this many rows: logs may be denser than any motion needs.
        most_rows: f64 = 1e5,
        /// A known payload adds this share to a parameter.
        payload_share: f64 = 0.5,
        /// Experiments shorter than this, in s, are equally short.
        equally_short_s: f64 = 10.0,
        /// Nobody records for longer than this, in s, to distinguish two explanations.
        longest_s: f64 = 600.0,
        /// A difference below this share of the noise is less than what every model gets wrong.
        visible_share: f64 = 0.1,
    }

    /// Stage 7 computes the final estimate. Smoothing and integration steps shift dry friction by a few parts in a
    /// thousand, more than the noise of long logs does.
    RefineSettings {
        /// The longest step of the integrator is this, in s: half a millisecond.
        step_s: f64 = FINE_FIT_S,
        /// Dry friction is smoothed over this share of the width that effects were selected with, unless the model file
        /// gives the width.
        smoothing_velocity_factor: f64 = 0.5,
    }

    /// Stage 8 trains the residual network.
    LearnSettings {
        /// Rows are averaged over this time in s: the network is to learn a force, not the encoder's noise.
        step_s: f64 = 0.01,
        /// A segment unrolls this many steps.
        steps: usize = 8,
        /// About this many segments are enough for a network of a few hundred weights.
        segments: usize = 1200,
        /// Blocks of this length in s are trained on or kept to choose the epoch.
        block_s: f64 = 2.0,
        /// The logs are left out in this many parts, in turn, to see whether a network helps at all.
        check_parts: usize = 3,
        /// A network is used up to this ratio of the errors with and without it, on all left-out parts together.
        helpful_ratio: f64 = 0.95,
        /// No network is used above this ratio of the errors with and without it, on any left-out part.
        harmful_ratio: f64 = 1.02,
        /// One in this many blocks is kept to choose the epoch.
        validation_every: usize = 5,
        /// Training makes this many passes over all segments.
        epochs: usize = 250,
        /// Adam (Kingma and Ba 2015) takes this step size.
        learning_rate: f64 = 0.003,
        /// The network's output has this penalty: it takes over only what pays for it.
        alpha: f64 = 1e-3,
        /// The training's history has one entry per this many epochs.
        record_every: NonZeroUsize = const { NonZeroUsize::new(10).unwrap() },
    }

    /// Stage 9 scores the models.
    ScoreSettings {
        /// Errors are reported at these horizons in s; models are compared in one number at the middle one. Horizons
        /// longer than any test log are left out.
        horizons_s: Vec<f64> = vec![0.1, 0.5, 1.0],
        /// Sensor zeros that differ from log to log are estimated on this time in s from the beginning of a test log:
        /// what a user gets who zeroes the rig before a run.
        zeroed_on_s: f64 = 1.0,
        /// With at least this many test logs, whole logs are resampled for intervals; with fewer, blocks of two seconds
        /// are.
        whole_logs_from: usize = 5,
        /// An interval needs at least this many logs or blocks.
        fewest_blocks: usize = 3,
        /// The chosen model is fitted to each training log alone for at most this many logs: the time grows with them.
        most_logs_fitted_alone: usize = 32,
        /// The fit to each training log is scored on the others for at most this many logs: the table grows with their
        /// square.
        most_logs_crossed: usize = 8,
    }

    /// These settings decide when the logs allow a verdict.
    VerdictSettings {
        /// A conclusion needs at least this many windows.
        fewest_windows: usize = 8,
        /// Effects may raise the error on the test logs by this factor and still be trusted: noise in the windows'
        /// start states raises it by less.
        trusted_rise: f64 = 1.05,
        /// Effects explain the logs only if the open-loop error on the test logs is at most this many times what the
        /// noise of the sensors accounts for, which is estimated with caution.
        noise_floors: f64 = 3.0,
    }

    /// Stage 10 determines what the logs can show.
    CalibrateSettings {
        /// An effect of the smallest size is to be named in the share of logs with this standard normal quantile: 80 %.
        power_quantile: f64 = 0.841_6,
        /// For the logs to distinguish an effect from the rest of the model, at least this share of the information on
        /// it must be independent of the rest.
        own_information: f64 = 1e-6,
        /// An effect is hidden at this many times its smallest size.
        hidden_multiple: f64 = 1.5,
        /// The windows of simulated logs are separated by this pause, in half widths of a start state's estimate, each
        /// of four median steps or more: windows end at pauses of five.
        pause_half_widths: f64 = 1.5,
    }
}

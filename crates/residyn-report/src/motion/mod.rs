//! The rig in motion, as the page draws it: the beginning of the test as measured and as the models predict it.

mod dials;
mod mechanism;
pub(super) mod sketch;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::sketch::PictureEntry;
use super::plot_data::{motion, variance};
use residyn_core::closeloop::Outcome;

/// the rig in motion: the beginning of the first test log, as measured and as predicted from logged states
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct MotionEntry {
    pub log: String,
    /// how long each prediction runs before the next one starts, s
    pub horizon_s: f64,
    /// time of each frame, s
    pub time: Vec<f64>,
    /// the frame in which the declared model, fitted, is farthest off, counted from 0
    pub still: usize,
    /// how the rig is drawn, in a sentence
    pub drawn: String,
    /// one of the mechanism, or one per joint if the equations do not belong to a known mechanism
    #[schemars(length(min = 1))]
    pub pictures: Vec<PictureEntry>,
}

/// Length of the part that is shown, s, and its frames per second.
const LENGTH_S: f64 = 6.0;
const FRAMES_PER_S: f64 = 25.0;

/// Positions of the joints, rad or m: `[frame][joint]`.
type Frames = Vec<Vec<f64>>;

/// What moves: measured, before and after.
type Tracks = [Frames; 3];

impl MotionEntry {
    /// None if no segment of the first test log is as long as the middle horizon.
    pub fn of(outcome: &Outcome) -> Option<Self> {
        let predicted = outcome.predictions.middle.as_ref()?;
        let models = [predicted.before.as_slice(), &predicted.after];
        let course = motion(outcome.given.test.first()?, models);
        let rows = frames(&course.time);
        let [before, after] = [&course.models[0], &course.models[1]];
        let tracks: Tracks = [&course.measured, before, after].map(|q| {
            let at = |row: &usize| q.iter().map(|of_joint| of_joint[*row]).collect();
            rows.iter().map(at).collect()
        });
        let still = still(&tracks)?;
        let mechanism = mechanism::drawn(outcome, &tracks);
        let (drawn, pictures) = mechanism.unwrap_or_else(|| dials::drawn(outcome, &tracks));
        Some(Self {
            log: course.log.name(),
            horizon_s: predicted.horizon_s,
            time: (rows.iter())
                .map(|row| (1e3 * course.time[*row]).round() / 1e3)
                .collect(),
            still,
            drawn: drawn.to_owned(),
            pictures,
        })
    }
}

/// The rows that are shown, spaced as evenly as the log allows.
fn frames(time: &[f64]) -> Vec<usize> {
    let start_s = time.first().copied().unwrap_or(0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred frames
    let frame = |row: usize| ((time[row] - start_s) * FRAMES_PER_S + 1e-6) as usize;
    let end = time.partition_point(|t| t - start_s <= LENGTH_S);
    let is_first = |row: &usize| *row == 0 || frame(*row) > frame(*row - 1);
    (0..end).filter(is_first).collect()
}

/// The frame in which the prediction without effects is farthest from the measurement, in units of each joint's
/// variation.
fn still([measured, before, _]: &Tracks) -> Option<usize> {
    let joints = measured.first()?.len();
    let vary: Vec<f64> = (0..joints)
        .map(|joint| variance(&measured.iter().map(|q| q[joint]).collect::<Vec<f64>>()))
        .collect();
    let off = |k: &usize| -> f64 {
        let each = measured[*k].iter().zip(&before[*k]).zip(&vary);
        each.map(|((m, p), vary)| (m - p).powi(2) / vary.max(f64::MIN_POSITIVE))
            .sum()
    };
    let finite = (0..measured.len()).filter(|k| off(k).is_finite());
    finite.max_by(|a, b| off(a).total_cmp(&off(b)))
}

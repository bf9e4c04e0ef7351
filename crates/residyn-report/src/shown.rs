//! What a page draws of an outcome: measured beside predicted, and the residual force. Thinned and rounded, as a part of
//! `report.json`, so that the page can be made from that file alone.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::effect_curve::{EffectCurveEntry, effect_curves};
use super::headline::label;
use super::motion::MotionEntry;
use residyn_core::closeloop::{ForceSample, Outcome, ResidualForce, Space};
use residyn_core::data::{Joint, Log};
use residyn_core::sim::metric::Trace;

/// curves and points for pictures
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ShownEntry {
    /// measured and predicted: the beginning of the first test log, and the predictions with the median and the largest error
    pub stretches: Vec<StretchEntry>,
    /// null where no stretch of the first test log is as long as the middle horizon
    pub motion: Option<MotionEntry>,
    /// residual generalised force, joint by joint
    pub residuals: Vec<CloudEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct StretchEntry {
    /// in a few words
    pub about: String,
    pub log: String,
    /// s
    pub time: Vec<f64>,
    pub joints: Vec<TracksEntry>,
}

/// null where a prediction begins anew, or diverged
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct TracksEntry {
    /// with the joint and the unit
    pub quantity: String,
    pub measured: Vec<Option<f64>>,
    pub before: Vec<Option<f64>>,
    pub after: Vec<Option<f64>>,
    /// empty where no network is used
    pub hybrid: Vec<Option<f64>>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct CloudEntry {
    pub joint: Joint,
    /// of the joint's position, velocity and torque, the unit of each
    pub units: [String; 3],
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub tau: Vec<f64>,
    pub time: Vec<f64>,
    /// of the declared model, fitted; N m or N
    pub before: Vec<f64>,
    /// of the model with the effects, N m or N; empty where one of the two was not computed
    pub after: Vec<f64>,
    /// what the effects add by their formulas
    pub effects: Vec<EffectCurveEntry>,
}

/// Length of a stretch of torques, s.
const STRETCH_S: f64 = 2.0;
/// Length of the part that is shown of the first test log, s.
const COURSE_S: f64 = 20.0;
/// Points of a curve at most, and of a cloud.
const POINTS: usize = 800;
const CLOUD: usize = 300;

impl ShownEntry {
    pub fn of(outcome: &Outcome) -> Self {
        let courses: Vec<Course<'_>> = match outcome.space {
            Space::Motion => motions(outcome),
            Space::Torque => torques(outcome),
        };
        Self {
            stretches: stretches(outcome, &courses),
            motion: MotionEntry::of(outcome),
            residuals: clouds(outcome),
        }
    }
}

/// Measured and predicted along a log.
pub(super) struct Course<'a> {
    pub log: &'a Log,
    pub time: Vec<f64>,
    /// The window of each row: predictions begin anew with it.
    window: Vec<usize>,
    /// `[joint][row]`
    pub measured: Vec<Vec<f64>>,
    /// The fitted declared model, that with effects and, if one is used, that with a network: `[model][joint][row]`.
    pub models: Vec<Vec<Vec<f64>>>,
}

/// Open-loop predictions over the longest horizon, one after the other.
fn motions(outcome: &Outcome) -> Vec<Course<'_>> {
    let is_used = (outcome.learned.as_ref()).is_some_and(|learned| learned.check.used);
    let tests = outcome.given.test.iter().zip(&outcome.predictions.longest);
    let courses = tests.map(|(log, predicted)| {
        let network = predicted.hybrid.as_deref().filter(|_| is_used);
        let fitted = [predicted.before.as_slice(), &predicted.after];
        motion(log, fitted.into_iter().chain(network))
    });
    courses.filter(|course| !course.time.is_empty()).collect()
}

/// Open-loop predictions of a log, model by model.
pub(super) fn motion<'a>(
    log: &'a Log,
    models: impl IntoIterator<Item = &'a [Trace]>,
) -> Course<'a> {
    let of_models: Vec<&[Trace]> = models.into_iter().collect();
    let windows = || of_models[0].iter().enumerate();
    let time: Vec<f64> = windows()
        .flat_map(|(_, trace)| trace.time.clone())
        .collect();
    let row = |t: &f64| log.time.partition_point(|logged| logged < t);
    let joints = || Joint::all(log.q.len());
    Course {
        log,
        window: windows()
            .flat_map(|(k, trace)| vec![k; trace.time.len()])
            .collect(),
        measured: joints()
            .map(|joint| time.iter().map(|t| log.q[joint][row(t)]).collect())
            .collect(),
        models: of_models
            .iter()
            .map(|traces| {
                let of_joint = |joint: Joint| {
                    let each = traces.iter().flat_map(|trace| &trace.q[joint]);
                    each.copied().collect()
                };
                joints().map(of_joint).collect()
            })
            .collect(),
        time,
    }
}

/// Logged torques and those that the motion needs.
fn torques(outcome: &Outcome) -> Vec<Course<'_>> {
    let tests = outcome.given.test.iter().zip(&outcome.predictions.torques);
    let courses = tests.filter_map(|(log, needed)| {
        let (before, after) = (needed.before.as_ref()?, needed.after.as_ref()?);
        let start_s = before.time.first()?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // time since the start
        let window = |t: &f64| ((t - start_s) / STRETCH_S) as usize;
        Some(Course {
            log,
            window: before.time.iter().map(window).collect(),
            measured: before.logged.clone(),
            models: vec![before.needed.clone(), after.needed.clone()],
            time: before.time.clone(),
        })
    });
    courses.collect()
}

/// Rows of a course.
type Rows = std::ops::Range<usize>;

/// The windows of a course.
fn windows(course: &Course<'_>) -> Vec<Rows> {
    let ends = course.window.chunk_by(|a, b| a == b);
    let window = |start: &mut usize, part: &[usize]| {
        let rows = *start..*start + part.len();
        *start = rows.end;
        Some(rows)
    };
    ends.scan(0, window).collect()
}

fn stretches(outcome: &Outcome, courses: &[Course<'_>]) -> Vec<StretchEntry> {
    let Some(first) = courses.first() else {
        return Vec::new();
    };
    let end_s = first.time[0] + COURSE_S;
    let beginning = 0..first.time.partition_point(|t| *t <= end_s);
    let mut windows: Vec<(f64, &Course<'_>, Rows)> = courses
        .iter()
        .flat_map(|course| {
            let windows = windows(course).into_iter();
            windows.map(move |rows| (error(course, &rows), course, rows))
        })
        .collect();
    windows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let what = match outcome.space {
        Space::Motion => "predictions, each started from the log",
        Space::Torque => "stretches of torques",
    };
    let count = windows.len();
    let shown = |about: String, (_, course, rows): &(f64, &Course<'_>, Rows)| {
        stretch(outcome, course, rows.clone(), about)
    };
    let mut all = vec![stretch(
        outcome,
        first,
        beginning,
        format!("The beginning of the test: {what}"),
    )];
    let ranked = [
        (windows.get(count / 2), "The median"),
        (windows.last(), "The worst"),
    ];
    for (window, rank) in ranked {
        let about = format!("{rank} of {count} {what}");
        all.extend(window.map(|window| shown(about, window)));
    }
    all
}

/// Error of the model with effects over rows, joint by joint in units of how much the joint varies.
fn error(course: &Course<'_>, rows: &Rows) -> f64 {
    let of_joint = |(measured, predicted): (&Vec<f64>, &Vec<f64>)| -> f64 {
        let pairs = measured[rows.clone()].iter().zip(&predicted[rows.clone()]);
        let squares: f64 = pairs.map(|(m, p)| (m - p).powi(2)).sum();
        squares / variance(measured).max(f64::MIN_POSITIVE)
    };
    #[allow(clippy::cast_precision_loss)] // some hundreds
    let count = rows.len() as f64;
    let all: f64 = course
        .measured
        .iter()
        .zip(&course.models[1])
        .map(of_joint)
        .sum();
    (all / count).sqrt()
}

#[allow(clippy::cast_precision_loss)] // many rows
pub(super) fn variance(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count
}

fn stretch(outcome: &Outcome, course: &Course<'_>, rows: Rows, about: String) -> StretchEntry {
    let kept: Vec<usize> = rows.clone().step_by(rows.len() / POINTS + 1).collect();
    // Where a curve begins anew it is broken.
    let breaks =
        |place: usize| place > 0 && course.window[kept[place]] != course.window[kept[place - 1]];
    let breaks: Vec<bool> = (0..kept.len())
        .map(|place| outcome.space == Space::Motion && breaks(place))
        .collect();
    let values = |of: &[f64]| -> Vec<Option<f64>> {
        let kept = kept.iter().map(|row| of[*row]);
        kept.map(|v| v.is_finite().then(|| rounded(v))).collect()
    };
    let predicted = |model: usize, joint: Joint| -> Vec<Option<f64>> {
        let of_model = course.models.get(model).map(|model| values(&model[joint]));
        let broken = of_model.unwrap_or_default().into_iter().zip(&breaks);
        broken
            .map(|(value, breaks)| value.filter(|_| !breaks))
            .collect()
    };
    let of_joint = |joint: Joint| TracksEntry {
        quantity: quantity(outcome, joint),
        measured: values(&course.measured[joint]),
        before: predicted(0, joint),
        after: predicted(1, joint),
        hybrid: predicted(2, joint),
    };
    StretchEntry {
        about,
        log: course.log.name(),
        time: kept.iter().map(|row| rounded(course.time[*row])).collect(),
        joints: Joint::all(course.measured.len()).map(of_joint).collect(),
    }
}

/// `position of joint 2 (elbow), rad`
fn quantity(outcome: &Outcome, joint: Joint) -> String {
    let (what, unit) = match (outcome.space, outcome.given.prismatic[joint]) {
        (Space::Motion, false) => ("position", "rad"),
        (Space::Motion, true) => ("position", "m"),
        (Space::Torque, false) => ("torque", "N m"),
        (Space::Torque, true) => ("force", "N"),
    };
    format!("{what} of joint {}, {unit}", label(outcome, joint))
}

fn clouds(outcome: &Outcome) -> Vec<CloudEntry> {
    let Ok(before) = &outcome.remainder.before else {
        return Vec::new();
    };
    // Both are of the same stretches, if both could be computed.
    let after = (outcome.remainder.after.as_ref().ok())
        .filter(|after| after.samples.len() == before.samples.len());
    let step = before.samples.len() / CLOUD + 1;
    let values = |of: &ResidualForce, value: &dyn Fn(&ForceSample) -> f64| -> Vec<f64> {
        let kept = of.samples.iter().step_by(step);
        kept.map(|sample| rounded(value(sample))).collect()
    };
    let units = |joint: Joint| match outcome.given.prismatic[joint] {
        false => ["rad", "rad/s", "N m"],
        true => ["m", "m/s", "N"],
    };
    let of_joint = |joint: Joint| CloudEntry {
        joint,
        units: units(joint).map(str::to_owned),
        q: values(before, &|sample| sample.q[joint]),
        qd: values(before, &|sample| sample.qd[joint]),
        tau: values(before, &|sample| sample.tau[joint]),
        time: values(before, &|sample| sample.time_s),
        before: values(before, &|sample| sample.force[joint]),
        after: after.map_or_else(Vec::new, |after| {
            values(after, &|sample| sample.force[joint])
        }),
        effects: effect_curves(outcome, joint, |variable| range(before, joint, variable)),
    };
    Joint::all(outcome.models.after.model.joints)
        .map(of_joint)
        .collect()
}

/// Where a variable of a joint (q, qd, tau or t) lies.
fn range(force: &ResidualForce, joint: Joint, variable: &str) -> [f64; 2] {
    let value = |sample: &ForceSample| match variable {
        "q" => sample.q[joint],
        "qd" => sample.qd[joint],
        "tau" => sample.tau[joint],
        _ => sample.time_s,
    };
    let all = force.samples.iter().map(value);
    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// To five digits.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

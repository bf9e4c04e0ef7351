//! The data of an outcome that a page draws: measured and predicted curves, and the residual force. Thinned and
//! rounded, as a part of `report.json`, so that the page can be made from that file alone.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::effect_curve::{EffectCurveEntry, effect_curves};
use super::headline::label;
use super::motion::MotionEntry;
use super::picture::kind;
use residyn_core::closeloop::{ErrorModel, ForceSample, Outcome, ResidualForce};
use residyn_core::data::statistics::mean;
use residyn_core::data::{Joint, Log};
use residyn_core::sim::metric::Trace;

/// curves and points for pictures
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct PlotData {
    /// measured and predicted: the beginning of the first test log, and the predictions with the median and the largest error
    pub segments: Vec<SegmentEntry>,
    /// null if no segment of the first test log is as long as the middle horizon
    pub motion: Option<MotionEntry>,
    /// residual generalised force, joint by joint
    pub residuals: Vec<ScatterEntry>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct SegmentEntry {
    /// in a few words
    pub about: String,
    pub log: String,
    /// s
    pub time: Vec<f64>,
    pub joints: Vec<SeriesEntry>,
}

/// null where a prediction restarts, or diverged
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct SeriesEntry {
    /// with the joint and the unit
    pub quantity: String,
    pub measured: Vec<Option<f64>>,
    pub before: Vec<Option<f64>>,
    pub after: Vec<Option<f64>>,
    /// empty if no network is used
    pub hybrid: Vec<Option<f64>>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ScatterEntry {
    pub joint: Joint,
    /// units of the joint's position, velocity and torque
    pub units: [String; 3],
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub tau: Vec<f64>,
    pub time: Vec<f64>,
    /// residual force of the declared model, fitted; N m or N
    pub before: Vec<f64>,
    /// residual force of the model with the effects, N m or N; empty if one of the two was not computed
    pub after: Vec<f64>,
    /// what the effects add by their formulas
    pub effects: Vec<EffectCurveEntry>,
}

/// Length of a segment of torques, s.
const STRETCH_S: f64 = 2.0;
/// Length of the part of the first test log that is shown, s.
const COURSE_S: f64 = 20.0;
/// Most points of a curve, and of a scatter.
const POINTS: usize = 800;
const CLOUD: usize = 300;

impl PlotData {
    pub fn of(outcome: &Outcome) -> Self {
        Self {
            segments: segments(outcome, &series(outcome)),
            motion: MotionEntry::of(outcome),
            residuals: scatters(outcome),
        }
    }
}

/// Measured and predicted along a log.
pub(super) struct Series<'a> {
    pub log: &'a Log,
    pub time: Vec<f64>,
    /// The window of each row: predictions restart with each window.
    window: Vec<usize>,
    /// `[joint][row]`
    pub measured: Vec<Vec<f64>>,
    /// The fitted declared model, the model with effects and, if used, the model with a network: `[model][joint][row]`.
    pub models: Vec<Vec<Vec<f64>>>,
}

/// What was compared on the test logs, of those that have any.
pub(super) fn series(outcome: &Outcome) -> Vec<Series<'_>> {
    match outcome.error_model {
        ErrorModel::OutputError => motions(outcome),
        ErrorModel::InverseDynamics => torques(outcome),
    }
}

/// Open-loop predictions over the longest horizon, one after the other.
fn motions(outcome: &Outcome) -> Vec<Series<'_>> {
    let is_used = (outcome.learned.as_ref()).is_some_and(|learned| learned.check.used);
    let tests = outcome.given.test.iter().zip(&outcome.predictions.longest);
    let series = tests.map(|(log, predicted)| {
        let network = predicted.hybrid.as_deref().filter(|_| is_used);
        let fitted = [predicted.before.as_slice(), &predicted.after];
        motion(log, fitted.into_iter().chain(network))
    });
    series.filter(|one| !one.time.is_empty()).collect()
}

/// Open-loop predictions of a log, model by model.
pub(super) fn motion<'a>(
    log: &'a Log,
    models: impl IntoIterator<Item = &'a [Trace]>,
) -> Series<'a> {
    let of_models: Vec<&[Trace]> = models.into_iter().collect();
    let times: Vec<&[f64]> = of_models[0]
        .iter()
        .map(|trace| trace.time.as_slice())
        .collect();
    let time = times.concat();
    let row = |t: &f64| log.time.partition_point(|logged| logged < t);
    let joints = || Joint::all(log.q.len());
    Series {
        log,
        window: (times.iter().enumerate())
            .flat_map(|(k, time)| vec![k; time.len()])
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
fn torques(outcome: &Outcome) -> Vec<Series<'_>> {
    let tests = outcome.given.test.iter().zip(&outcome.predictions.torques);
    let series = tests.filter_map(|(log, needed)| {
        let (before, after) = (needed.before.as_ref()?, needed.after.as_ref()?);
        let start_s = before.time.first()?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative
        let window = |t: &f64| ((t - start_s) / STRETCH_S) as usize;
        Some(Series {
            log,
            window: before.time.iter().map(window).collect(),
            measured: before.logged.clone(),
            models: vec![before.needed.clone(), after.needed.clone()],
            time: before.time.clone(),
        })
    });
    series.collect()
}

/// Rows of a series.
pub(super) type Rows = std::ops::Range<usize>;

/// The windows of a series.
pub(super) fn windows(one: &Series<'_>) -> Vec<Rows> {
    let ends = one.window.chunk_by(|a, b| a == b);
    let window = |start: &mut usize, part: &[usize]| {
        let rows = *start..*start + part.len();
        *start = rows.end;
        Some(rows)
    };
    ends.scan(0, window).collect()
}

fn segments(outcome: &Outcome, series: &[Series<'_>]) -> Vec<SegmentEntry> {
    let Some(first) = series.first() else {
        return Vec::new();
    };
    let end_s = first.time[0] + COURSE_S;
    let beginning = 0..first.time.partition_point(|t| *t <= end_s);
    let mut windows: Vec<(f64, &Series<'_>, Rows)> = series
        .iter()
        .flat_map(|one| {
            let windows = windows(one).into_iter();
            windows.map(move |rows| (error(one, &rows), one, rows))
        })
        .collect();
    windows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let what = match outcome.error_model {
        ErrorModel::OutputError => "predictions, each started from the log",
        ErrorModel::InverseDynamics => "segments of torques",
    };
    let count = windows.len();
    let shown = |about: String, (_, one, rows): &(f64, &Series<'_>, Rows)| {
        segment(outcome, one, rows.clone(), about)
    };
    let mut all = vec![segment(
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

/// Error of the model with effects over rows, joint by joint in units of the joint's variation.
fn error(one: &Series<'_>, rows: &Rows) -> f64 {
    let of_joint = |(measured, predicted): (&Vec<f64>, &Vec<f64>)| -> f64 {
        let pairs = measured[rows.clone()].iter().zip(&predicted[rows.clone()]);
        let squares: f64 = pairs.map(|(m, p)| (m - p).powi(2)).sum();
        squares / variance(measured).max(f64::MIN_POSITIVE)
    };
    #[allow(clippy::cast_precision_loss)] // a few hundred
    let count = rows.len() as f64;
    let all: f64 = one.measured.iter().zip(&one.models[1]).map(of_joint).sum();
    (all / count).sqrt()
}

pub(super) fn variance(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - middle).powi(2)).collect();
    mean(&squares)
}

fn segment(outcome: &Outcome, one: &Series<'_>, rows: Rows, about: String) -> SegmentEntry {
    let kept: Vec<usize> = rows.clone().step_by(rows.len() / POINTS + 1).collect();
    // A curve is broken where it restarts.
    let restarts = outcome.error_model == ErrorModel::OutputError;
    let breaks = |k: usize| restarts && k > 0 && one.window[kept[k]] != one.window[kept[k - 1]];
    let values = |of: &[f64]| -> Vec<Option<f64>> {
        let kept = kept.iter().map(|row| of[*row]);
        kept.map(|v| v.is_finite().then(|| rounded(v))).collect()
    };
    let predicted = |model: usize, joint: Joint| -> Vec<Option<f64>> {
        let of_model = one.models.get(model).map(|model| values(&model[joint]));
        let values = of_model.unwrap_or_default().into_iter().enumerate();
        let broken = values.map(|(k, value)| value.filter(|_| !breaks(k)));
        broken.collect()
    };
    let of_joint = |joint: Joint| SeriesEntry {
        quantity: quantity(outcome, joint),
        measured: values(&one.measured[joint]),
        before: predicted(0, joint),
        after: predicted(1, joint),
        hybrid: predicted(2, joint),
    };
    SegmentEntry {
        about,
        log: one.log.name(),
        time: kept.iter().map(|row| rounded(one.time[*row])).collect(),
        joints: Joint::all(one.measured.len()).map(of_joint).collect(),
    }
}

/// `position of joint 2 (elbow), rad`
fn quantity(outcome: &Outcome, joint: Joint) -> String {
    let kind = kind(outcome, joint);
    let (what, unit) = match outcome.error_model {
        ErrorModel::OutputError => ("position", kind.position_unit()),
        ErrorModel::InverseDynamics => (kind.force_name(), kind.force_unit()),
    };
    format!("{what} of joint {}, {unit}", label(outcome, joint))
}

fn scatters(outcome: &Outcome) -> Vec<ScatterEntry> {
    let Ok(before) = &outcome.diagnostics.before else {
        return Vec::new();
    };
    // Both are of the same segments, if both could be computed.
    let after = (outcome.diagnostics.after.as_ref().ok())
        .filter(|after| after.samples.len() == before.samples.len());
    let step = before.samples.len() / CLOUD + 1;
    let values = |of: &ResidualForce, value: &dyn Fn(&ForceSample) -> f64| -> Vec<f64> {
        let kept = of.samples.iter().step_by(step);
        kept.map(|sample| rounded(value(sample))).collect()
    };
    let units = |joint: Joint| {
        let kind = kind(outcome, joint);
        [
            kind.position_unit(),
            kind.velocity_unit(),
            kind.force_unit(),
        ]
    };
    let of_joint = |joint: Joint| ScatterEntry {
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

/// The range of a joint's variable (q, qd, tau or t).
fn range(force: &ResidualForce, joint: Joint, variable: &str) -> [f64; 2] {
    let value = |sample: &ForceSample| match variable {
        "q" => sample.q[joint],
        "qd" => sample.qd[joint],
        "tau" => sample.tau[joint],
        _ => sample.time_s,
    };
    span(force.samples.iter().map(value))
}

/// The least and the largest value.
pub(super) fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// To five digits.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

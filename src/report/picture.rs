//! The report's plots: what of an outcome goes into which chart.

use super::plot::{
    Bar, ErrorRow, JointKind, Panel, PlotError, Role, ShapeCurve, ShapePanel, ShapeSample, Track,
};
use crate::closeloop::{Outcome, ResidualForce};
use crate::data::{Joint, Log};
use crate::evaluate::{Assessment, summarise, traces};
use crate::identify::FitError;
use crate::model::Dynamics;

/// A picture shows this much of a log in s: more than that and predictions become a blur.
const SHOWN_S: f64 = 8.0;

/// Measured motion and open-loop predictions on the beginning of the first test log.
pub(super) fn predictions(outcome: &Outcome) -> Result<String, PlotError> {
    let Some(log) = outcome.given.test.first() else {
        return Err(PlotError::Empty {
            title: "predictions".into(),
        });
    };
    let horizons = outcome.errors.before.horizons.iter().map(|h| h.horizon_s);
    // Differences between models grow with the horizon: the longest one shows them best.
    let horizon = horizons.fold(0.0, f64::max);
    let models = &outcome.models;
    let mut models: Vec<(Role, &str, Dynamics)> = vec![
        (Role::Before, "declared model", models.before.dynamics()),
        (Role::After, "with effects", models.after.dynamics()),
    ];
    if let Some(learned) = &outcome.learned {
        models.push((
            Role::Hybrid,
            "with effects and network",
            learned.hybrid.clone(),
        ));
    }
    let panel = |joint: Joint| Panel {
        joint,
        kind: kind(outcome, joint),
        tracks: std::iter::once(measured(log, joint))
            .chain(models.iter().map(|(role, label, dynamics)| Track {
                label: (*label).to_owned(),
                role: *role,
                segments: predicted(dynamics, log, joint, horizon),
            }))
            .collect(),
    };
    let panels: Vec<Panel> = Joint::all(outcome.models.after.joints).map(panel).collect();
    let title = format!(
        "{}: predictions of {horizon} s, each started from the log",
        log.name()
    );
    super::plot::predictions(&panels, &title)
}

fn kind(outcome: &Outcome, joint: Joint) -> JointKind {
    if outcome.given.prismatic[joint] {
        JointKind::Prismatic
    } else {
        JointKind::Revolute
    }
}

fn end(log: &Log) -> f64 {
    log.time.first().map_or(0.0, |start| start + SHOWN_S)
}

fn measured(log: &Log, joint: Joint) -> Track {
    let points = log.time.iter().copied().zip(log.q[joint].iter().copied());
    Track {
        label: "measured".into(),
        role: Role::Measured,
        segments: vec![points.take_while(|(t, _)| *t <= end(log)).collect()],
    }
}

fn predicted(dynamics: &Dynamics, log: &Log, joint: Joint, horizon: f64) -> Vec<Vec<(f64, f64)>> {
    traces(dynamics, log, horizon)
        .into_iter()
        .take_while(|trace| trace.time.last().is_some_and(|t| *t <= end(log)))
        .map(|trace| {
            trace
                .time
                .into_iter()
                .zip(trace.q[joint].iter().copied())
                .collect()
        })
        .collect()
}

/// The residual generalised force over angle, speed, torque and time, before and after.
pub(super) fn residual(outcome: &Outcome) -> Result<String, PlotError> {
    type Force = Result<ResidualForce, FitError>;
    let samples = |force: &Force, joint: Joint| {
        (force.iter().flat_map(|force| &force.samples))
            .map(|s| ShapeSample {
                values: [s.q[joint], s.qd[joint], s.tau[joint], s.time_s],
                residual: s.force[joint],
            })
            .collect()
    };
    let names = |joint: Joint| {
        [
            joint.name("q"),
            joint.name("qd"),
            joint.name("tau"),
            "t".to_owned(),
        ]
    };
    let curves = |force: &Force, joint: Joint| {
        names(joint).map(|name| {
            let found = (force.iter().flat_map(|force| &force.curves))
                .find(|c| c.joint == joint && c.variable == name);
            found.map(|c| ShapeCurve {
                x: c.x.clone(),
                force: c.force.clone(),
                low: c.low.clone(),
                high: c.high.clone(),
            })
        })
    };
    let panel = |joint: Joint| ShapePanel {
        joint,
        kind: kind(outcome, joint),
        before: samples(&outcome.remainder.before, joint),
        after: samples(&outcome.remainder.after, joint),
        curves_before: curves(&outcome.remainder.before, joint),
        curves_after: curves(&outcome.remainder.after, joint),
    };
    let panels: Vec<ShapePanel> = Joint::all(outcome.models.after.joints).map(panel).collect();
    super::plot::residual_shape(&panels, "What the model lacks, before and after")
}

/// Open-loop errors at each horizon, of the fitted models and of those scored as they are. The declared model
/// as written is left to the tables: its values may be guesses, beside which no other bar could be read.
pub(super) fn errors(outcome: &Outcome) -> Result<String, PlotError> {
    let joints = outcome.models.after.joints;
    let errors = &outcome.errors;
    let named = |role: Role, label: &str, model: &Assessment| {
        let rmse = summarise(&model.horizons, joints).position_rmse;
        (role, label.to_owned(), rmse)
    };
    let mut models = vec![
        named(Role::Before, "before: declared model", &errors.before),
        named(Role::After, "after: with the effects found", &errors.after),
    ];
    let hybrid = errors.hybrid.iter();
    models.extend(hybrid.map(|m| named(Role::Hybrid, "hybrid: with a network for the rest", m)));
    let others = errors.against.iter().enumerate();
    models.extend(others.map(|(k, (name, m))| named(Role::Against(k), name, m)));
    let row = |joint: Joint, h: usize| ErrorRow {
        joint,
        kind: kind(outcome, joint),
        horizon_s: errors.before.horizons[h].horizon_s,
        bars: models
            .iter()
            .map(|(role, label, rmse)| Bar {
                role: *role,
                label: label.clone(),
                error: rmse[h][joint],
            })
            .collect(),
    };
    let rows: Vec<ErrorRow> = Joint::all(joints)
        .flat_map(|joint| (0..errors.before.horizons.len()).map(move |h| (joint, h)))
        .map(|(joint, h)| row(joint, h))
        .collect();
    super::plot::error_bars(&rows, "Open-loop position error on the test logs")
}

//! The report's plots: which parts of an outcome go into which chart.

use super::headline::label;
use super::wording::{FITTED, WITH_EFFECTS, WITH_NETWORK};
use residyn_core::closeloop::{ErrorModel, ForceSample, Needed, Outcome, ResidualForce};
use residyn_core::data::{Joint, Log};
use residyn_core::identify::FitError;
use residyn_core::sim::metric::{Assessment, NeededTorques, Trace, summarise};
use residyn_plot::{
    Bar, ErrorRow, JointKind, Panel, PlotError, Role, ShapeCurve, ShapeModel, ShapePanel,
    ShapeSample, Track,
};

/// A picture shows this much of a log in s: more than that and predictions become a blur.
const SHOWN_S: f64 = 8.0;

/// What was compared on the beginning of the first test log: open-loop predictions of its motion, or the torques that it needs.
pub(super) fn predictions(outcome: &Outcome) -> Result<String, PlotError> {
    let Some(log) = outcome.given.test.first() else {
        return Err(PlotError {
            title: "predictions".into(),
        });
    };
    match outcome.error_model {
        ErrorModel::OutputError => motion(outcome, log),
        ErrorModel::InverseDynamics => torques(outcome, log),
    }
}

/// Measured motion and open-loop predictions of it.
fn motion(outcome: &Outcome, log: &Log) -> Result<String, PlotError> {
    let predictions = outcome.predictions.longest.first();
    let horizon = predictions.map_or(0.0, |predicted| predicted.horizon_s);
    let mut models: Vec<(Role, &str, &[Trace])> = Vec::new();
    if let Some(predicted) = predictions {
        models.push((Role::Before, FITTED, &predicted.before));
        models.push((Role::After, WITH_EFFECTS, &predicted.after));
        let network = predicted.hybrid.as_deref();
        models.extend(network.map(|traces| (Role::Hybrid, WITH_NETWORK, traces)));
    }
    let panel = |joint: Joint| Panel {
        label: label(outcome, joint),
        quantity: kind(outcome, joint).position(joint),
        tracks: std::iter::once(measured(log, joint))
            .chain(models.iter().map(|(role, label, traces)| Track {
                label: (*label).to_owned(),
                role: *role,
                segments: predicted(traces, log, joint),
            }))
            .collect(),
    };
    let panels: Vec<Panel> = Joint::all(outcome.models.after.model.joints)
        .map(panel)
        .collect();
    let title = format!(
        "{}: predictions of {horizon} s, each started from the log",
        log.name()
    );
    residyn_plot::predictions(&panels, &title)
}

/// Logged torques and those that the motion needs according to the models, both low-passed.
fn torques(outcome: &Outcome, log: &Log) -> Result<String, PlotError> {
    let mut needed: Vec<(Role, &str, &NeededTorques)> = Vec::new();
    if let Some(Needed { before, after }) = outcome.predictions.torques.first() {
        needed.extend(before.iter().map(|of| (Role::Before, FITTED, of)));
        needed.extend(after.iter().map(|of| (Role::After, WITH_EFFECTS, of)));
    }
    let curve =
        |label: &str, role: Role, of: &NeededTorques, values: &[Vec<f64>], joint: Joint| Track {
            label: label.to_owned(),
            role,
            segments: vec![beginning(log, &of.time, &values[joint])],
        };
    let panel = |joint: Joint| {
        let logged = needed.first();
        let logged =
            logged.map(|(_, _, of)| curve("measured", Role::Measured, of, &of.logged, joint));
        let models = needed.iter();
        let models = models.map(|(role, label, of)| curve(label, *role, of, &of.needed, joint));
        Panel {
            label: label(outcome, joint),
            quantity: kind(outcome, joint).force(joint),
            tracks: logged.into_iter().chain(models).collect(),
        }
    };
    let joints = outcome.models.after.model.joints;
    let panels: Vec<Panel> = Joint::all(joints).map(panel).collect();
    let title = format!("{}: torques that its motion needs", log.name());
    residyn_plot::predictions(&panels, &title)
}

pub(super) fn kind(outcome: &Outcome, joint: Joint) -> JointKind {
    JointKind::of(outcome.given.prismatic[joint])
}

/// The points of a curve along a log that are shown.
fn beginning(log: &Log, time: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let end = log.time.first().map_or(0.0, |start| start + SHOWN_S);
    let points = time.iter().copied().zip(values.iter().copied());
    points.take_while(|(t, _)| *t <= end).collect()
}

fn measured(log: &Log, joint: Joint) -> Track {
    Track {
        label: "measured".into(),
        role: Role::Measured,
        segments: vec![beginning(log, &log.time, &log.q[joint])],
    }
}

fn predicted(traces: &[Trace], log: &Log, joint: Joint) -> Vec<Vec<(f64, f64)>> {
    let shown = |trace: &Trace| beginning(log, &trace.time, &trace.q[joint]);
    let pieces = traces.iter().map(shown);
    pieces.filter(|piece| piece.len() > 1).collect()
}

/// The residual generalised force over angle, speed, torque and time, without and with the effects.
pub(super) fn residual(outcome: &Outcome) -> Result<String, PlotError> {
    let (fitted, with_effects) = (&outcome.diagnostics.before, &outcome.diagnostics.after);
    let panel = |joint: Joint| ShapePanel {
        joint,
        label: label(outcome, joint),
        kind: kind(outcome, joint),
        models: vec![
            shape(Role::Before, FITTED, joint, fitted),
            shape(Role::After, WITH_EFFECTS, joint, with_effects),
        ],
    };
    let panels: Vec<ShapePanel> = Joint::all(outcome.models.after.model.joints)
        .map(panel)
        .collect();
    residyn_plot::residual_shape(
        &panels,
        "Residual force: what each model leaves unexplained",
    )
}

fn shape(
    role: Role,
    label: &str,
    joint: Joint,
    force: &Result<ResidualForce, FitError>,
) -> ShapeModel {
    let sample = |s: &ForceSample| ShapeSample {
        values: [s.q[joint], s.qd[joint], s.tau[joint], s.time_s],
        residual: s.force[joint],
    };
    let curve = |name: String| {
        let curves = force.iter().flat_map(|force| &force.curves);
        let mut of_joint = curves.filter(|c| c.joint == joint);
        of_joint.find(|c| c.variable == name).map(|c| ShapeCurve {
            x: c.x.clone(),
            force: c.force.clone(),
            low: c.low.clone(),
            high: c.high.clone(),
        })
    };
    let samples = force.iter().flat_map(|force| &force.samples);
    let [q, qd, tau] = ["q", "qd", "tau"].map(|stem| curve(joint.name(stem)));
    ShapeModel {
        role,
        label: label.to_owned(),
        samples: samples.map(sample).collect(),
        curves: [q, qd, tau, curve("t".to_owned())],
    }
}

/// Open-loop errors at each horizon, of the fitted models and of those scored as they are. The declared model
/// as written is left to the tables: its values may be guesses, whose bar would dwarf all others.
pub(super) fn errors(outcome: &Outcome) -> Result<String, PlotError> {
    let joints = outcome.models.after.model.joints;
    let errors = &outcome.errors;
    let named = |role: Role, label: &str, model: &Assessment| {
        let rmse = summarise(&model.horizons, joints).position_rmse;
        (role, label.to_owned(), rmse)
    };
    let mut models = vec![
        named(Role::Before, FITTED, &errors.before),
        named(Role::After, WITH_EFFECTS, &errors.after),
    ];
    let hybrid = errors.hybrid.iter();
    models.extend(hybrid.map(|m| named(Role::Hybrid, WITH_NETWORK, m)));
    let others = errors.against.iter().enumerate();
    models.extend(others.map(|(k, (name, m))| named(Role::Against(k), name, m)));
    let row = |joint: Joint, h: usize| ErrorRow {
        of: format!("Joint {}", label(outcome, joint)),
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
    residyn_plot::error_bars(&rows, "Open-loop position error on the test logs")
}

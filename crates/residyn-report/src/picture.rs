//! The report's plots: which parts of an outcome go into which chart.

use super::headline::label;
use super::overview::{in_order, is_large};
use super::plot_data::{Rows, Series, series, windows};
use super::wording::{FITTED, WITH_EFFECTS, WITH_NETWORK};
use residyn_core::closeloop::{ErrorModel, ForceSample, Outcome, ResidualForce};
use residyn_core::data::Joint;
use residyn_core::identify::FitError;
use residyn_core::sim::metric::{Assessment, summarise};
use residyn_plot::{
    Bar, ErrorRow, JointKind, Panel, PlotError, Role, ShapeCurve, ShapeModel, ShapePanel,
    ShapeSample, Track,
};

/// A picture shows this much of a log in s: more than that and predictions become a blur.
const SHOWN_S: f64 = 8.0;

/// Of a rig of many joints, a picture shows so many: more do not fit a screen, and the page has each joint's own.
const MOST_JOINTS: usize = 6;

/// The joints that a picture shows, and a remark in its title if these are not all.
fn shown_joints(outcome: &Outcome) -> (Vec<Joint>, String) {
    let joints = outcome.models.after.model.joints;
    if !is_large(joints) {
        return (Joint::all(joints).collect(), String::new());
    }
    let remark = format!(" (the {MOST_JOINTS} of {joints} joints with the largest error)");
    (worst(&errors_of_joints(outcome), MOST_JOINTS), remark)
}

/// The `most` joints with the largest errors, in order. An error that is not a number is larger than all.
fn worst(errors: &[f64], most: usize) -> Vec<Joint> {
    let mut joints: Vec<Joint> = Joint::all(errors.len()).collect();
    joints.sort_by(|a, b| errors[b.index()].total_cmp(&errors[a.index()]));
    joints.truncate(most);
    joints.sort_unstable();
    joints
}

/// The error that was compared of the model with effects, joint by joint.
fn errors_of_joints(outcome: &Outcome) -> Vec<f64> {
    let torque = outcome.errors.torque.as_ref();
    match torque.filter(|_| outcome.error_model == ErrorModel::InverseDynamics) {
        Some(torque) => torque.after.rms.clone(),
        None => {
            let after = &outcome.errors.after;
            let mut rmse =
                summarise(&after.horizons, outcome.models.after.model.joints).position_rmse;
            rmse.swap_remove(after.horizons.len() / 2)
        }
    }
}

/// What was compared on the beginning of the first test log: open-loop predictions of its motion, or the torques that it needs.
pub(super) fn predictions(outcome: &Outcome) -> Result<String, PlotError> {
    let all = series(outcome);
    let shown = all.first();
    let panel = |joint: Joint| {
        let kind = kind(outcome, joint);
        let quantity = match outcome.error_model {
            ErrorModel::OutputError => kind.position(joint),
            ErrorModel::InverseDynamics => kind.force(joint),
        };
        Panel {
            label: label(outcome, joint),
            quantity,
            tracks: shown.map_or_else(Vec::new, |one| tracks(outcome, one, joint)),
        }
    };
    let (joints, which) = shown_joints(outcome);
    let panels: Vec<Panel> = joints.into_iter().map(panel).collect();
    let log = shown.map_or_else(|| "the test logs".to_owned(), |one| one.log.name());
    let about = match (outcome.error_model, outcome.predictions.longest.first()) {
        (ErrorModel::OutputError, Some(longest)) => format!(
            "predictions of {} s, each started from the log",
            longest.horizon_s
        ),
        (ErrorModel::OutputError, None) => "no predictions".to_owned(),
        (ErrorModel::InverseDynamics, _) => "torques that its motion needs".to_owned(),
    };
    residyn_plot::predictions(&panels, &format!("{log}: {about}{which}"))
}

/// The curves of a joint; predictions of motion restart with each window.
fn tracks(outcome: &Outcome, one: &Series<'_>, joint: Joint) -> Vec<Track> {
    let end_s = one.time[0] + SHOWN_S;
    let shown = 0..one.time.partition_point(|t| *t <= end_s);
    let pieces = match outcome.error_model {
        ErrorModel::OutputError => windows(one),
        ErrorModel::InverseDynamics => vec![shown.clone()],
    };
    let track = |role: Role, label: &str, values: &[f64], pieces: &[Rows]| {
        let piece = |rows: &Rows| -> Vec<(f64, f64)> {
            let rows = rows.start..rows.end.min(shown.end);
            rows.map(|row| (one.time[row], values[row])).collect()
        };
        let segments = pieces.iter().map(piece);
        Track {
            label: label.to_owned(),
            role,
            segments: segments.filter(|piece| piece.len() > 1).collect(),
        }
    };
    let models = [
        (Role::Before, FITTED),
        (Role::After, WITH_EFFECTS),
        (Role::Hybrid, WITH_NETWORK),
    ];
    let measured = std::slice::from_ref(&shown);
    let measured = track(Role::Measured, "measured", &one.measured[joint], measured);
    let models = models.into_iter().zip(&one.models);
    let models = models.map(|((role, label), of)| track(role, label, &of[joint], &pieces));
    std::iter::once(measured).chain(models).collect()
}

pub(super) fn kind(outcome: &Outcome, joint: Joint) -> JointKind {
    if outcome.given.prismatic[joint] {
        JointKind::Prismatic
    } else {
        JointKind::Revolute
    }
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
    let (joints, which) = shown_joints(outcome);
    let panels: Vec<ShapePanel> = joints.into_iter().map(panel).collect();
    let title = format!("Residual force: what each model leaves unexplained{which}");
    residyn_plot::residual_shape(&panels, &title)
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
/// as written is left to the tables: its values may be guesses, whose bar would dwarf all others. Of many joints, one chart
/// shows the middle horizon.
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
    let horizons = errors.before.horizons.len();
    let title = "Open-loop position error on the test logs";
    if is_large(joints) {
        let middle = horizons / 2;
        let like = outcome.models.after.model.like_joints();
        let ordered = in_order(joints, &like).into_iter();
        let rows: Vec<ErrorRow> = ordered.map(|(joint, _)| row(joint, middle)).collect();
        let horizon_s = errors.before.horizons[middle].horizon_s;
        return residyn_plot::error_dots(&rows, &format!("{title}, {horizon_s} s ahead"));
    }
    let rows: Vec<ErrorRow> = Joint::all(joints)
        .flat_map(|joint| (0..horizons).map(move |h| (joint, h)))
        .map(|(joint, h)| row(joint, h))
        .collect();
    residyn_plot::error_bars(&rows, title)
}

#[cfg(test)]
mod tests {
    use super::worst;

    #[test]
    fn the_joints_with_the_largest_errors_are_shown_in_order() {
        let shown = |errors: &[f64]| -> Vec<usize> {
            worst(errors, 2)
                .iter()
                .map(|joint| joint.number())
                .collect()
        };
        assert_eq!(shown(&[0.1, 0.4, 0.2, 0.3]), [2, 4]);
        assert_eq!(shown(&[0.1, 0.4, f64::NAN, 0.3]), [2, 3]);
        assert_eq!(shown(&[0.1]), [1]);
    }
}

//! How much better: errors on the test logs, one row per joint.

use super::{listed, paragraph};
use crate::document::{
    all_torques, fitted_tests, force_unit, judges_by_torques, position_unit, removed,
};
use crate::schema::{ModelError, Report};
use crate::wording::{WITH_FRICTION, small};
use residyn_core::closeloop::TorqueErrors;
use residyn_core::data::Joint;

/// Most rows of the table, not counting the row of all joints.
const ROWS: usize = 7;
/// Most other models that are listed.
const OTHERS: usize = 2;

pub(super) fn lines(report: &Report) -> Vec<String> {
    let mut lines = match &report.torque {
        Some(torque) if judges_by_torques(report) => of_torques(report, torque),
        _ => of_motion(report),
    };
    let fitted = fitted_tests(report).into_iter();
    lines.extend(fitted.flat_map(|sentence| paragraph("  ", &sentence)));
    lines
}

/// The title, the heads of the columns, the rows, and how much the effects remove.
fn table(title: &str, rows: Vec<String>, reduction: Option<[f64; 2]>) -> Vec<String> {
    let heads = row(
        "",
        ["as written", "fitted", "with effects"].map(str::to_owned),
    );
    let removed = removed(reduction, "error").map(|removed| format!("  {removed}"));
    let title = format!("How much better is it? {title}");
    [vec![title, heads], rows, removed.into_iter().collect()].concat()
}

fn row(name: &str, numbers: [String; 3]) -> String {
    let [written, fitted, with] = numbers;
    format!("  {name:<40}{written:>11}{fitted:>11}{with:>14}")
}

fn of_torques(report: &Report, errors: &TorqueErrors) -> Vec<String> {
    let models = [&errors.declared, &errors.before, &errors.after];
    let of_joint = |joint: Joint| {
        let name = format!("joint {}", report.label(joint));
        row(&name, models.map(|model| small(model.rms[joint])))
    };
    let rows = Joint::all(report.joints).map(of_joint).collect();
    let mut rows = listed(rows, ROWS, "joints");
    let share = models.map(|model| model.share());
    rows.push(row(all_torques(report), share));
    let friction = errors.with_friction.as_ref();
    rows.extend(friction.map(|model| format!("  {WITH_FRICTION} alone: {}", model.share())));
    table(
        &format!("Torque errors on the test logs, {}", force_unit(report)),
        rows,
        errors.reduction_ci95,
    )
}

fn of_motion(report: &Report) -> Vec<String> {
    let error = &report.error;
    let (middle, _) = error.middle();
    let all = error.horizons_s.len() * report.joints <= ROWS;
    let horizons = (0..error.horizons_s.len()).filter(|h| all || *h == middle);
    let models = [&error.declared, &error.before, &error.after];
    let of = |h: usize, joint: Joint| {
        let name = format!(
            "joint {}, {} s ahead",
            report.label(joint),
            error.horizons_s[h]
        );
        row(
            &name,
            models.map(|model| small(model.position_rmse[h][joint])),
        )
    };
    let rows = horizons.flat_map(|h| Joint::all(report.joints).map(move |joint| (h, joint)));
    let rows = rows.map(|(h, joint)| of(h, joint)).collect();
    let friction = error.with_friction.iter();
    let friction =
        friction.map(|model| contender(report, &format!("{WITH_FRICTION} alone"), model));
    let others = (error.against.iter())
        .map(|other| contender(report, &format!("{}, no fit", other.name), &other.error));
    let others: Vec<String> = friction.chain(others).collect();
    let others = listed(others, OTHERS, "models");
    let rows = listed(rows, ROWS - others.len(), "joints");
    let others = others
        .iter()
        .flat_map(|model| paragraph("  ", model))
        .collect();
    let title = format!(
        "Open-loop errors on the test logs, {}",
        position_unit(report)
    );
    table(&title, [rows, others].concat(), error.reduction_ci95)
}

/// Another model, at the middle horizon.
fn contender(report: &Report, name: &str, model: &ModelError) -> String {
    let (middle, horizon_s) = report.error.middle();
    let errors: Vec<String> = model.position_rmse[middle]
        .iter()
        .map(|e| small(*e))
        .collect();
    format!("{name}, {horizon_s} s ahead: {}", errors.join(", "))
}

//! How much better: the errors on logs that were never fitted.

use maud::{Markup, html};

use super::{Section, table};
use crate::accuracy::{
    compared, compared_on_logs, diverged, fitted_tests, position_unit, removed, removed_of_motion,
    repeated, scored, scored_torques, uneven, zeroing_that_harms,
};
use crate::schema::{Report, TorqueEntry};
use crate::wording::{FITTED, WITH_EFFECTS, WITH_FRICTION, capitalised, small};
use residyn_core::closeloop::{ErrorModel, TestLog};
use residyn_core::data::Joint;

pub(super) fn section(report: &Report) -> Section {
    let torque = (report.torque.as_ref()).map(|torque| of_torques(report, torque));
    let motion = of_motion(report);
    let ordered = match report.compared {
        ErrorModel::OutputError => [Some(motion), torque],
        ErrorModel::InverseDynamics => [torque, Some(motion)],
    };
    let tested = fitted_tests(report).map_or_else(
        || ", to which nothing was fitted.".to_owned(),
        |fitted| format!(". {fitted}"),
    );
    Section {
        id: "better",
        question: "How much better is it?",
        answer: html! {
            p { "All errors are on the test logs" (tested) " \u{201c}" (FITTED) "\u{201d} has its own parameters "
                "fitted and no effect added: the fair \u{201c}before\u{201d} of every comparison. " (compared(report)) }
            @if report.error.with_friction.is_some() {
                p { "\u{201c}" (capitalised(WITH_FRICTION)) "\u{201d} has Coulomb and viscous friction on every joint as well: what "
                    "most engineers would try first." }
            }
            @for table in ordered.iter().flatten() { (table) }
            @if !report.error.by_log.is_empty() { (of_test_logs(report)) }
        },
    }
}

/// The head of a column of [`ratio`]s.
const RATIO: &str = "with effects / fitted";

/// A share of the error before, as a bar of that length.
fn ratio(after: f64, before: f64) -> Markup {
    let share = after / before.max(f64::MIN_POSITIVE);
    if !share.is_finite() {
        return html! { td { "-" } };
    }
    let width = 100.0 * share.clamp(0.0, 1.0);
    html! { td.ratio { span.bar.worse[share > 1.0] style={ "--share:" (format!("{width:.1}%")) } { (format!("{share:.2}")) } } }
}

fn of_torques(report: &Report, errors: &TorqueEntry) -> Markup {
    let models = scored_torques(errors);
    let names = models.iter().map(|(name, _)| *name);
    let rows = html! {
        @for joint in Joint::all(report.joints) {
            tr {
                th scope="row" { (report.label(joint)) }
                @for (_, model) in &models { td { (small(model.rms[joint])) } }
                (ratio(errors.after.rms[joint], errors.before.rms[joint]))
            }
        }
        tr {
            th scope="row" { "all, share of the logged torques" }
            @for (_, model) in &models { td { (model.share()) } }
            (ratio(errors.after.relative, errors.before.relative))
        }
    };
    html! {
        h3 { "Torques that the motion needs" }
        p { "Root mean square of their difference from the logged ones, both low-passed, in N m (N where a joint slides)." }
        (table(["joint"].into_iter().chain(names).chain([RATIO]), &rows))
        @if let Some(removed) = removed(errors.reduction_ci95, "error") { p { (removed) } }
        p { (repeated(report)) }
    }
}

fn of_motion(report: &Report) -> Markup {
    let error = &report.error;
    let models = scored(report);
    let names = models.iter().map(|(name, _)| *name);
    let rows = html! {
        @for (h, horizon) in error.horizons_s.iter().enumerate() {
            @for joint in Joint::all(report.joints) {
                tr {
                    th scope="row" { (horizon) " s" }
                    th scope="row" { (report.label(joint)) }
                    @for (_, model) in &models {
                        td { (small(model.position_rmse[h][joint])) " (" (small(model.position_median[h][joint])) ")" }
                    }
                    (ratio(error.after.position_rmse[h][joint], error.before.position_rmse[h][joint]))
                }
            }
        }
    };
    html! {
        h3 { "Open-loop motion" }
        p { "Root mean square of the position error, in " (position_unit(report)) "; in brackets the median over windows." }
        (table(["horizon", "joint"].into_iter().chain(names).chain([RATIO]), &rows))
        @for said in [removed_of_motion(error), uneven(report), zeroing_that_harms(error)].iter().flatten() { p { (said) } }
        @for (name, model) in &models {
            @if let Some(diverged) = diverged(name, model) { p { (diverged) } }
        }
    }
}

fn of_test_logs(report: &Report) -> Markup {
    let rows = html! {
        @for TestLog { log, before, after } in &report.error.by_log {
            @for joint in Joint::all(report.joints) {
                tr {
                    th scope="row" { (log) }
                    th scope="row" { (report.label(joint)) }
                    td { (small(before[joint])) }
                    td { (small(after[joint])) }
                    (ratio(after[joint], before[joint]))
                }
            }
        }
    };
    html! {
        h3 { "Log by log" }
        p { (compared_on_logs(report)) }
        (table(["log", "joint", FITTED, WITH_EFFECTS, RATIO], &rows))
    }
}

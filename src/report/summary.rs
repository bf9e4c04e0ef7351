use std::fmt::Write;

use super::calibration::line;
use super::json::PAGE;
use super::remainder::proposal_line;
use super::schema::{ModelError, Report, TorqueEntry};
use super::text::serious;
use super::wording::{AS_WRITTEN, FITTED, WITH_EFFECTS, small, values};
use crate::closeloop::{Space, Stage};
use crate::data::Joint;

/// The answer in a line.
pub fn answer(report: &Report) -> String {
    format!("{}: {}", report.headline, report.reason)
}

/// The answer for a terminal: a few lines, and where the rest is. `seconds` is how long each stage took.
pub fn summary(report: &Report, seconds: &[(Stage, f64)], folder: &std::path::Path) -> String {
    let mut out = serious(report).replace("**", "");
    let _ = writeln!(out, "{}", answer(report));
    for effect in &report.effects {
        let _ = writeln!(
            out,
            "  {} on joint {}: {}\n    {}",
            effect.title,
            effect.place,
            effect.expression,
            values(&effect.parameters).join("\n    ")
        );
    }
    if let Some(proposal) = &report.unexplained.proposal {
        let _ = writeln!(out, "  {}", proposal_line(proposal));
    }
    for name in &report.identifiability.held {
        let _ = writeln!(
            out,
            "  {name} is held, since the logs do not determine it: the other values are relative to it"
        );
    }
    out += &match (report.compared, &report.torque) {
        (Space::Torque, Some(torque)) => torques(torque),
        _ => open_loop(report),
    };
    out += &report.calibration.as_ref().map_or_else(String::new, line);
    let _ = writeln!(out, "  {}", took(seconds));
    let page = folder.join(PAGE);
    let _ = writeln!(
        out,
        "Open {}; model and plots are beside it",
        page.display()
    );
    out
}

/// The errors of the torques, one model a line.
fn torques(errors: &TorqueEntry) -> String {
    let mut out = String::from(
        "  torques that the motion of the test logs needs, share of the logged ones that differs:\n",
    );
    let models = [
        (AS_WRITTEN, &errors.as_declared),
        (FITTED, &errors.before),
        (WITH_EFFECTS, &errors.after),
    ];
    for (name, error) in models {
        let _ = writeln!(out, "  {name}: {:.2} %", 100.0 * error.relative);
    }
    out
}

/// The open-loop errors, one joint and horizon a line, and those of models that were not fitted.
fn open_loop(report: &Report) -> String {
    let error = &report.error;
    let mut out = String::from("  open-loop position error on the test logs, root mean square:\n");
    for (h, seconds) in error.horizons_s.iter().enumerate() {
        for joint in Joint::all(report.joints) {
            let [before, after] =
                [&error.before, &error.after].map(|model| small(model.position_rmse[h][joint]));
            let (joint, unit) = (report.label(joint), unit(report, joint));
            let _ = writeln!(
                out,
                "  joint {joint}, {seconds} s ahead: {FITTED} {before} {unit}; {WITH_EFFECTS} {after} {unit}"
            );
        }
    }
    let declared = (AS_WRITTEN, &error.declared);
    let against = error
        .against
        .iter()
        .map(|other| (other.name.as_str(), &other.error));
    for (name, model) in std::iter::once(declared).chain(against) {
        let _ = writeln!(out, "  {name}, no fit: {}", errors(report, model));
    }
    out
}

fn unit(report: &Report, joint: Joint) -> &'static str {
    match report.prismatic[joint] {
        true => "m",
        false => "rad",
    }
}

/// `joint 1 0.00942, 0.157, 0.375 rad at 0.1, 0.5, 1 s`
fn errors(report: &Report, model: &ModelError) -> String {
    let list = |numbers: &mut dyn Iterator<Item = String>| numbers.collect::<Vec<_>>().join(", ");
    let of_joint = |joint: Joint| {
        let errors = list(&mut model.position_rmse.iter().map(|row| small(row[joint])));
        format!(
            "joint {} {errors} {}",
            report.label(joint),
            unit(report, joint)
        )
    };
    let seconds = list(&mut report.error.horizons_s.iter().map(f64::to_string));
    format!(
        "{} at {seconds} s",
        list(&mut Joint::all(report.joints).map(of_joint))
    )
}

/// `took 48 s: selecting effects 31 s, scoring on the test logs 5 s`, the stages that took a tenth or more
fn took(seconds: &[(Stage, f64)]) -> String {
    let all: f64 = seconds.iter().map(|(_, seconds)| seconds).sum();
    let long = seconds.iter().filter(|(_, s)| *s >= 0.1 * all);
    let stages: Vec<String> = long
        .map(|(stage, seconds)| format!("{} {seconds:.1} s", stage.text()))
        .collect();
    format!("took {all:.1} s: {}", stages.join(", "))
}

use std::fmt::Write;

use super::calibration::line;
use super::remainder::proposal_line;
use super::text::{headline, label, place, serious};
use super::wording::{AS_WRITTEN, FITTED, WITH_EFFECTS, small, values};
use crate::closeloop::{Outcome, Space, TorqueErrors};
use crate::data::Joint;
use crate::sim::metric::{Assessment, Summary, summarise};

/// The answer for a terminal: a few lines, and where the rest is.
pub fn summary(outcome: &Outcome, folder: &std::path::Path) -> String {
    let mut out = format!(
        "{}: {}\n",
        headline(outcome).replace("**", ""),
        outcome.reason
    );
    out = serious(outcome).replace("**", "") + &out;
    for finding in &outcome.effects.findings {
        let name = finding.effect.title();
        let joint = place(outcome, &finding.effect);
        let _ = writeln!(
            out,
            "  {name} on joint {joint}: {}\n    {}",
            finding.expression,
            values(finding).join("\n    ")
        );
    }
    if let Some(proposal) = &outcome.remainder.proposal {
        let _ = writeln!(out, "  {}", proposal_line(proposal));
    }
    for &k in &outcome.models.identifiability.hold {
        let name = &outcome.models.before.model.all_parameters()[k].name;
        let _ = writeln!(
            out,
            "  {name} is held, since the logs do not determine it: the other values are relative to it"
        );
    }
    out += &match (outcome.space, &outcome.errors.torque) {
        (Space::Torque, Some(torque)) => torques(torque),
        _ => open_loop(outcome),
    };
    out += &outcome.calibration.as_ref().map_or_else(String::new, line);
    let _ = writeln!(out, "  {}", took(outcome));
    let _ = writeln!(out, "Report, model and plots are in {}", folder.display());
    out
}

/// The errors of the torques, one model a line.
fn torques(errors: &TorqueErrors) -> String {
    let mut out = String::from(
        "  torques that the motion of the test logs needs, share of the logged ones that differs:\n",
    );
    let models = [
        (AS_WRITTEN, &errors.declared),
        (FITTED, &errors.before),
        (WITH_EFFECTS, &errors.after),
    ];
    for (name, error) in models {
        let _ = writeln!(out, "  {name}: {:.2} %", 100.0 * error.relative);
    }
    out
}

/// The open-loop errors, one joint and horizon a line, and those of models that were not fitted.
fn open_loop(outcome: &Outcome) -> String {
    let mut out = String::new();
    let joints = outcome.models.after.model.joints;
    let numbers = |model: &Assessment| summarise(&model.horizons, joints).position_rmse;
    let (before, after) = (
        numbers(&outcome.errors.before),
        numbers(&outcome.errors.after),
    );
    out += "  open-loop position error on the test logs, root mean square:\n";
    for (h, horizon) in outcome.errors.before.horizons.iter().enumerate() {
        for joint in Joint::all(joints) {
            let unit = if outcome.given.prismatic[joint] {
                "m"
            } else {
                "rad"
            };
            let (before, after) = (small(before[h][joint]), small(after[h][joint]));
            let (joint, seconds) = (label(outcome, joint), horizon.horizon_s);
            let _ = writeln!(
                out,
                "  joint {joint}, {seconds} s ahead: {FITTED} {before} {unit}; {WITH_EFFECTS} {after} {unit}"
            );
        }
    }
    let declared = (AS_WRITTEN, &outcome.errors.declared);
    let against = outcome.errors.against.iter();
    let as_they_are = std::iter::once(declared).chain(against.map(|(name, m)| (name.as_str(), m)));
    for (name, model) in as_they_are {
        let _ = writeln!(out, "  {name}, no fit: {}", errors(outcome, model));
    }
    out
}

/// `joint 1 0.00942, 0.157, 0.375 rad at 0.1, 0.5, 1 s`
fn errors(outcome: &Outcome, model: &Assessment) -> String {
    let joints = outcome.models.after.model.joints;
    let Summary {
        horizons_s,
        position_rmse,
        ..
    } = summarise(&model.horizons, joints);
    let list = |numbers: &mut dyn Iterator<Item = String>| numbers.collect::<Vec<_>>().join(", ");
    let of_joint = |joint: Joint| {
        let unit = if outcome.given.prismatic[joint] {
            "m"
        } else {
            "rad"
        };
        let errors = list(&mut position_rmse.iter().map(|row| small(row[joint])));
        format!("joint {} {errors} {unit}", label(outcome, joint))
    };
    let seconds = list(&mut horizons_s.iter().map(f64::to_string));
    format!(
        "{} at {seconds} s",
        list(&mut Joint::all(joints).map(of_joint))
    )
}

/// `took 48 s: selecting effects 31 s, scoring on the test logs 5 s`, the stages that took a tenth or more
fn took(outcome: &Outcome) -> String {
    let all: f64 = outcome.seconds.iter().map(|(_, seconds)| seconds).sum();
    let long = outcome.seconds.iter().filter(|(_, s)| *s >= 0.1 * all);
    let stages: Vec<String> = long
        .map(|(stage, seconds)| format!("{} {seconds:.1} s", stage.text()))
        .collect();
    format!("took {all:.1} s: {}", stages.join(", "))
}

//! The sections of `report.md` on errors and on the values of the declared parameters.

use std::fmt::Write;

use super::schema::{ErrorEntry, IdentifiabilityEntry, ModelError, Report, TorqueEntry};
use super::wording::{
    AS_WRITTEN, FITTED, WITH_EFFECTS, WITH_NETWORK, ZEROED, amount, listed, small, value,
};
use crate::closeloop::Space;
use crate::data::{Joint, Quantity};
use crate::sim::metric::TorqueError;

/// More parameters than this that trade with one another are counted.
const MOST_NAMED: usize = 6;

/// The unit of positions: that of all joints, or both.
pub(super) fn position_unit(report: &Report) -> &'static str {
    match report.prismatic.iter().filter(|slides| **slides).count() {
        0 => "rad",
        all if all == report.prismatic.len() => "m",
        _ => "rad or m",
    }
}

/// Every model that was scored on the test logs, with its name in a table.
pub(super) fn scored(report: &Report) -> Vec<(&str, &ModelError)> {
    let error = &report.error;
    let mut models = vec![
        (AS_WRITTEN, &error.declared),
        (FITTED, &error.before),
        (WITH_EFFECTS, &error.after),
    ];
    models.extend(error.zeroed.iter().map(|m| (ZEROED, m)));
    models.extend(error.hybrid.iter().map(|m| (WITH_NETWORK, m)));
    let against = error.against.iter();
    models.extend(against.map(|other| (other.name.as_str(), &other.error)));
    models
}

const ABOUT_ZEROED: &str = " \"Zeroed\" is the model with effects where the zeros of each test log's sensors are estimated on \
                            its first second, and scored on the rest: what a rig gives that is zeroed before a run.";

/// What was compared, as a sentence.
pub(super) fn compared(report: &Report) -> String {
    match report.compared {
        Space::Motion => {
            let driving = match report.driven_by == Quantity::Command.key() {
                true => "commands",
                false => "torques",
            };
            format!(
                "Models are fitted to, selected and compared by the open-loop motion under the logged {driving}."
            )
        }
        Space::Torque => {
            "Models are fitted to, selected and compared by the torques that the logged motion needs: a controller prescribes \
             this motion, and what half a second of it under the logged torques would add up to says little. Values and names \
             hold for motions like these; a good fit cannot tell what no log moves, holds or loads."
                .to_owned()
        }
    }
}

/// Errors of the torques joint by joint, where they were compared.
pub(super) fn torques(report: &Report) -> String {
    let Some(errors) = (report.torque.as_ref()).filter(|_| report.compared == Space::Torque) else {
        return String::new();
    };
    let mut out = format!(
        "## Torque error on the test logs\n\nRoot mean square of the difference between the torques that the logged motion needs \
         and those logged, both low-passed, in N m (N where a joint slides). \"Fitted\" is the declared model with its own \
         parameters fitted to the training logs and no effect added.\n\n\
         | joint | {AS_WRITTEN} | {FITTED} | {WITH_EFFECTS} | with effects / fitted |\n|---|---|---|---|---|\n"
    );
    let TorqueEntry {
        as_declared: declared,
        before,
        after,
        reduction_ci95,
    } = errors;
    for joint in Joint::all(before.rms.len()) {
        let [declared, before, after] = [declared, before, after].map(|error| error.rms[joint]);
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {:.2} |",
            report.label(joint),
            small(declared),
            small(before),
            small(after),
            after / before.max(f64::MIN_POSITIVE)
        );
    }
    let percent = |error: &TorqueError| 100.0 * error.relative;
    let [declared, before, after] = [declared, before, after].map(percent);
    let _ = writeln!(
        out,
        "| all, share of the logged torques | {declared:.2} % | {before:.2} % | {after:.2} % | {:.2} |",
        after / before.max(f64::MIN_POSITIVE)
    );
    out += &paragraph(removed(*reduction_ci95, "error"));
    out + &repeated(report) + "\n"
}

/// What an error on test logs says that have the motion of others once more.
pub(super) fn repeated(report: &Report) -> String {
    let of_test = report.audit.iter().skip(report.logs.train.len());
    let repeats: Vec<String> = of_test
        .filter(|audit| audit.repeats.is_some())
        .map(|audit| audit.log.clone())
        .collect();
    if repeats.is_empty() {
        return String::new();
    }
    let of_bodies = match report.identifiability.bodies.is_empty() {
        true => "",
        false => {
            " Those are predicted no better than with the declared bodies and fitted friction where they need what these logs do \
             not tell of the bodies (see below)."
        }
    };
    format!(
        "\nThe motion of {} is that of another log once more: the error there says how well torques repeat, and nothing of other \
         motions.{of_bodies}\n",
        listed(&repeats)
    )
}

/// How much of an error of the fitted declared model the effects remove, where an interval is known.
pub(super) fn removed(reduction_ci95: Option<[f64; 2]>, error: &str) -> Option<String> {
    let [low, high] = reduction_ci95?;
    Some(format!(
        "The effects remove {:.0} to {:.0} % of the fitted declared model's {error} (95 % interval, bootstrap over parts of the test logs).",
        100.0 * low,
        100.0 * high
    ))
}

/// The same of the open-loop error.
pub(super) fn removed_of_motion(error: &ErrorEntry) -> Option<String> {
    let of = format!("error at {} s", error.middle().1);
    removed(error.reduction_ci95, &of)
}

/// In how many windows a model diverged, if in any.
pub(super) fn diverged(name: &str, model: &ModelError) -> Option<String> {
    let windows: usize = model.diverged.iter().sum();
    (windows > 0).then(|| {
        format!("{name}: {windows} windows diverged; each counts with the error reached by then.")
    })
}

/// A paragraph, where there is something to say.
fn paragraph(sentence: Option<String>) -> String {
    sentence.map_or_else(String::new, |sentence| format!("\n{sentence}\n"))
}

pub(super) fn errors(report: &Report) -> String {
    let models = scored(report);
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let mut out = format!(
        "## Open-loop error on the test logs\n\nRoot mean square of the position error in {}; in brackets the median over \
         windows. \"Fitted\" is the declared model with its own parameters fitted to the training logs and no effect added: \
         the fair \"before\" of every comparison in this report.{}\n\n\
         | horizon | joint | windows | {} | with effects / fitted |\n|---|---|---|{}---|\n",
        position_unit(report),
        [
            report.error.zeroed.as_ref().map_or("", |_| ABOUT_ZEROED),
            if report.error.against.is_empty() {
                ""
            } else {
                " The last models are other files, scored as they are."
            },
        ]
        .concat(),
        names.join(" | "),
        "---|".repeat(names.len())
    );
    let (before, after) = (&report.error.before, &report.error.after);
    for (h, horizon) in report.error.horizons_s.iter().enumerate() {
        for joint in Joint::all(report.joints) {
            let rmse = |s: &ModelError| s.position_rmse[h][joint];
            let cell = |(_, s): &(&str, &ModelError)| {
                format!(
                    "{} ({})",
                    small(rmse(s)),
                    small(s.position_median[h][joint])
                )
            };
            let cells: Vec<String> = models.iter().map(cell).collect();
            let _ = writeln!(
                out,
                "| {horizon} s | {} | {} | {} | {:.2} |",
                report.label(joint),
                before.windows[h],
                cells.join(" | "),
                rmse(after) / rmse(before).max(f64::MIN_POSITIVE)
            );
        }
    }
    for (name, model) in &models {
        out += &paragraph(diverged(name, model));
    }
    if let (Some(torque), Space::Motion) = (&report.torque, report.compared) {
        let percent = |error: &TorqueError| 100.0 * error.relative;
        let _ = writeln!(
            out,
            "\nThe torques that the logged motion needs, low-passed, differ from the logged ones by {:.2} % ({AS_WRITTEN}), \
             {:.2} % ({FITTED}) and {:.2} % ({WITH_EFFECTS}), root mean square.",
            percent(&torque.as_declared),
            percent(&torque.before),
            percent(&torque.after)
        );
    }
    for horizon in &report.error.unscored_s {
        let _ = writeln!(
            out,
            "\nNo test log holds a window of {horizon} s, so no error is given at that horizon."
        );
    }
    out += &paragraph(removed_of_motion(&report.error));
    out + "\n![predictions](predictions.svg)\n\n![errors](errors.svg)\n\n"
}

pub(super) fn parameters(report: &Report) -> String {
    let mut out = String::from("## Parameters of the declared equations\n\n");
    for one in &report.parameters {
        let _ = writeln!(
            out,
            "- {}; fitted without the effects: {:.5}",
            value(&one.fitted),
            one.before
        );
    }
    let known = &report.identifiability;
    let _ = writeln!(
        out,
        "\nThe logs determine {} of {} free parameters.",
        known.determined, known.free
    );
    let fits = &report.fits;
    for (name, fit) in [(FITTED, &fits.before), (WITH_EFFECTS, &fits.after)] {
        let [as_is, scaled] = fit.condition.map(|number| number.unwrap_or(f64::INFINITY));
        let _ = writeln!(
            out,
            "- Fit ({name}): {} ({} steps; condition number {as_is:.1e}, {scaled:.1e} after scaling).",
            fit.termination, fit.steps
        );
    }
    if !fits.moved_to.is_empty() {
        let all: Vec<String> = (fits.moved_to.iter())
            .map(|(name, value)| format!("`{name}` = {value:.3}"))
            .collect();
        let _ = writeln!(
            out,
            "- With the values in its file the model diverges in these logs: the fit began at {}.",
            listed(&all)
        );
    }
    for name in &known.held {
        let _ = writeln!(out, "- `{name}` is held: {}", why_held(known, name));
    }
    out + "\n"
}

/// What the logs do not tell of a parameter.
fn why_held(verdict: &IdentifiabilityEntry, name: &str) -> String {
    let weight = |direction: &&Vec<(String, f64)>| {
        let own = direction.iter().find(|(other, _)| other == name);
        own.map_or(0.0, |(_, weight)| weight.abs())
    };
    let directions = verdict.undetermined.iter();
    let direction = directions.max_by(|a, b| weight(a).total_cmp(&weight(b)));
    let others: Vec<String> = (direction.into_iter().flatten())
        .filter(|(other, _)| other != name)
        .map(|(other, _)| format!("`{other}`"))
        .collect();
    let with = match others.len() {
        0 => return "the logs do not show it, and it stays at its declared value.".to_owned(),
        1..=MOST_NAMED => listed(&others),
        _ => format!("{} others", others.len()),
    };
    format!(
        "it trades with {with}, and the logs tell only their combination. It stays as near to its declared value as they allow; \
         intervals of the others, and of effects, are relative to it."
    )
}

/// Which numbers of the model file do not hold for these logs.
pub(super) fn contradicted(report: &Report) -> String {
    if report.contradicted.is_empty() {
        return String::new();
    }
    let error = &report.error;
    let (middle, horizon_s) = error.middle();
    let [written, fitted] = [&error.declared, &error.before].map(|model| model.of_all(middle));
    let mut out = format!(
        "## Declared values that these logs contradict\n\nOn the test logs, {} s ahead, the position error of the declared model \
         is {} {unit} with the values in its file and {} {unit} with its parameters fitted to the training logs. These declared \
         values lie outside the 95 % intervals of the final fit, which includes the effects found:\n\n",
        horizon_s,
        small(written),
        small(fitted),
        unit = position_unit(report),
    );
    for one in &report.contradicted {
        let _ = writeln!(
            out,
            "- {}: declared {}, fitted {}: {}",
            one.fitted.name,
            one.declared,
            amount(&one.fitted),
            one.comparison
        );
    }
    out + "\nmodel.toml holds the fitted values. If a declared value comes from another log, check that log with `residyn audit`; \
           if it comes from a drawing, look for a wrong unit, gear ratio or torque constant.\n\n"
}

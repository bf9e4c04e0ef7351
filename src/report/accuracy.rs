//! The sections of `report.md` on errors and on the values of the declared parameters.

use std::fmt::Write;

use super::text::label;
use super::wording::{
    AS_WRITTEN, FITTED, WITH_EFFECTS, WITH_NETWORK, ZEROED, amount, listed, small, value,
};
use crate::closeloop::{Outcome, Space, TorqueErrors};
use crate::data::{Audit, Joint, Quantity};
use crate::identify::Identifiability;
use crate::sim::metric::{Summary, TorqueError, summarise};

/// More parameters than this that trade with one another are counted.
const MOST_NAMED: usize = 6;

/// The unit of positions: that of all joints, or both.
fn position_unit(outcome: &Outcome) -> &'static str {
    let sliding = outcome
        .given
        .prismatic
        .iter()
        .filter(|slides| **slides)
        .count();
    match sliding {
        0 => "rad",
        all if all == outcome.given.prismatic.len() => "m",
        _ => "rad or m",
    }
}

/// Every model that was scored on the test logs, with its name in a table.
fn scored(outcome: &Outcome) -> Vec<(&str, Summary)> {
    let errors = &outcome.errors;
    let mut models = vec![
        (AS_WRITTEN, &errors.declared),
        (FITTED, &errors.before),
        (WITH_EFFECTS, &errors.after),
    ];
    models.extend(errors.zeroed.iter().map(|m| (ZEROED, m)));
    let hybrid = errors.hybrid.iter();
    models.extend(hybrid.map(|m| (WITH_NETWORK, m)));
    models.extend(errors.against.iter().map(|(name, m)| (name.as_str(), m)));
    let joints = outcome.models.after.model.joints;
    models
        .into_iter()
        .map(|(name, model)| (name, summarise(&model.horizons, joints)))
        .collect()
}

const ABOUT_ZEROED: &str = " \"Zeroed\" is the model with effects where the zeros of each test log's sensors are estimated on \
                            its first second, and scored on the rest: what a rig gives that is zeroed before a run.";

/// What was compared, as a sentence.
pub(super) fn compared(outcome: &Outcome) -> String {
    match outcome.space {
        Space::Motion => {
            let driving = match outcome.models.after.model.driven_by() {
                Quantity::Command => "commands",
                _ => "torques",
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
pub(super) fn torques(outcome: &Outcome) -> String {
    let Some(errors) = (outcome.errors.torque.as_ref()).filter(|_| outcome.space == Space::Torque)
    else {
        return String::new();
    };
    let mut out = format!(
        "## Torque error on the test logs\n\nRoot mean square of the difference between the torques that the logged motion needs \
         and those logged, both low-passed, in N m (N where a joint slides). \"Fitted\" is the declared model with its own \
         parameters fitted to the training logs and no effect added.\n\n\
         | joint | {AS_WRITTEN} | {FITTED} | {WITH_EFFECTS} | with effects / fitted |\n|---|---|---|---|---|\n"
    );
    let TorqueErrors {
        declared,
        before,
        after,
        reduction_ci95,
    } = errors;
    for joint in Joint::all(before.rms.len()) {
        let [declared, before, after] = [declared, before, after].map(|error| error.rms[joint]);
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {:.2} |",
            label(outcome, joint),
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
    out += &removed(*reduction_ci95, "error");
    out + &repeated(outcome) + "\n"
}

/// What an error on test logs says that have the motion of others once more.
fn repeated(outcome: &Outcome) -> String {
    let of_test = &outcome.given.audits[outcome.given.train.len()..];
    let is_repeat = |audit: &&Audit| audit.repeats.is_some();
    let repeats: Vec<String> = (of_test.iter().filter(is_repeat))
        .map(|audit| audit.log.clone())
        .collect();
    if repeats.is_empty() {
        return String::new();
    }
    let of_bodies = match outcome.models.bodies.told.is_empty() {
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
fn removed(reduction_ci95: Option<[f64; 2]>, error: &str) -> String {
    reduction_ci95.map_or_else(String::new, |[low, high]| {
        format!(
            "\nThe effects remove {:.0} to {:.0} % of the fitted declared model's {error} (95 % interval, bootstrap over parts of the test logs).\n",
            100.0 * low,
            100.0 * high
        )
    })
}

pub(super) fn errors(outcome: &Outcome) -> String {
    let models = scored(outcome);
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let mut out = format!(
        "## Open-loop error on the test logs\n\nRoot mean square of the position error in {}; in brackets the median over \
         windows. \"Fitted\" is the declared model with its own parameters fitted to the training logs and no effect added: \
         the fair \"before\" of every comparison in this report.{}\n\n\
         | horizon | joint | windows | {} | with effects / fitted |\n|---|---|---|{}---|\n",
        position_unit(outcome),
        [
            outcome.errors.zeroed.as_ref().map_or("", |_| ABOUT_ZEROED),
            if outcome.errors.against.is_empty() {
                ""
            } else {
                " The last models are other files, scored as they are."
            },
        ]
        .concat(),
        names.join(" | "),
        "---|".repeat(names.len())
    );
    let (before, after) = (&models[1].1, &models[2].1);
    for (h, horizon) in before.horizons_s.iter().enumerate() {
        for joint in Joint::all(outcome.models.after.model.joints) {
            let rmse = |s: &Summary| s.position_rmse[h][joint];
            let cell = |(_, s): &(&str, Summary)| {
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
                label(outcome, joint),
                before.windows[h],
                cells.join(" | "),
                rmse(after) / rmse(before).max(f64::MIN_POSITIVE)
            );
        }
    }
    for (name, model) in &models {
        let diverged: usize = model.diverged.iter().sum();
        if diverged > 0 {
            let _ = writeln!(
                out,
                "\n{name}: {diverged} windows diverged; each counts with the error reached by then."
            );
        }
    }
    if let (Some(torque), Space::Motion) = (&outcome.errors.torque, outcome.space) {
        let percent = |error: &TorqueError| 100.0 * error.relative;
        let _ = writeln!(
            out,
            "\nThe torques that the logged motion needs, low-passed, differ from the logged ones by {:.2} % ({AS_WRITTEN}), \
             {:.2} % ({FITTED}) and {:.2} % ({WITH_EFFECTS}), root mean square.",
            percent(&torque.declared),
            percent(&torque.before),
            percent(&torque.after)
        );
    }
    for horizon in &outcome.given.unscored_s {
        let _ = writeln!(
            out,
            "\nNo test log holds a window of {horizon} s, so no error is given at that horizon."
        );
    }
    let middle_s = before.horizons_s[before.horizons_s.len() / 2];
    let error = format!("error at {middle_s} s");
    out += &removed(outcome.errors.reduction_ci95, &error);
    out + "\n![predictions](predictions.svg)\n\n![errors](errors.svg)\n\n"
}

pub(super) fn parameters(outcome: &Outcome) -> String {
    let mut out = String::from("## Parameters of the declared equations\n\n");
    let after = outcome.models.after.model.absorbed();
    for (parameter, before) in after
        .parameters
        .iter()
        .zip(&outcome.models.before.model.parameters)
    {
        let _ = writeln!(
            out,
            "- {}; fitted without the effects: {:.5}",
            value(parameter),
            before.value
        );
    }
    let verdict = &outcome.models.identifiability;
    let _ = writeln!(
        out,
        "\nThe logs determine {} of {} free parameters.",
        verdict.determined, verdict.free
    );
    for (name, model) in [
        (FITTED, &outcome.models.before),
        (WITH_EFFECTS, &outcome.models.after),
    ] {
        let (steps, termination) = (model.fit.steps, model.fit.termination);
        let [as_is, scaled] = model.fit.condition();
        let _ = writeln!(
            out,
            "- Fit ({name}): {termination} ({steps} steps; condition number {as_is:.1e}, {scaled:.1e} after scaling)."
        );
    }
    if !outcome.models.moved_to.is_empty() {
        let all = outcome.models.moved_to.iter();
        let all: Vec<String> = all
            .map(|p| format!("`{}` = {:.3}", p.name, p.value))
            .collect();
        let _ = writeln!(
            out,
            "- With the values in its file the model diverges in these logs: the fit began at {}.",
            listed(&all)
        );
    }
    for &k in &verdict.hold {
        let name = &outcome.models.before.model.all_parameters()[k].name;
        let _ = writeln!(out, "- `{name}` is held: {}", why_held(verdict, name));
    }
    out + "\n"
}

/// What the logs do not tell of a parameter.
fn why_held(verdict: &Identifiability, name: &str) -> String {
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
pub(super) fn contradicted(outcome: &Outcome) -> String {
    if outcome.models.contradicted.is_empty() {
        return String::new();
    }
    let errors = &outcome.errors;
    let (written, fitted) = (errors.declared.position_rms(), errors.before.position_rms());
    let mut out = format!(
        "## Declared values that these logs contradict\n\nOn the test logs, {} s ahead, the position error of the declared model \
         is {} {unit} with the values in its file and {} {unit} with its parameters fitted to the training logs. These declared \
         values lie outside the 95 % intervals of the final fit, which includes the effects found:\n\n",
        errors.before.middle().horizon_s,
        small(written),
        small(fitted),
        unit = position_unit(outcome),
    );
    for one in &outcome.models.contradicted {
        let _ = writeln!(
            out,
            "- {}: declared {}, fitted {}: {}",
            one.fitted.name,
            one.declared,
            amount(&one.fitted),
            one.comparison()
        );
    }
    out + "\nmodel.toml holds the fitted values. If a declared value comes from another log, check that log with `residyn audit`; \
           if it comes from a drawing, look for a wrong unit, gear ratio or torque constant.\n\n"
}

//! The sections of `report.md` on errors and on the values of the declared parameters.

use std::fmt::Write;

use super::schema::{ErrorEntry, IdentifiabilityEntry, ModelError, Report, TorqueEntry};
use super::wording::{
    AS_WRITTEN, FITTED, WITH_EFFECTS, WITH_FRICTION, WITH_NETWORK, ZEROED, amount, listed, small,
    value,
};
use residyn_core::closeloop::{ErrorModel, TestLog};
use residyn_core::data::{Joint, Quantity};
use residyn_core::sim::metric::TorqueError;

/// Above this ratio of an error to its median, a few windows make up most of the error.
const UNEVEN: f64 = 5.0;

/// More parameters than this that trade off against one another are counted, not named.
const MOST_NAMED: usize = 6;

/// The unit of positions: the one that all joints share, or both.
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
    let mut models = vec![(AS_WRITTEN, &error.declared), (FITTED, &error.before)];
    models.extend(error.with_friction.iter().map(|m| (WITH_FRICTION, m)));
    models.push((WITH_EFFECTS, &error.after));
    models.extend(error.zeroed.iter().map(|m| (ZEROED, m)));
    models.extend(error.hybrid.iter().map(|m| (WITH_NETWORK, m)));
    let against = error.against.iter();
    models.extend(against.map(|other| (other.name.as_str(), &other.error)));
    models
}

/// Every model whose torques were scored, with its name in a table.
pub(super) fn scored_torques(errors: &TorqueEntry) -> Vec<(&'static str, &TorqueError)> {
    let mut models = vec![(AS_WRITTEN, &errors.as_declared), (FITTED, &errors.before)];
    models.extend(errors.with_friction.iter().map(|m| (WITH_FRICTION, m)));
    models.push((WITH_EFFECTS, &errors.after));
    models
}

/// Explains the models in a table.
pub(super) fn about_models(has_friction: bool) -> String {
    let friction = match has_friction {
        true => {
            " \"With baseline friction\" has Coulomb and viscous friction on every joint as well: what most engineers would try first."
        }
        false => "",
    };
    format!(
        "\"Fitted\" is the declared model with its own parameters fitted to the training logs and no effect added: the fair \
         \"before\" of every comparison.{friction}"
    )
}

const ABOUT_ZEROED: &str = " \"Zeroed\" is the model with effects, with the zeros of each test log's sensors estimated on \
                            its first second, and scored on the rest: as on a rig that is zeroed before each run.";

/// A warning that test logs were fitted as well, so that the errors on them test nothing; `None` if none was.
pub(super) fn fitted_tests(report: &Report) -> Option<String> {
    let fitted = &report.error.fitted_logs;
    let (were, their, say) = match fitted.len() {
        0 => return None,
        1 => ("was", "its error", "says"),
        _ => ("were", "their errors", "say"),
    };
    Some(format!(
        "{} {were} fitted as well: {their} {say} how well the models fit, not how well they predict.",
        listed(fitted)
    ))
}

/// What was compared, as a sentence.
pub(super) fn compared(report: &Report) -> String {
    match report.compared {
        ErrorModel::OutputError => {
            let driving = match report.driven_by == Quantity::Command.key() {
                true => "commands",
                false => "torques",
            };
            format!(
                "Models are fitted to, selected and compared by the open-loop motion under the logged {driving}."
            )
        }
        ErrorModel::InverseDynamics => {
            "Models are fitted to, selected and compared by the torques that the logged motion needs: a controller \
             prescribes this motion, so half a second of open-loop integration under the logged torques says little. \
             Values and names hold for motions like these; a good fit says nothing about what no log moves, holds or \
             loads."
                .to_owned()
        }
    }
}

/// Torque errors joint by joint, if torques were compared.
pub(super) fn torques(report: &Report) -> String {
    let Some(errors) =
        (report.torque.as_ref()).filter(|_| report.compared == ErrorModel::InverseDynamics)
    else {
        return String::new();
    };
    let models = scored_torques(errors);
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let mut out = format!(
        "## Torque error on the test logs\n\n{}Root mean square of the difference between the torques that the logged motion needs \
         and those logged, both low-passed, in N m (N where a joint slides). {}\n\n\
         | joint | {} | with effects / fitted |\n|---|{}---|\n",
        not_tested(report),
        about_models(errors.with_friction.is_some()),
        names.join(" | "),
        "---|".repeat(names.len())
    );
    let mut row = |name: &str, cells: Vec<String>, ratio: f64| {
        let ratio = match ratio.is_finite() {
            true => format!("{ratio:.2}"),
            false => "-".to_owned(),
        };
        let _ = writeln!(out, "| {name} | {} | {ratio} |", cells.join(" | "));
    };
    let ratio = |error: &dyn Fn(&TorqueError) -> f64| {
        error(&errors.after) / error(&errors.before).max(f64::MIN_POSITIVE)
    };
    for joint in Joint::all(report.joints) {
        let cells = models.iter().map(|(_, error)| small(error.rms[joint]));
        row(
            &report.label(joint),
            cells.collect(),
            ratio(&|error| error.rms[joint]),
        );
    }
    let cells = models.iter().map(|(_, error)| error.share());
    row(
        "all, share of the logged torques",
        cells.collect(),
        ratio(&|error| error.relative),
    );
    out += &of_test_logs(report);
    out += &paragraph(removed(errors.reduction_ci95, "error"));
    out + &repeated(report) + "\n"
}

/// What the error says on test logs that repeat the motion of others.
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
            " Those are predicted no better than with the declared bodies and fitted friction if they depend on what \
             these logs leave open about the bodies (see below)."
        }
    };
    format!(
        "\nThe motion of {} repeats that of another log: the error there says how well torques repeat, and nothing \
         about other motions.{of_bodies}\n",
        listed(&repeats)
    )
}

/// Whether there is a reduction at all: without an effect the two models are the same.
pub(super) fn is_some_reduction(ci95: &[f64; 2]) -> bool {
    *ci95 != [0.0, 0.0]
}

/// How much of the fitted declared model's error the effects remove, if an interval is known.
pub(super) fn removed(reduction_ci95: Option<[f64; 2]>, error: &str) -> Option<String> {
    let [low, high] = reduction_ci95.filter(is_some_reduction)?;
    Some(format!(
        "The effects remove {:.0} to {:.0} % of the fitted declared model's {error} (95 % interval, bootstrap over parts of the test logs).",
        100.0 * low,
        100.0 * high
    ))
}

/// As above, for the open-loop error.
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

/// What is compared on single test logs.
pub(super) fn compared_on_logs(report: &Report) -> String {
    match report.compared {
        ErrorModel::OutputError => format!(
            "Position errors at {} s on each test log, in {}.",
            report.error.middle().1,
            position_unit(report)
        ),
        ErrorModel::InverseDynamics => {
            "Torque errors on each test log, in N m (N where a joint slides).".to_owned()
        }
    }
}

/// The errors on single test logs as a table; empty for a single log.
fn of_test_logs(report: &Report) -> String {
    let logs = &report.error.by_log;
    if logs.is_empty() {
        return String::new();
    }
    let mut out = format!(
        "\n{}\n\n| log | joint | {FITTED} | {WITH_EFFECTS} | with effects / fitted |\n|---|---|---|---|---|\n",
        compared_on_logs(report)
    );
    for TestLog { log, before, after } in logs {
        for joint in Joint::all(report.joints) {
            let (before, after) = (before[joint], after[joint]);
            let _ = writeln!(
                out,
                "| {log} | {} | {} | {} | {:.2} |",
                report.label(joint),
                small(before),
                small(after),
                after / before.max(f64::MIN_POSITIVE)
            );
        }
    }
    out
}

/// Which joints owe most of their error to a few windows.
pub(super) fn uneven(report: &Report) -> Option<String> {
    let (h, horizon_s) = report.error.middle();
    let after = &report.error.after;
    let share = |joint: Joint| {
        after.position_rmse[h][joint] / after.position_median[h][joint].max(f64::MIN_POSITIVE)
    };
    let uneven = Joint::all(report.joints).filter(|joint| share(*joint) > UNEVEN);
    let message: Vec<String> = uneven
        .map(|joint| format!("{:.0} times on joint {}", share(joint), report.label(joint)))
        .collect();
    (!message.is_empty()).then(|| {
        format!(
            "With effects, the error at {horizon_s} s is many times its median over windows ({}): a few windows make up most of \
             it. The pictures show the worst one.",
            listed(&message)
        )
    })
}

/// A warning if zeros estimated on the first second do worse than none.
pub(super) fn zeroing_that_harms(error: &ErrorEntry) -> Option<String> {
    let sum = |model: &ModelError| model.position_rmse[error.middle().0].iter().sum::<f64>();
    let zeroed = error.zeroed.as_ref()?;
    (sum(zeroed) > sum(&error.after)).then(|| {
        "Zeroing makes the error worse here: the first second of these logs does not separate the zeros from other \
         errors. Zero the rig itself, or leave the zeros out."
            .to_owned()
    })
}

/// [`fitted_tests`] as a paragraph above a table.
fn not_tested(report: &Report) -> String {
    fitted_tests(report).map_or_else(String::new, |sentence| format!("{sentence}\n\n"))
}

/// A paragraph, if there is something to say.
fn paragraph(sentence: Option<String>) -> String {
    sentence.map_or_else(String::new, |sentence| format!("\n{sentence}\n"))
}

pub(super) fn errors(report: &Report) -> String {
    let models = scored(report);
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let mut out = format!(
        "## Open-loop error on the test logs\n\n{}Root mean square of the position error in {}; in brackets the median over \
         windows. {}{}\n\n\
         | horizon | joint | windows | {} | with effects / fitted |\n|---|---|---|{}---|\n",
        not_tested(report),
        position_unit(report),
        about_models(report.error.with_friction.is_some()),
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
    out += &rows_of_errors(report, &models);
    for (name, model) in &models {
        out += &paragraph(diverged(name, model));
    }
    if report.compared == ErrorModel::OutputError {
        out += &of_test_logs(report);
    }
    out += &paragraph(uneven(report));
    out += &paragraph(zeroing_that_harms(&report.error));
    if let (Some(torque), ErrorModel::OutputError) = (&report.torque, report.compared) {
        let _ = writeln!(
            out,
            "\nThe torques that the logged motion needs, low-passed, differ from the logged ones by {} ({AS_WRITTEN}), \
             {} ({FITTED}) and {} ({WITH_EFFECTS}), root mean square.",
            torque.as_declared.share(),
            torque.before.share(),
            torque.after.share()
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

/// A row of the table for each horizon and joint.
fn rows_of_errors(report: &Report, models: &[(&str, &ModelError)]) -> String {
    let mut out = String::new();
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
    out
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
            "- With the values in its file the model diverges on these logs: the fit began at {}.",
            listed(&all)
        );
    }
    for name in &known.held {
        let _ = writeln!(out, "- `{name}` is held: {}", why_held(known, name));
    }
    out + "\n"
}

/// What the logs leave open about a parameter.
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
        0 => return "the logs do not determine it, so it stays at its declared value.".to_owned(),
        1..=MOST_NAMED => listed(&others),
        _ => format!("{} others", others.len()),
    };
    format!(
        "it trades off against {with}, and the logs determine only their combination. It stays as close to its \
         declared value as they allow; intervals of the others, and of effects, are conditional on it."
    )
}

/// The values in the model file that do not hold for these logs.
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

//! How much better: the errors on logs that were never fitted.

use super::{Block, Cell, cell, folded_if_large, heading, paragraph, paragraphs, table};
use crate::overview::is_large;
use crate::schema::{ErrorEntry, ModelError, Report};
use crate::wording::{
    AS_WRITTEN, FITTED, WITH_EFFECTS, WITH_FRICTION, WITH_NETWORK, ZEROED, capitalised, listed,
    small,
};
use residyn_core::closeloop::{ErrorModel, SCALE_OF, TestLog, TorqueErrors};
use residyn_core::data::{Joint, Quantity};
use residyn_core::sim::metric::TorqueError;

/// Above this ratio of an error to its median, a few windows make up most of the error.
const UNEVEN: f64 = 5.0;

/// The head of the column of ratios.
const RATIO: &str = "with effects / fitted";

pub(super) fn answer(report: &Report) -> Vec<Block> {
    let torque = report.torque.as_ref();
    let torque = torque.map(|torque| of_torques(report, torque));
    let mut errors = [of_motion(report), torque.unwrap_or_default()];
    if judges_by_torques(report) {
        errors.reverse();
    }
    [about(report), errors.concat(), of_test_logs(report)].concat()
}

/// Whether the torques show how good a model is. Where drives hold commanded positions, the motion does: closed loops do not
/// diverge.
pub(crate) fn judges_by_torques(report: &Report) -> bool {
    report.compared == ErrorModel::InverseDynamics && !is_commanded(report)
}

fn is_commanded(report: &Report) -> bool {
    report.driven_by == Quantity::Command.key()
}

/// What the models are, and what was compared.
fn about(report: &Report) -> Vec<Block> {
    let tested = fitted_tests(report).map_or_else(
        || ", to which nothing was fitted.".to_owned(),
        |fitted| format!(". {fitted}"),
    );
    let models = format!(
        "All errors are on the test logs{tested} \u{201c}{FITTED}\u{201d} has its own parameters fitted and no effect added: the \
         fair \u{201c}before\u{201d} of every comparison. {}",
        compared(report)
    );
    let friction = report.error.with_friction.as_ref().map(|_| {
        paragraph(format!(
            "\u{201c}{}\u{201d} has Coulomb and viscous friction on every joint as well: what most engineers would try first.",
            capitalised(WITH_FRICTION)
        ))
    });
    [paragraph(models)].into_iter().chain(friction).collect()
}

/// A warning that test logs were fitted as well, so that the errors on them test nothing; `None` if none was.
pub(crate) fn fitted_tests(report: &Report) -> Option<String> {
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

fn compared(report: &Report) -> String {
    match report.compared {
        ErrorModel::OutputError => {
            let driving = match is_commanded(report) {
                true => "commands",
                false => "torques",
            };
            format!(
                "Models are fitted to, selected and compared by the open-loop motion under the logged {driving}."
            )
        }
        ErrorModel::InverseDynamics if is_commanded(report) => {
            let by_law =
                "Models are fitted and effects are selected by the torques that the logged motion needs, compared with \
                 those that the law of the drives asks for; models are compared by the motion under the logged commands. \
                 No torque was measured: the gains of the law are the scale of all forces and inertias.";
            [&[by_law.to_owned()], scales(report).as_slice()].concat().join(" ")
        }
        ErrorModel::InverseDynamics => {
            "Models are fitted to, selected and compared by the torques that the logged motion needs: a controller \
             or a bench prescribes this motion, so half a second of open-loop integration under the logged torques says little. \
             Values and names hold for motions like these; a good fit says nothing about what no log moves, holds or \
             loads."
                .to_owned()
        }
    }
}

/// What tells the scale of the gains that were sought, in sentences.
fn scales(report: &Report) -> Vec<String> {
    let findings = report.audit.iter().flat_map(|audit| &audit.findings);
    let told = findings.filter(|finding| finding.text.starts_with(SCALE_OF));
    told.map(|finding| capitalised(&finding.text) + ".")
        .collect()
}

/// What the last row of a table of torque errors gives.
pub(crate) fn all_torques(report: &Report) -> &'static str {
    match is_commanded(report) {
        true => "all, share of what the drives ask for",
        false => "all, share of the logged torques",
    }
}

/// A share of the error before, as a bar of that length.
fn ratio(after: f64, before: f64) -> Cell {
    let share = after / before.max(f64::MIN_POSITIVE);
    match share.is_finite() {
        true => Cell {
            bar: Some(share),
            ..cell(format!("{share:.2}"))
        },
        false => cell("-"),
    }
}

/// The errors of one joint.
pub(super) fn of_joint(report: &Report, joint: Joint) -> Vec<Block> {
    let torques = report.torque.iter();
    let torques = torques.map(|errors| torque_table(report, errors, &[joint]));
    [motion_table(report, &[joint])]
        .into_iter()
        .chain(torques)
        .collect()
}

/// A row for each of these joints, and one for all.
fn torque_table(report: &Report, errors: &TorqueErrors, joints: &[Joint]) -> Block {
    let mut models = vec![(AS_WRITTEN, &errors.declared), (FITTED, &errors.before)];
    models.extend(errors.with_friction.iter().map(|m| (WITH_FRICTION, m)));
    models.push((WITH_EFFECTS, &errors.after));
    let row = |name: String, text: &dyn Fn(&TorqueError) -> String, share: Cell| {
        let errors = models.iter().map(|(_, error)| cell(text(error)));
        [cell(name)]
            .into_iter()
            .chain(errors)
            .chain([share])
            .collect()
    };
    let of_joint = |joint: Joint| {
        let share = ratio(errors.after.rms[joint], errors.before.rms[joint]);
        row(report.label(joint), &|error| small(error.rms[joint]), share)
    };
    let all = row(
        all_torques(report).to_owned(),
        &TorqueError::share,
        ratio(errors.after.relative, errors.before.relative),
    );
    let names = models.iter().map(|(name, _)| *name);
    let heads = ["joint"].into_iter().chain(names).chain([RATIO]);
    table(1, heads, joints.iter().copied().map(of_joint).chain([all]))
}

fn of_torques(report: &Report, errors: &TorqueErrors) -> Vec<Block> {
    let joints: Vec<Joint> = Joint::all(report.joints).collect();
    let table = torque_table(report, errors, &joints);
    let remarks = [
        bootstrapped(errors.reduction_ci95, "error"),
        repeated(report),
    ];
    let about = format!(
        "Root mean square of their difference from the logged ones, both low-passed, in {}.",
        force_unit(report)
    );
    let title = heading("Torques that the motion needs");
    let remarks = paragraphs(remarks.into_iter().flatten());
    let table = folded_if_large(report, "The torques of each joint", vec![table]);
    [vec![title, paragraph(about)], table, remarks].concat()
}

/// What the error says on test logs that repeat the motion of others.
fn repeated(report: &Report) -> Option<String> {
    let of_test = report.audit.iter().skip(report.logs.train.len());
    let repeats = of_test.filter(|audit| audit.repeats.is_some());
    let repeats: Vec<String> = repeats.map(|audit| audit.log.clone()).collect();
    let of_bodies = match report.identifiability.bodies.is_empty() {
        true => "",
        false => {
            " Those are predicted no better than with the declared bodies and fitted friction if they depend on what \
             these logs leave open about the bodies (see below)."
        }
    };
    (!repeats.is_empty()).then(|| {
        format!(
            "The motion of {} repeats that of another log: the error there says how well torques repeat, and nothing about \
             other motions.{of_bodies}",
            listed(&repeats)
        )
    })
}

/// How much of the fitted declared model's error the effects remove, if an interval is known.
pub(crate) fn removed(reduction_ci95: Option<[f64; 2]>, error: &str) -> Option<String> {
    // Without an effect the two models are the same.
    let [low, high] = reduction_ci95.filter(|ends| *ends != [0.0, 0.0])?;
    Some(format!(
        "the effects remove {:.0} to {:.0} % of the fitted model's {error} (95 % interval)",
        100.0 * low,
        100.0 * high
    ))
}

/// As above, as a sentence that says where the interval comes from.
fn bootstrapped(reduction_ci95: Option<[f64; 2]>, error: &str) -> Option<String> {
    let removed = removed(reduction_ci95, error)?;
    Some(capitalised(&removed) + ", by a bootstrap over parts of the test logs.")
}

/// Every model that was scored on the test logs, with its name in a table.
fn scored(error: &ErrorEntry) -> Vec<(&str, &ModelError)> {
    let mut models = vec![(AS_WRITTEN, &error.declared), (FITTED, &error.before)];
    models.extend(error.with_friction.iter().map(|m| (WITH_FRICTION, m)));
    models.push((WITH_EFFECTS, &error.after));
    models.extend(error.zeroed.iter().map(|m| (ZEROED, m)));
    models.extend(error.hybrid.iter().map(|m| (WITH_NETWORK, m)));
    let against = error.against.iter();
    models.extend(against.map(|other| (other.name.as_str(), &other.error)));
    models
}

/// A row for each horizon and each of these joints.
fn motion_table(report: &Report, joints: &[Joint]) -> Block {
    let error = &report.error;
    let models = scored(error);
    let names = models.iter().map(|(name, _)| *name);
    let heads = ["horizon", "joint", "windows"].into_iter();
    let heads = heads.chain(names).chain([RATIO]);
    let row = |(h, joint): (usize, Joint)| {
        let names = [
            format!("{} s", error.horizons_s[h]),
            report.label(joint),
            error.before.windows[h].to_string(),
        ];
        let errors = models.iter().map(|(_, model)| {
            let of = [&model.position_rmse, &model.position_median].map(|e| small(e[h][joint]));
            format!("{} ({})", of[0], of[1])
        });
        let rmse = |model: &ModelError| model.position_rmse[h][joint];
        let share = ratio(rmse(&error.after), rmse(&error.before));
        let cells = names.into_iter().chain(errors).map(cell);
        cells.chain([share]).collect()
    };
    let horizons = 0..error.horizons_s.len();
    let rows = horizons.flat_map(|h| joints.iter().map(move |joint| (h, *joint)));
    table(2, heads, rows.map(row))
}

/// A row for each horizon, of all joints together.
fn motion_of_all(report: &Report) -> Block {
    let error = &report.error;
    let models = scored(error);
    let names = models.iter().map(|(name, _)| *name);
    let row = |h: usize| {
        let first = [
            format!("{} s", error.horizons_s[h]),
            error.before.windows[h].to_string(),
        ];
        let errors = models.iter().map(|(_, model)| small(model.of_a_joint(h)));
        let share = ratio(error.after.of_a_joint(h), error.before.of_a_joint(h));
        first
            .into_iter()
            .chain(errors)
            .map(cell)
            .chain([share])
            .collect()
    };
    let heads = ["horizon", "windows"]
        .into_iter()
        .chain(names)
        .chain([RATIO]);
    table(1, heads, (0..error.horizons_s.len()).map(row))
}

fn of_motion(report: &Report) -> Vec<Block> {
    let error = &report.error;
    let models = scored(error);
    let joints: Vec<Joint> = Joint::all(report.joints).collect();
    let of_all = is_large(report.joints).then(|| {
        let about = "Root mean square over the joints:";
        vec![paragraph(about), motion_of_all(report)]
    });
    let each = vec![motion_table(report, &joints)];
    let tables = [
        of_all.unwrap_or_default(),
        folded_if_large(report, "The motion of each joint", each),
    ];
    let horizon = format!("error at {} s", error.middle().1);
    let remarks = [
        bootstrapped(error.reduction_ci95, &horizon),
        of_noise(report),
        uneven(report),
        zeroing_that_harms(error),
    ];
    let diverged = models
        .iter()
        .filter_map(|(name, model)| diverged(name, model));
    let unscored = error.unscored_s.iter().map(|horizon| {
        format!("No test log holds a window of {horizon} s, so no error is given at that horizon.")
    });
    let remarks = remarks.into_iter().flatten();
    let remarks = paragraphs(remarks.chain(diverged).chain(unscored));
    let title = heading("Open-loop motion");
    let about = vec![title, paragraph(about_motion(report))];
    [about, tables.concat(), remarks].concat()
}

/// What the noise of the sensors alone would leave.
fn of_noise(report: &Report) -> Option<String> {
    let (error, unit) = (&report.error, position_unit(report));
    let floor = small(error.noise_floor?);
    let horizon = error.middle().1;
    Some(format!(
        "The noise of the position sensors, in the rows and in the states from which predictions start, accounts for \
         {floor} {unit} at {horizon} s, all joints together."
    ))
}

fn about_motion(report: &Report) -> String {
    let zeroed = match report.error.zeroed {
        Some(_) => {
            " \u{201c}Zeroed\u{201d} is the model with effects, with the zeros of each test log's sensors estimated on its first \
             second, and scored on the rest: as on a rig that is zeroed before each run."
        }
        None => "",
    };
    let against = match report.error.against.is_empty() {
        true => "",
        false => " The last models are other files, scored as they are.",
    };
    format!(
        "Root mean square of the position error, in {}; in brackets the median over windows.{zeroed}{against}",
        position_unit(report)
    )
}

/// The unit of positions: the one that all joints share, or both.
pub(crate) fn position_unit(report: &Report) -> &'static str {
    of_joints(report, ["rad", "m", "rad or m"])
}

/// The unit of torques and forces, in the same way.
pub(crate) fn force_unit(report: &Report) -> &'static str {
    of_joints(report, ["N m", "N", "N m (N where a joint slides)"])
}

/// The first if all joints turn, the second if all slide, or else the third.
fn of_joints(report: &Report, [turning, sliding, both]: [&'static str; 3]) -> &'static str {
    match report.prismatic.iter().filter(|slides| **slides).count() {
        0 => turning,
        all if all == report.prismatic.len() => sliding,
        _ => both,
    }
}

/// In how many windows a model diverged, if in any.
fn diverged(name: &str, model: &ModelError) -> Option<String> {
    let windows: usize = model.diverged.iter().sum();
    (windows > 0).then(|| {
        format!("{name}: {windows} windows diverged; each counts with the error reached by then.")
    })
}

/// Which joints owe most of their error to a few windows.
fn uneven(report: &Report) -> Option<String> {
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
fn zeroing_that_harms(error: &ErrorEntry) -> Option<String> {
    let sum = |model: &ModelError| model.position_rmse[error.middle().0].iter().sum::<f64>();
    let zeroed = error.zeroed.as_ref()?;
    (sum(zeroed) > sum(&error.after)).then(|| {
        "Zeroing makes the error worse here: the first second of these logs does not separate the zeros from other \
         errors. Zero the rig itself, or leave the zeros out."
            .to_owned()
    })
}

/// The errors on single test logs as a table; empty for a single log.
fn of_test_logs(report: &Report) -> Vec<Block> {
    let error = &report.error;
    if error.by_log.is_empty() {
        return Vec::new();
    }
    let about = match report.compared {
        ErrorModel::OutputError => format!(
            "Position errors at {} s on each test log, in {}.",
            error.middle().1,
            position_unit(report)
        ),
        ErrorModel::InverseDynamics => {
            format!("Torque errors on each test log, in {}.", force_unit(report))
        }
    };
    let of_log = |TestLog { log, before, after }: &TestLog| -> Vec<Vec<Cell>> {
        let row = |joint: Joint| {
            let [before, after] = [before[joint], after[joint]];
            let texts = [
                log.clone(),
                report.label(joint),
                small(before),
                small(after),
            ];
            let share = [ratio(after, before)];
            texts.map(cell).into_iter().chain(share).collect()
        };
        Joint::all(report.joints).map(row).collect()
    };
    let rows = error.by_log.iter().flat_map(of_log);
    let heads = ["log", "joint", FITTED, WITH_EFFECTS, RATIO];
    let table = folded_if_large(
        report,
        "Each joint on each log",
        vec![table(2, heads, rows)],
    );
    [vec![heading("Log by log"), paragraph(about)], table].concat()
}

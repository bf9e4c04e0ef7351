//! Tests on a simulated pendulum with dry friction: failures reach the report, and settings take effect.

use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::diagnostics::ResidualForce;
use super::establish::{Chosen, Standing, establish};
use super::every_log::SetApart;
use super::fit::{Declared, NOTHING};
use super::fitted::Fitted;
use super::judge::Found;
use super::outcome::Outcome;
use super::pipeline::{close_loop, find};
use super::problem::Problem;
use super::refine::refined;
use super::request::Request;
use super::score::{Scored, Scorer, findings};
use super::select::{Selected, Trial, select, select_from};
use super::settings::Settings;
use super::split::Split;
use super::stage::{Progress, Watch};
use super::verdict::{Verdict, verdict};
use crate::data::{Audit, Joint, Log};
use crate::identify::{FitError, Termination};
use crate::model::{FittedEffect, Library, Model, Status};
use crate::plant::Plant;

/// A pendulum, logged at 100 Hz.
const PENDULUM: &str = r#"
model = "pendulum"
parameters = { C_g = -17.4, C_i = 4.6 }
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }
"#;

/// Three slow motions of one joint.
const MOTION: &str = r#"
excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }
recording = { logs = 3, duration_s = 8, start = [0, 0] }
"#;

/// A pendulum that is logged at 200 Hz in three faster motions.
pub(super) const FAST_PENDULUM: &str = r#"
model = "pendulum"
parameters = { C_g = -17.4, C_i = 4.6 }
sensor = { rate_hz = 200, position_noise = 2e-4, position_step = 0.0 }
excitation = { amplitude = [1.6], band_hz = [0.15, 3.0], tones = 10 }
recording = { logs = 3, duration_s = 6, start = [0, 0] }
"#;

const FRICTION: &str = r#"effect = [{ name = "coulomb_friction", joint = 1, F_c = 0.2 }]"#;

/// Logs, and the model and the library that they are studied with.
pub(super) struct Study {
    pub declared: Model,
    pub library: Library,
    pub logs: Vec<Log>,
    pub settings: Settings,
}

impl Study {
    /// A model, with logs of the rig in this file.
    pub fn of(declared: Model, rig: &str) -> Self {
        Self {
            declared,
            library: Library::built_in(),
            logs: recorded(rig, 0),
            settings: Settings::default(),
        }
    }

    /// A pendulum with dry friction, which the model lacks.
    pub fn of_friction() -> Self {
        Self::of(pendulum(), &[PENDULUM, MOTION, FRICTION].concat())
    }

    pub fn problem(&self) -> Problem<'_> {
        Problem::new(&self.declared, &self.library, &self.logs, &self.settings)
    }

    /// A problem in which nothing can be found.
    pub fn closed(&self) -> Problem<'_> {
        Problem::new(&self.declared, &NOTHING, &self.logs, &self.settings)
    }

    pub fn fitted(&self) -> Declared<'_> {
        self.problem().fit_declared().unwrap()
    }

    /// The study of the training logs, and the test logs.
    fn split(self) -> (Self, Vec<Log>) {
        let Split { train, test, .. } = Split::of(self.logs, &self.settings.split);
        (
            Self {
                logs: train,
                ..self
            },
            test,
        )
    }

    fn scorer<'a>(&'a self, test: &'a [Log]) -> Scorer<'a> {
        let settings = &self.settings.score;
        Scorer { test, settings }
    }

    /// The loop, closed on all logs with changed settings.
    fn outcome(&self, change: impl FnOnce(&mut Settings), watch: &dyn Watch) -> Outcome {
        let mut request = Request::of(&self.declared, &self.library, self.logs.clone());
        change(&mut request.settings);
        close_loop(request, &mut ChaCha8Rng::seed_from_u64(0), watch).unwrap()
    }
}

/// The logs of the rig in this file.
pub(super) fn recorded(rig: &str, seed: u64) -> Vec<Log> {
    let library = Library::built_in();
    let model = |name: &Path| library.model(name.to_str().unwrap());
    let plant = Plant::from_text(Path::new("rig.toml"), rig, &library, model).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..plant.recording.logs)
        .map(|_| plant.record(&mut rng).unwrap())
        .collect()
}

pub(super) fn pendulum() -> Model {
    Library::built_in().model("pendulum").unwrap()
}

/// An effect of the library on the first joint, at the values at which it is absent.
pub(super) fn absent(name: &str) -> FittedEffect {
    let library = Library::built_in();
    FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0))
}

/// A model that diverges in every window: its values are NaN.
fn diverging(mut fitted: Fitted) -> Fitted {
    for parameter in &mut fitted.model.parameters {
        parameter.value = f64::NAN;
    }
    fitted
}

fn search<'a>(problem: &Problem<'a>) -> Found<'a> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    find(problem.fit_declared().unwrap(), &[], &mut rng, &()).unwrap()
}

#[test]
fn a_model_that_diverges_has_no_residual_force() {
    let study = Study::of_friction();
    let problem = study.closed();
    let model = problem.fit_declared().unwrap().fitted;
    assert!(ResidualForce::of(&problem, &model).unwrap().norm() > 0.0);
    let failed = ResidualForce::of(&problem, &diverging(model));
    assert!(matches!(failed, Err(FitError::Diverged { .. })));
}

/// The rig has one of two effects; the other removes only noise.
#[test]
fn an_effect_that_saves_little_is_not_established() {
    let study = Study::of_friction();
    let problem = study.problem();
    let effects = ["coulomb_friction", "gravity_tilt"].map(absent);
    let start = study.declared.with_effects(effects.into());
    let start_states = problem.shooting.initial_start_states(0);
    let fitted = problem.refit(&start, start_states, None).unwrap();
    let selected = Selected {
        usual: None,
        chosen: Ok(Trial::of(&problem, fitted.clone())),
        rounds: Vec::new(),
        stopped: false,
    };
    let standings = establish(&problem, &fitted, selected, &()).standings;
    let statuses: Vec<Status> = standings.iter().map(|s| s.status).collect();
    assert_eq!(statuses, [Status::Established, Status::Supported]);
    assert!(standings[0].reason.is_none());
    let reason = standings[1].reason.as_ref().unwrap();
    assert!(reason.contains("the loss on left-out blocks by"));
}

#[test]
fn a_log_set_apart_tells_which_model_is_worse() {
    let (study, test) = Study::of_friction().split();
    let problem = study.problem();
    let without = problem.fit_declared().unwrap().fitted;
    let effects = vec![absent("coulomb_friction")];
    let with = problem.with_effects(&without, effects).unwrap();
    let [with, without] = [with, without].map(|fitted| SetApart::of(&problem, &fitted, &test));
    let settings = &study.settings;
    assert_eq!(with.worse_than(&without, settings), None);
    assert_eq!(without.worse_than(&with, settings), Some(0));
    assert_eq!(with.worse_than(&with, settings), None);
}

#[test]
fn a_fit_that_fails_allows_no_verdict() {
    let (study, test) = Study::of_friction().split();
    let problem = study.problem();
    let mut found = search(&problem);
    let scorer = study.scorer(&test);
    let finer = refined(&found.problem, &found.before, &found.chosen.after);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let models = Scored {
        problem: &problem,
        declared: &study.declared,
        before: &finer.before,
        with_friction: None,
        after: &finer.after,
        hybrid: None,
        against: &[],
    };
    let mut errors = scorer.errors(models, &mut rng);
    // The structure is the true one: noise is all that is left.
    let over_noise = errors.over_noise().unwrap();
    assert!((0.3..2.0).contains(&over_noise), "{over_noise}");
    errors.noise_floor = Some(0.1 * errors.after.position_rms());
    let (answer, reason) = verdict(&found, &finer, &errors);
    assert_eq!(answer, Verdict::PartlyExplained);
    assert!(reason.contains("is 10 times what the noise of the sensors accounts for"));
    errors.noise_floor = None;
    let of = |found: &Found<'_>, refined: &_| verdict(found, refined, &errors);
    assert_eq!(of(&found, &finer).0, Verdict::Explained);

    let diverged = diverging(found.chosen.after.clone());
    let mut failed = refined(&found.problem, &found.before, &diverged);
    assert!(matches!(failed.failure, Some(FitError::Diverged { .. })));
    failed.after = finer.after.clone();
    let (answer, reason) = of(&found, &failed);
    assert_eq!(answer, Verdict::Inconclusive);
    assert!(reason.contains("the final fit in fine steps failed"));

    let mut unfinished = refined(&found.problem, &found.before, &found.chosen.after);
    unfinished.after.fit.termination = Termination::StepLimit;
    let (answer, reason) = of(&found, &unfinished);
    assert_eq!(answer, Verdict::Inconclusive);
    assert!(reason.contains("not converged"), "{reason}");

    found.chosen.failure = failed.failure.clone();
    assert_eq!(of(&found, &finer).0, Verdict::Inconclusive);
}

/// If a rig's torque carries a bias, the model without the effect that removes it leaves the range in which its
/// equations are defined.
#[test]
fn an_effect_stays_where_the_refit_without_it_fails() {
    let bounded = "sin(q1) * (1 + 1e-9*sqrt(3.6 - abs(q1)))";
    let text = pendulum().declaration.replace("sin(q1)", bounded);
    let declared = Model::from_text(Path::new("rig.toml"), &text, &[]).unwrap();
    let mut study = Study {
        declared,
        ..Study::of_friction()
    };
    for tau in study.logs.iter_mut().flat_map(|log| &mut log.tau[0]) {
        *tau += 8.0;
    }
    let (study, test) = study.split();
    let problem = study.problem();
    let bias = |size: f64| FittedEffect {
        values: vec![(size, None)],
        ..absent("constant_torque")
    };
    let mut start = study.declared.with_effects(vec![bias(-8.0)]);
    for (parameter, value) in start.parameters.iter_mut().zip([-17.4, 4.6]) {
        parameter.value = value;
    }
    let start_states = problem.shooting.initial_start_states(0);
    let chosen = problem.refit(&start, start_states, None).unwrap();
    let refined = refined(&problem, &chosen, &chosen);
    let scorer = study.scorer(&test);
    let effect = chosen.model.effects[0].clone();
    let standing = Standing::sure(effect, (1.0, 0.0), problem.without_effect(&chosen, 0));
    let chosen = Chosen {
        standings: vec![standing],
        ..Chosen::of(chosen)
    };
    let found = findings(&problem, &chosen, &refined, &scorer);
    assert_eq!(found.len(), 1);
    let reduction = &found[0].error_reduction;
    assert!(matches!(reduction, Err(FitError::Diverged { .. })));
    assert!(found[0].p_value < 1e-6);
}

#[test]
fn the_error_reduction_compares_two_fits_in_the_same_steps() {
    let (study, test) = Study::of_friction().split();
    let problem = study.problem();
    let found = search(&problem);
    let finer = refined(&found.problem, &found.before, &found.chosen.after);
    let scorer = study.scorer(&test);
    let reported = findings(&problem, &found.chosen, &finer, &scorer);
    let reduction = *reported[0].error_reduction.as_ref().unwrap();
    let after = &found.chosen.after;
    let (start_states, scale) = (after.fit.start_states.clone(), after.fit.scale);
    let less = after.model.with_effects(Vec::new());
    let less = problem.refit(&less, start_states, Some(scale)).unwrap();
    let error = |model: &Fitted| scorer.fitted(model).position_rms();
    assert_eq!(reduction, 1.0 - error(after) / error(&less));
}

/// No single effect helps much if both joints have friction: the four effects are found together.
#[test]
fn friction_of_all_joints_is_found_at_once() {
    const RIG: &str = r#"
model = "acrobot"
parameters = { m1 = 0.6, m2 = 0.6, l1 = 0.3, lc1 = 0.25, lc2 = 0.2, I1 = 0.02, I2 = 0.01 }
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }
excitation = { amplitude = [1.5, 0.8], band_hz = [0.2, 2.0], tones = 8 }
recording = { logs = 4, duration_s = 8, start = [0, 0, 0, 0] }
effect = [
    { name = "coulomb_friction", joint = 1, F_c = 0.15 },
    { name = "viscous_friction", joint = 1, b = 0.04 },
    { name = "coulomb_friction", joint = 2, F_c = 0.1 },
    { name = "viscous_friction", joint = 2, b = 0.03 },
]
"#;
    let acrobot = Library::built_in().model("acrobot").unwrap();
    let study = Study::of(acrobot, RIG);
    let found = search(&study.problem());
    let mut names: Vec<String> = found.chosen.named().map(FittedEffect::label).collect();
    names.sort();
    let of = |name: &str| [1, 2].map(|joint| format!("{name} on joint {joint}"));
    let wanted = [of("coulomb_friction"), of("viscous_friction")].concat();
    assert_eq!(names, wanted);
}

/// Let every residual be noteworthy, and all or none significant.
fn all_residuals_matter(settings: &mut Settings, significance: f64) {
    let diagnostics = &mut settings.diagnostics;
    (diagnostics.noteworthy_share, diagnostics.unlocated_share) = (-1.0, -1.0);
    diagnostics.significance = significance;
}

/// Let no effect be added.
fn nothing_is_added(settings: &mut Settings) {
    settings.select.most_effects = 0;
    settings.select.most_effects_per_joint = 0;
}

/// If the test logs contradict the effects, a residual shows that something is missing; without one the verdict stays
/// open.
#[test]
fn effects_that_raise_the_error_on_the_test_logs_are_doubted() {
    let study = Study::of_friction();
    let outcome = |significance: f64| {
        let change = |settings: &mut Settings| {
            // Every effect counts as worse, and every residual as noteworthy.
            settings.verdict.trusted_rise = 0.0;
            settings.establish.masking_share = f64::INFINITY;
            settings.establish.outweighed_share = 0.0;
            all_residuals_matter(settings, significance);
        };
        study.outcome(change, &())
    };
    let missing = outcome(2.0);
    assert_eq!(missing.verdict, Verdict::PartlyExplained);
    let reason = missing.reason;
    assert!(reason.contains("raise the error"), "{reason}");
    let nothing_missing = outcome(0.0);
    assert_eq!(nothing_missing.verdict, Verdict::Inconclusive);
}

/// An effect outweighed by the unexplained residual may be a part of the real cause's shape.
#[test]
fn an_effect_that_a_remainder_outweighs_is_not_established() {
    let change = |settings: &mut Settings| {
        all_residuals_matter(settings, 2.0);
        settings.establish.outweighed_share = f64::INFINITY;
    };
    let outcome = Study::of_friction().outcome(change, &());
    assert!(outcome.effects.findings.is_empty());
    let reason = outcome.effects.supported[0].reason.as_ref().unwrap();
    assert!(reason.contains("remains unexplained"), "{reason}");
    assert_eq!(outcome.verdict, Verdict::Unexplained);
}

/// The watcher may end the search before it has tried anything; the report says so.
#[test]
fn a_search_that_is_ended_allows_no_verdict() {
    struct Ended;
    impl Watch for Ended {
        fn see(&self, _: Progress<'_>) {}

        fn has_to_end(&self) -> bool {
            true
        }
    }
    let outcome = Study::of_friction().outcome(|_| (), &Ended);
    assert!(outcome.effects.stopped && outcome.effects.rounds.iter().all(|r| r.tried.is_empty()));
    assert_eq!(outcome.verdict, Verdict::Inconclusive);
}

/// The model is the same before and after, and so is its error.
#[test]
fn without_effects_the_error_reduction_is_zero() {
    let outcome = Study::of_friction().outcome(nothing_is_added, &());
    assert!(outcome.effects.findings.is_empty());
    assert_eq!(outcome.errors.reduction_ci95, Some([0.0, 0.0]));
}

#[test]
fn a_changed_setting_changes_the_search() {
    let mut study = Study::of_friction();
    let added = |study: &Study| search(&study.problem()).chosen.standings.len();
    assert_eq!(added(&study), 1);
    nothing_is_added(&mut study.settings);
    assert_eq!(added(&study), 0);
}

#[test]
fn a_search_that_begins_over_short_windows_ends_with_the_same_effects() {
    let study = Study::of_friction();
    let Declared { problem, fitted } = study.fitted();
    let short = problem.fitted_over_short_windows().unwrap();
    let problem = problem.knowing(short.problem.identifiability.clone());
    assert!(short.problem.shooting.windows.len() > 2 * problem.shooting.windows.len());
    let long = select(&problem, &fitted, &()).chosen.unwrap();
    let both = select_from(&problem, &short, &()).chosen.unwrap();
    let effects = &long.fitted.model.effects;
    assert_eq!(effects.len(), 1);
    assert!(effects[0].is_same(&absent("coulomb_friction")));
    assert_eq!(both.key(), long.key());
    let loss = |trial: &Trial| trial.loss() * trial.fitted.fit.scale.powi(2);
    assert!((loss(&both) / loss(&long) - 1.0).abs() < 1e-3);
}

/// Torques change from row to row, and the logger dropped some rows: what the rig did then is unknown.
#[test]
fn windows_with_dropped_rows_do_not_count_as_unexplained() {
    const ROUGH: &str = r#"
excitation = { amplitude = [1.6], band_hz = [0.15, 30.0], tones = 30 }
recording = { logs = 3, duration_s = 8, start = [0, 0] }
"#;
    let with_dropped = |mut log: Log| {
        let kept = |row: &usize| *row > 500 || row % 20 != 7;
        let of = |column: &mut Vec<f64>| {
            let mut row = 0..;
            column.retain(|_| row.next().is_some_and(|row| kept(&row)));
        };
        let channels = log.q.iter_mut().chain(&mut log.qd).chain(&mut log.tau);
        channels.chain([&mut log.time]).for_each(of);
        log.for_fits(0.5)
    };
    let mut study = Study::of(pendulum(), &[PENDULUM, ROUGH].concat());
    study.logs = study.logs.into_iter().map(with_dropped).collect();
    let found = |study: &Study| search(&study.problem()).unexplained;
    let left = found(&study);
    assert!(!left.is_significant(), "{left:?}");
    assert!((1..30).contains(&left.omnibus.windows), "{left:?}");
    for log in &mut study.logs {
        assert_eq!(log.filled.len(), 25);
        log.masked = vec![std::mem::take(&mut log.filled)];
    }
    assert!(found(&study).is_significant(), "were they counted");
}

/// An inertia a fifth of the rig's and a moment five times as large make the mass matrix indefinite.
#[test]
fn starting_values_with_which_the_model_diverges_are_moved() {
    const RIG: &str = r#"
model = "acrobot"
parameters = { m1 = 0.6, m2 = 0.6, l1 = 0.2, lc1 = 0.2, lc2 = 0.2, I1 = 0.02, I2 = 0.01 }
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }
excitation = { amplitude = [1.0, 0.5], band_hz = [0.2, 2.0], tones = 8 }
recording = { logs = 2, duration_s = 6, start = [0, 0, 0, 0] }
"#;
    let text = include_str!("../../../../docs/rigs/dfki_double_pendulum.toml");
    let read = |text: &str| Model::from_text(Path::new("two_links.toml"), text, &[]).unwrap();
    let far = text
        .replace("{ value = 0.03,", "{ value = 0.006,")
        .replace("{ value = 0.15,", "{ value = 0.75,");
    let fitted = |text: &str| {
        let study = Study::of(read(text), RIG);
        let found = study.closed().fit_declared().unwrap();
        (found.fitted.model.values(), found.problem.moved_to)
    };
    let (wanted, unmoved) = fitted(text);
    let (found, moved_to) = fitted(&far);
    assert!(unmoved.is_empty());
    assert!(moved_to.iter().any(|p| p.name == "s2" && p.value < 0.7));
    for (found, wanted) in found.iter().zip(&wanted) {
        assert!((found / wanted - 1.0).abs() < 1e-3, "{found} {wanted}");
    }
}

/// The motion determines two combinations of three parameters, inertia about the pivot and weight. A fit that begins at
/// other values that explain the logs returns to those nearest to the declared ones.
#[test]
fn what_the_logs_do_not_determine_stays_near_the_declared_values() {
    const FILE: &str = r#"
[system]
name = "rod"
joints = 1
[parameters]
m = { value = 1.0, positive = true }
l = { value = 0.5, positive = true }
I = { value = 0.1, positive = true }
[dynamics]
qdd1 = "(tau1 - 9.81 * m * l * sin(q1)) / (I + m * l^2)"
"#;
    let declared = Model::from_text(Path::new("rod.toml"), FILE, &[]).unwrap();
    let study = Study::of(declared, &[PENDULUM, MOTION].concat());
    let problem = study.closed();
    let (inertia, moment) = (1.0 / 4.6, 17.4 / 4.6 / 9.81);
    let mut start = study.declared.clone();
    let far = [2.0, moment / 2.0, inertia - moment * moment / 2.0];
    for (parameter, value) in start.parameters.iter_mut().zip(far) {
        parameter.value = value;
    }
    let start_states = problem.shooting.initial_start_states(0);
    let fitted = problem.refit(&start, start_states, None).unwrap();
    let [m, l, i] = fitted.model.values()[..] else {
        panic!()
    };
    assert!((m * l / moment - 1.0).abs() < 0.01, "{m} {l}");
    assert!(((i + m * l * l) / inertia - 1.0).abs() < 0.01, "{i}");
    assert!((0.7..1.3).contains(&m), "{m}");
    assert_eq!(problem.identifiability_of(&fitted).determined, 2);
}

/// Without torque, inertia and friction cannot be distinguished: the declared inertia is held, so that the file's
/// friction gets a value.
#[test]
fn what_an_effect_of_the_file_is_not_told_from_is_held() {
    const SPUN_DOWN: &str = r#"
excitation = { amplitude = [0.0], band_hz = [0.15, 2.0], tones = 8 }
recording = { logs = 2, duration_s = 8, start = [2.0, 0] }
effect = [{ name = "viscous_friction", joint = 1, b = 0.1 }]
"#;
    let mut declared = pendulum();
    declared.parameters[0].value = -15.0;
    let declared = declared.with_effects(vec![absent("viscous_friction")]);
    let study = Study::of(declared, &[PENDULUM, SPUN_DOWN].concat());
    // Coulomb friction is fitted together with it at first, and does not count.
    let Declared { problem, fitted } = study.fitted();
    assert_eq!(problem.identifiability.hold, [1]);
    assert_eq!(problem.identifiability.free, 3);
    let [_, c_i, b] = fitted.model.values()[..] else {
        panic!()
    };
    assert!((c_i * b - 0.46).abs() < 0.01, "{c_i} {b}");
}

#[test]
fn a_result_predicts_a_log() {
    let study = Study::of_friction();
    let found = study.closed().fit_declared().unwrap();
    let predicted = found.fitted.predict(&study.logs[0], 0.5);
    assert!(predicted.len() > 10);
}

/// Two joints whose torques are logged with the model's sign, or reversed.
#[test]
fn torques_that_are_reversed_on_all_joints_are_reported() {
    let rig = r#"
model = "acrobot"
sensor = { rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }
excitation = { amplitude = [8.0, 4.0], band_hz = [0.2, 2.0], tones = 8 }
recording = { logs = 1, duration_s = 6, start = [0, 0, 0, 0] }
effect = [{ name = "coulomb_friction", joint = 1, F_c = 0.5 }]
"#;
    let acrobot = Library::built_in().model("acrobot").unwrap();
    let mut study = Study::of(acrobot, rig);
    let message = |problem: &Problem<'_>, mut audits: Vec<Audit>| -> Vec<String> {
        let usual = problem.with_usual_friction();
        problem.report_reversed(usual.as_ref(), &mut audits);
        let texts = audits[0].serious().map(ToString::to_string);
        texts
            .filter(|text| text.contains("with every tau reversed"))
            .collect()
    };
    let blank = |problem: &Problem<'_>| {
        let mut audits = problem.audits().to_vec();
        audits[0].findings.clear();
        audits
    };
    let problem = study.problem();
    assert!(message(&problem, blank(&problem)).is_empty());
    // Accelerations that follow the torques are not overruled by an error that a failed fit leaves.
    study.settings.notes.reversed_loss = f64::INFINITY;
    let problem = study.problem();
    assert!(message(&problem, blank(&problem)).is_empty());
    study.settings = Settings::default();
    for value in study.logs[0].tau.iter_mut().flatten() {
        *value = -*value;
    }
    let problem = study.problem();
    let alone = message(&problem, blank(&problem));
    assert_eq!(alone.len(), 1);
    assert!(alone[0].contains("[columns] tau = "), "{}", alone[0]);
    // If the log's audit already reports each joint, there is nothing to add.
    assert!(message(&problem, problem.audits().to_vec()).is_empty());
}

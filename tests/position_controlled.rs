//! Closing the loop if a controller prescribes the motion: from the torques that the motion needs.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use residyn::read_log;
use residyn_core::closeloop::{ErrorModel, Outcome, Request, Settings, Split, Verdict, close_loop};
use residyn_core::data::{Log, Smooth};
use residyn_core::model::{FittedEffect, Library, Model, Origin};
use residyn_core::sim::Integrator;
use residyn_core::sim::metric::torque_error;
use residyn_formats::{ExportModel, find};
use residyn_report as report;
use residyn_report::Report;
use serde_json::{Value, json};

use crate::support::arms::{as_built, model, moved};
use crate::support::catalogue::{effect, rng};
use crate::support::clients::client;
use crate::support::measured;
use crate::support::mechanisms::{fixture, read_to, system};

/// An arm of four joints as its description has it.
fn declared() -> Model {
    model(&read_to(&fixture("linkage_4r.urdf"), Some("hand")))
}

/// The arm as built: bodies off by 10 to 25 %, and effects with these values on some joints.
fn rig(effects: &[(usize, &str, &[f64])]) -> Model {
    let of = |(joint, name, values): &(usize, &str, &[f64])| effect(name, *joint, values);
    let rig = declared().with_effects(effects.iter().map(of).collect());
    as_built(&rig.with_smoothing_velocities(vec![0.02; 4]))
}

/// A log of the rig under stiff control, with the noise of encoders and of currents.
fn recorded(rig: &Model, seconds: f64, seed: u64) -> Log {
    let mut log = moved(rig, seconds, seed);
    let mut rng = rng(100 + seed);
    let add = |values: &mut Vec<f64>, deviation: f64, rng: &mut dyn Rng| {
        for value in values {
            let drawn: f64 = StandardNormal.sample(&mut *rng);
            *value += deviation * drawn;
        }
    };
    for j in 0..rig.joints {
        let size = log.tau[j].iter().map(|tau| tau * tau).sum::<f64>() / log.rows() as f64;
        add(&mut log.tau[j], 0.02 * size.sqrt(), &mut rng);
        add(&mut log.q[j], 2e-5, &mut rng);
    }
    log.path = format!("log{seed}.csv").into();
    log
}

fn closed(rig: &Model, error_model: Option<ErrorModel>) -> Outcome {
    let [train, test] = [(30.0, 1), (10.0, 2)].map(|(seconds, seed)| recorded(rig, seconds, seed));
    closed_on([train, test], error_model)
}

fn closed_on([train, test]: [Log; 2], error_model: Option<ErrorModel>) -> Outcome {
    let (declared, library) = (declared(), Library::built_in());
    let split = Split::given(vec![train], vec![test]);
    let mut request = Request::new(&declared, &library, split);
    request.settings = Settings::default();
    request.error_model = error_model;
    close_loop(request, &mut rng(0), &()).unwrap()
}

/// Names and joints of the established effects.
fn named(outcome: &Outcome) -> Vec<(usize, String)> {
    let findings = outcome.effects.findings.iter();
    findings
        .map(|finding| {
            (
                finding.effect.joint.index(),
                finding.effect.effect.name.clone(),
            )
        })
        .collect()
}

/// Whether an audit says this of a log.
fn is_told(outcome: &Outcome, what: &str) -> bool {
    let audits = outcome.given.audits.iter();
    let mut findings = audits.flat_map(|audit| &audit.findings);
    findings.any(|finding| finding.text.contains(what))
}

/// Whether an audit says that a log's torques imply another gravity.
fn contradicts_gravity(outcome: &Outcome) -> bool {
    is_told(outcome, "of the gravity torque of the declared bodies")
}

/// Rows of a log from one time on and before another.
fn part(log: &Log, start_s: f64, end_s: f64) -> Log {
    let kept: Vec<usize> = (0..log.rows())
        .filter(|row| (start_s..end_s).contains(&log.time[*row]))
        .collect();
    let rows = |channel: &Vec<f64>| kept.iter().map(|row| channel[*row]).collect::<Vec<f64>>();
    let channels = |all: &[Vec<f64>]| all.iter().map(rows).collect::<Vec<_>>();
    Log {
        time: rows(&log.time),
        q: channels(&log.q),
        qd: channels(&log.qd),
        tau: channels(&log.tau),
        ..log.clone()
    }
}

/// A measured arm from its URDF, with part of its logs set apart. The required errors are below those of least squares
/// on base parameters with Stribeck and square-root friction (figures in the READMEs of the data sets).
fn of_measured(arm: &str, logs: [&str; 2], share: f64, most_percent: f64) -> Option<Outcome> {
    let data = measured(arm)?;
    let declared = system(&read_to(&data.join(format!("{arm}.urdf")), None));
    let [train, test] = logs.map(|name| read_log(data.join(name), &declared).unwrap());
    let split_s = train.time[((train.rows() - 1) as f64 * share) as usize];
    let (train, test) = match share < 1.0 {
        true => (
            part(&train, f64::NEG_INFINITY, split_s),
            part(&test, split_s, f64::INFINITY),
        ),
        false => (train, test),
    };
    let library = Library::built_in();
    let request = Request::new(&declared, &library, Split::given(vec![train], vec![test]));
    let outcome = close_loop(request, &mut rng(0), &()).unwrap();
    assert_eq!(outcome.error_model, ErrorModel::InverseDynamics);
    assert!(!contradicts_gravity(&outcome), "{arm}");
    let percent = 100.0 * outcome.errors.torque.as_ref().unwrap().after.relative;
    assert!(percent <= most_percent, "{arm}: {percent} %");
    Some(outcome)
}

/// Effects that MuJoCo can express.
const CARRIED: [&str; 5] = [
    "coulomb_friction",
    "viscous_friction",
    "constant_torque",
    "joint_spring",
    "actuator_gain",
];

/// MuJoCo's model needs a log's torques as accurately as the model here.
fn mujoco_follows(model: &Model, arm: &str, log: &str) {
    let is_carried = |e: &&FittedEffect| CARRIED.contains(&e.effect.name.as_str());
    let carried: Vec<FittedEffect> = model.effects.iter().filter(is_carried).cloned().collect();
    let model = model.with_effects(carried);
    let log = read_log(measured(arm).unwrap().join(log), &model).unwrap();
    let error = torque_error(&model, std::slice::from_ref(&log)).unwrap();
    let Smooth {
        q, qd, qdd, tau, ..
    } = Smooth::of(&log);
    let folder = tempfile::tempdir().unwrap();
    let [written, motion] = ["arm.xml", "motion.json"].map(|name| folder.path().join(name));
    let exported = ExportModel::of_system(&model, Integrator::RK4, 0.01, Value::Null);
    let mjcf = find("mjcf").unwrap();
    let lost = (mjcf.not_carried)(&exported);
    assert!(
        !lost.iter().any(|part| part.contains("on joint")),
        "{lost:?}"
    );
    mjcf.write(&exported, &written).unwrap();
    let message = json!({ "q": q, "qd": qd, "qdd": qdd, "tau": tau, "relative": error.relative });
    std::fs::write(&motion, message.to_string()).unwrap();
    client("torques.py", &[&written, &motion]);
}

mod slow {
    use super::*;

    #[test]
    fn effects_of_an_arm_are_named_on_their_joints_by_torques() {
        let hidden: [(usize, &str, &[f64]); 5] = [
            (0, "coulomb_friction", &[0.6]),
            (0, "viscous_friction", &[0.8]),
            (1, "stribeck_friction", &[0.5, 1.0, 0.1]),
            (2, "degressive_friction", &[0.4, 0.05]),
            (3, "constant_torque", &[0.3]),
        ];
        let outcome = closed(&rig(&hidden), None);
        assert_eq!(outcome.error_model, ErrorModel::InverseDynamics);
        let wanted: Vec<(usize, String)> = (hidden.iter())
            .map(|(joint, name, _)| (*joint, (*name).to_owned()))
            .collect();
        let mut found = named(&outcome);
        found.sort();
        let mut wanted = wanted;
        wanted.sort();
        assert_eq!(found, wanted);
        let torque = outcome.errors.torque.unwrap();
        assert!(
            torque.after.relative < 0.3 * torque.before.relative,
            "{torque:?}"
        );
    }

    #[test]
    fn an_arm_that_is_as_declared_but_for_its_bodies_lacks_no_effect() {
        let outcome = closed(&rig(&[]), Some(ErrorModel::InverseDynamics));
        assert_eq!(named(&outcome), []);
        assert_eq!(
            outcome.verdict,
            Verdict::NoMissingEffect,
            "{}",
            outcome.reason
        );
    }

    #[test]
    fn torques_without_gravity_are_reported() {
        let rig = rig(&[(0, "viscous_friction", &[0.8])]);
        let logs = [(20.0, 1), (10.0, 2)].map(|(seconds, seed)| recorded(&rig, seconds, seed));
        assert!(!contradicts_gravity(&closed_on(
            logs.clone(),
            Some(ErrorModel::InverseDynamics)
        )));
        let balance = rig.torque_balance().unwrap();
        let (values, zero) = (balance.values(), vec![0.0; rig.joints]);
        let bare = logs.map(|mut log| {
            for row in 0..log.rows() {
                let q: Vec<f64> = log.q.iter().map(|q| q[row]).collect();
                let inputs = [&q[..], &zero, &zero, &[0.0], &zero, &values].concat();
                let gravity = balance.program.eval(&inputs);
                for (tau, gravity) in log.tau.iter_mut().zip(gravity) {
                    tau[row] -= gravity;
                }
            }
            log
        });
        let outcome = closed_on(bare, Some(ErrorModel::InverseDynamics));
        assert!(contradicts_gravity(&outcome));
        assert_eq!(outcome.verdict, Verdict::Inconclusive, "{}", outcome.reason);
        assert_eq!(named(&outcome), []);
    }

    #[test]
    fn torques_of_a_measured_panda_are_explained_to_a_part_in_sixty() {
        let log = "exciting_trajectory.csv";
        let Some(outcome) = of_measured("panda", [log, log], 0.7, 1.53) else {
            return;
        };
        // 7n - 6 for n joints that turn about axes in general position, the first along gravity (Mayeda et al., IEEE T-RA 1990).
        assert_eq!(outcome.models.bodies.identifiable_at_most, 43);
        mujoco_follows(&outcome.models.after.model, "panda", log);
    }

    #[test]
    fn a_measured_kuka_is_explained_and_its_test_is_told_as_a_repeat() {
        let logs = ["measurements_1.csv", "measurements_2.csv"];
        let Some(outcome) = of_measured("kuka_lwr4", logs, 1.0, 3.0) else {
            return;
        };
        assert!(is_told(
            &outcome,
            "the motion repeats that of measurements_1.csv"
        ));
        let message = report::text(&Report::new(&outcome, &Origin::of_seed(0)));
        assert!(message.contains("The motion of measurements_2.csv repeats that of another log"));
    }

    #[test]
    fn the_shape_of_friction_in_the_first_joint_of_a_measured_ur10_is_named() {
        let log = "ur10_exciting_trajectory.csv";
        let Some(outcome) = of_measured("ur10", [log, log], 0.65, 6.0) else {
            return;
        };
        assert!(
            named(&outcome).contains(&(0, "degressive_friction".to_owned())),
            "{:?}",
            named(&outcome)
        );
        let bodies = &outcome.models.bodies;
        assert!(bodies.identifiable_at_most == 36 && bodies.identifiable.len() < 36);
    }
}

//! Designed motions keep every limit, at their rows and between them.

use crate::support::{arm_limits, chain, effect, joint, limits, model, with};
use nalgebra::Vector3;
use rand::RngExt;
use residyn_core::data::Joint;
use residyn_core::model::Model;
use residyn_core::model::tree::Pose;
use residyn_core::rng;
use residyn_excite::{
    Cuboid, Design, Designer, ExciteError, Limits, Settings, Sphere, design, picture,
};

/// Points between two rows.
const BETWEEN: usize = 7;

fn quick() -> Settings {
    Settings {
        harmonics: 7,
        starts: 2,
        steps: 15,
        ..Settings::default()
    }
}

/// Position, speed and acceleration of all joints between two rows: the quintic through both ends of all three.
fn between(design: &Design, row: usize, share: f64) -> [Vec<f64>; 3] {
    let h = design.step_s;
    let of_joint = |joint: usize| -> [f64; 3] {
        let [q, v, a] = [&design.q, &design.qd, &design.qdd].map(|channel| &channel[joint]);
        let (p0, v0, a0) = (q[row], v[row] * h, a[row] * h * h);
        let (p1, v1, a1) = (q[row + 1], v[row + 1] * h, a[row + 1] * h * h);
        let (p, v, a) = (p1 - p0 - v0 - a0 / 2.0, v1 - v0 - a0, a1 - a0);
        let c3 = 10.0 * p - 4.0 * v + a / 2.0;
        let c4 = -15.0 * p + 7.0 * v - a;
        let c5 = 6.0 * p - 3.0 * v + a / 2.0;
        let s = share;
        [
            p0 + s * (v0 + s * (a0 / 2.0 + s * (c3 + s * (c4 + s * c5)))),
            (v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h,
            (a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h),
        ]
    };
    let all: Vec<[f64; 3]> = (0..design.q.len()).map(of_joint).collect();
    std::array::from_fn(|derivative| all.iter().map(|own| own[derivative]).collect())
}

/// The torque that a motion takes, by the core's torque balance.
fn torque(model: &Model, [q, qd, qdd]: &[Vec<f64>; 3]) -> Vec<f64> {
    let balance = model.torque_balance().unwrap();
    let zeros = vec![0.0; model.joints];
    balance
        .program
        .eval(&[q, qd, &zeros[..], &[0.0], qdd, &balance.values()].concat())
}

/// The largest share of each kind of limit that a motion uses, sampled between its rows.
fn most_used(model: &Model, limits: &Limits, design: &Design) -> [f64; 5] {
    let mut most = [0.0_f64; 5];
    let mut before: Option<Vec<f64>> = None;
    let part_s = design.step_s / BETWEEN as f64;
    for row in 0..design.time.len() - 1 {
        for part in 0..BETWEEN {
            let motion = between(design, row, part as f64 / BETWEEN as f64);
            let torques = torque(model, &motion);
            for (j, limit) in limits.joints.iter().enumerate() {
                let middle = (limit.angle[0] + limit.angle[1]) / 2.0;
                let half = (limit.angle[1] - limit.angle[0]) / 2.0;
                let rate = before
                    .as_ref()
                    .map_or(0.0, |before| (torques[j] - before[j]) / part_s);
                let shares = [
                    (motion[0][j] - middle) / half,
                    motion[1][j] / limit.speed,
                    motion[2][j] / limit.acceleration,
                    limit.torque.map_or(0.0, |torque| torques[j] / torque),
                    limit.torque_rate.map_or(0.0, |most| rate / most),
                ];
                for (most, share) in most.iter_mut().zip(shares) {
                    *most = most.max(share.abs());
                }
            }
            before = Some(torques);
        }
    }
    most
}

#[test]
fn random_rigs_keep_random_limits_between_rows() {
    let mut rng = rng(5);
    let mut reached = 0;
    for case in 0..12_u64 {
        let joints = 1 + case as usize % 4;
        let mut model = chain(joints);
        for number in 1..=joints {
            model = with(
                &model,
                effect("viscous_friction", number, &[rng.random_range(0.05..0.5)]),
            );
        }
        let mut limits = arm_limits(joints, rng.random_range(30.0..90.0));
        for joint in &mut limits.joints {
            let half = rng.random_range(0.2..2.5);
            let middle = rng.random_range(-0.4..0.4);
            joint.angle = [middle - half, middle + half];
            joint.speed = rng.random_range(0.5..4.0);
            joint.acceleration = rng.random_range(1.0..25.0);
            joint.torque_rate = Some(rng.random_range(10.0..40.0) * joint.torque.unwrap());
        }
        let duration_s = rng.random_range(2.0_f64..8.0).round();
        let found = match design(&model, &[], &limits, duration_s, &quick(), case, &|_| ()) {
            Ok(found) => found,
            // Some of these rigs are too weak to hold themselves.
            Err(ExciteError::Rest(_)) => continue,
            Err(error) => panic!("{error}"),
        };
        let most = most_used(&model, &limits, &found);
        assert!(
            most.iter().all(|share| *share <= 1.0 + 1e-9),
            "{case}: {most:?}"
        );
        let most = most.into_iter().fold(0.0, f64::max);
        assert!(most > 0.97, "{case}: a limit is nearly reached, {most}");
        let said = found.uses.iter().map(|one| one.share).fold(0.0, f64::max);
        assert!((said - most).abs() < 5e-3, "{case}: {said} {most}");
        for joint in 0..joints {
            let last = found.time.len() - 1;
            for row in [0, last] {
                assert!(found.qd[joint][row].abs() < 1e-9 && found.qdd[joint][row].abs() < 1e-8);
            }
            assert!((found.q[joint][0] - found.q[joint][last]).abs() < 1e-9);
        }
        reached += 1;
    }
    assert!(reached >= 8, "{reached}");
}

#[test]
fn a_given_start_is_kept() {
    let mut limits = arm_limits(2, 60.0);
    limits.joints[0].start = Some(0.3);
    limits.joints[1].start = Some(-1.1);
    let found = design(&model("acrobot"), &[], &limits, 4.0, &quick(), 2, &|_| ()).unwrap();
    assert!((found.q[0][0] - 0.3).abs() < 1e-12 && (found.q[1][0] + 1.1).abs() < 1e-12);
}

#[test]
fn a_rig_that_cannot_hold_itself_is_refused() {
    let mut limits = limits(vec![joint([-1.0, 1.0], 1.0)]);
    limits.joints[0].start = Some(0.9);
    let refused = design(&model("pendulum"), &[], &limits, 4.0, &quick(), 2, &|_| ()).unwrap_err();
    let message = refused.to_string();
    assert!(
        message.contains("joint 1 would take 392 % of its torque"),
        "{message}"
    );
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let (model, limits) = (model("acrobot"), arm_limits(2, 60.0));
    let of = |seed| design(&model, &[], &limits, 4.0, &quick(), seed, &|_| ()).unwrap();
    let (one, again, other) = (of(3), of(3), of(4));
    assert_eq!(one, again);
    assert_ne!(one.q, other.q);
}

#[test]
fn rows_are_columns_of_a_log() {
    let found = design(
        &model("acrobot"),
        &[],
        &arm_limits(2, 60.0),
        2.0,
        &quick(),
        1,
        &|_| (),
    )
    .unwrap();
    let mut text = Vec::new();
    found.write_csv(&mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2"));
    assert_eq!(lines.count(), 201);
    serde_json::to_string(&found).unwrap();
}

#[test]
fn the_figure_has_a_panel_for_each_joint() {
    let (model, limits) = (model("acrobot"), arm_limits(2, 60.0));
    let found = design(&model, &[], &limits, 2.0, &quick(), 1, &|_| ()).unwrap();
    let figure = picture(&model, &limits, &found).unwrap();
    assert!(figure.starts_with("<svg"), "{}", &figure[..40]);
    for part in ["Joint 1", "Joint 2", "limits"] {
        assert!(figure.contains(part), "{part}");
    }
}

/// The height of a point of the last link.
fn tip_height(model: &Model, q: &[f64], tip: Vector3<f64>) -> f64 {
    let mechanism = model.mechanism(&model.values()).unwrap();
    let joints = mechanism.joints.iter().zip(q);
    let frame = joints.fold(Pose::identity(), |frame, (joint, q)| {
        frame.then(&joint.at(*q))
    });
    (frame.rotation * tip + frame.origin).z
}

#[test]
fn an_arm_keeps_off_the_table() {
    let model = chain(4);
    let free = arm_limits(4, 90.0);
    let tip = Vector3::new(0.0, 0.0, 0.25);
    let tabled = Limits {
        spheres: vec![Sphere {
            joint: Some(Joint::at(3)),
            centre: tip,
            radius: 0.05,
        }],
        boxes: vec![Cuboid {
            least: Vector3::new(-2.0, -2.0, -1.0),
            greatest: Vector3::new(2.0, 2.0, 0.3),
        }],
        ..free.clone()
    };
    let lowest = |limits: &Limits| {
        let found = design(&model, &[], limits, 6.0, &quick(), 1, &|_| ()).unwrap();
        let heights = (0..found.time.len()).map(|row| {
            let q: Vec<f64> = found.q.iter().map(|q| q[row]).collect();
            tip_height(&model, &q, tip)
        });
        (heights.fold(f64::INFINITY, f64::min), found.clearance_m)
    };
    let (without, none) = lowest(&free);
    assert!(without < 0.3 && none.is_none(), "{without}");
    let (with, clearance) = lowest(&tabled);
    assert!(with >= 0.35, "{with}");
    assert!((clearance.unwrap() - (with - 0.35)).abs() < 2e-3);
}

#[test]
fn designed_motions_tell_more_than_random_ones() {
    let (model, limits) = (chain(4), arm_limits(4, 90.0));
    let designer = Designer::new(&model, &[], &limits, 6.0, &quick()).unwrap();
    let best = designer.best(1, &|_| ()).unwrap();
    for seed in 0..20 {
        let random = designer.random(seed).unwrap();
        assert!(best.log_determinant > random.log_determinant);
    }
}

#[test]
fn commands_of_a_drive_keep_their_range() {
    let mut limits = limits(vec![joint([-1.2, 1.2], 2.0)]);
    limits.joints[0].command = Some([-4.0, 4.0]);
    limits.joints[0].command_rate = Some(40.0);
    let model = model("motor");
    let found = design(&model, &[], &limits, 6.0, &quick(), 1, &|_| ()).unwrap();
    let volts = &found.command[0];
    assert!(volts.iter().all(|volt| volt.abs() <= 4.0));
    let steps = volts
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs() / found.step_s);
    assert!(steps.fold(0.0, f64::max) <= 40.0);
    let most = found.uses.iter().map(|one| one.share).fold(0.0, f64::max);
    assert!((0.97..=1.0).contains(&most), "{:?}", found.uses);
    // The simulated rig does what was designed.
    let log = found.recorded_by(&model).unwrap();
    let apart = log.q[0].iter().zip(&found.q[0]).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 0.02);
}

#[test]
fn a_position_loop_whose_commands_come_late_begins_at_rest() {
    let late = with(&model("servo"), effect("actuator_delay", 1, &[0.03]));
    // The middle of the range is far from zero, where commands that were never given would be.
    let limits = limits(vec![joint([1.0, 2.0], 1.8)]);
    let found = design(&late, &[], &limits, 4.0, &Settings::default(), 1, &|_| ()).unwrap();
    let log = found.recorded_by(&late).unwrap();
    let off = (log.q[0].iter().zip(&found.q[0])).map(|(q, reference)| (q - reference).abs());
    assert!(off.take(10).all(|off| off < 0.02));
}

//! What logs cannot tell is found.

use crate::support::{arm_limits, chain, effect, with};
use residyn_core::data::{Joint, Log};
use residyn_core::model::Model;
use residyn_excite::{Designer, Settings, excitation};

fn arm() -> Model {
    let model = chain(4);
    (1..=4).fold(model, |model, joint| {
        with(&model, effect("coulomb_friction", joint, &[0.3]))
    })
}

/// A log of ten seconds in which the arm does this, with the torque that it takes.
fn log(model: &Model, angle: impl Fn(usize, f64) -> f64) -> Log {
    let rows = 1001;
    let time: Vec<f64> = (0..rows).map(|row| 0.01 * row as f64).collect();
    let n = model.joints;
    let differ = |joint: usize, t: f64| {
        let h = 1e-4;
        let [a, b, c] = [t - h, t, t + h].map(|t| angle(joint, t));
        (b, (c - a) / (2.0 * h), (c - 2.0 * b + a) / (h * h))
    };
    let balance = model.torque_balance().unwrap();
    let mut log = Log {
        path: "run".into(),
        time: time.clone(),
        ..Log::empty(n)
    };
    for (row, t) in time.iter().enumerate() {
        let state =
            |t: f64| -> Vec<(f64, f64, f64)> { (0..n).map(|joint| differ(joint, t)).collect() };
        let (now, acts) = (state(*t), state(t + 0.005));
        let all = |of: fn(&(f64, f64, f64)) -> f64| -> Vec<f64> { acts.iter().map(of).collect() };
        let zeros = vec![0.0; n];
        let inputs = [
            all(|s| s.0),
            all(|s| s.1),
            zeros,
            vec![0.0],
            all(|s| s.2),
            balance.values(),
        ];
        let torque = balance.program.eval(&inputs.concat());
        for joint in 0..n {
            log.q[joint].push(now[joint].0);
            log.qd[joint].push(now[joint].1);
            // Sensors read more or less than the torque.
            let ripple = 0.02 * ((row * (joint + 3)) as f64 * 1.7).sin();
            log.tau[joint].push(torque[joint] + ripple);
        }
    }
    log
}

#[test]
fn a_rich_log_leaves_nothing_to_say() {
    let model = arm();
    let (limits, settings) = (arm_limits(4, 90.0), Settings::default());
    let designer = Designer::new(&model, &[], &limits, 10.0, &settings).unwrap();
    let motion = designer.random(1).unwrap();
    let rich = motion.recorded_by(&model).unwrap();
    let found = excitation(&model, &[rich]).unwrap();
    assert!(
        found.collinear.is_empty() && found.one_way.is_empty(),
        "{found:?}"
    );
    assert!(found.open.is_empty(), "{:?}", found.open);
    assert_eq!(found.expected.len(), found.sums);
}

#[test]
fn joints_that_never_reverse_and_poses_that_never_change_are_found() {
    let model = arm();
    // The first joint turns on, the second rocks a little, the others rest but for the last.
    let found = excitation(
        &model,
        &[log(&model, |joint, t| match joint {
            0 => 0.4 * t + 0.05 * (2.0 * t).sin(),
            1 => 0.02 * (3.0 * t).sin(),
            2 => 0.5 + 0.02 * (2.1 * t).sin(),
            _ => 0.6 * (1.3 * t).sin(),
        })],
    )
    .unwrap();
    let turning: Vec<Joint> = found.one_way.iter().map(|one| one.joint).collect();
    assert_eq!(turning, [Joint::at(0)]);
    let still: Vec<Joint> = found.gravity.iter().map(|one| one.joint).collect();
    assert!(still.contains(&Joint::at(1)), "{:?}", found.gravity);
    assert!(
        found.next.gain > 0.0 && found.next.narrows.1 > 1.0,
        "{:?}",
        found.next
    );
}

#[test]
fn commands_that_belong_together_are_found() {
    let model = arm();
    let mut one = log(&model, |joint, t| {
        0.3 * ((1.0 + joint as f64 / 7.0) * t).sin()
    });
    one.tau[2] = one.tau[1].iter().map(|tau| 0.5 * tau - 1.0).collect();
    let found = excitation(&model, &[one]).unwrap();
    let pairs: Vec<[Joint; 2]> = found.collinear.iter().map(|pair| pair.joints).collect();
    assert_eq!(pairs, [[Joint::at(1), Joint::at(2)]]);
}

#[test]
fn a_joint_that_rests_leaves_its_sums_open() {
    let model = arm();
    let found = excitation(
        &model,
        &[log(&model, |joint, t| match joint {
            3 => 0.4,
            _ => 0.7 * ((1.0 + joint as f64 / 5.0) * t).sin(),
        })],
    )
    .unwrap();
    let named: Vec<&str> = found
        .open
        .iter()
        .flatten()
        .map(|(name, _)| name.as_str())
        .collect();
    assert!(named.contains(&"F_c4"), "{named:?}");
    assert!(
        found.next.joints.contains(&Joint::at(3)),
        "{:?}",
        found.next
    );
}

#[test]
fn every_kind_of_rig_is_examined() {
    for (name, torque) in [("pendulum", 8.0), ("servo", 1.8), ("motor", 2.0)] {
        let model = crate::support::model(name);
        let limits = crate::support::limits(vec![crate::support::joint([-1.0, 1.0], torque)]);
        let settings = Settings::default();
        let designer = Designer::new(&model, &[], &limits, 8.0, &settings).unwrap();
        let log = designer.random(3).unwrap().recorded_by(&model).unwrap();
        let found = excitation(&model, &[log]).unwrap();
        assert!(
            found.sums >= 2 && found.open.is_empty(),
            "{name}: {found:?}"
        );
        assert!(found.one_way.is_empty(), "{name}: {:?}", found.one_way);
    }
}

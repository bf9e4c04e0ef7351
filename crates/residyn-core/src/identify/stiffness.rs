//! How fast dry friction brings a joint to rest, or swings it about where it sticks. In steps that are too long for it, a joint that rests chatters, and
//! the cost of a fit jumps from one value of a parameter to the next.

use super::sensitivity::{LANES, Local, Tangent};
use super::shooting::Shooting;
use super::values::Values;
use crate::data::{Log, Measured};
use crate::lanes::Row;
use crate::model::Dynamics;
use crate::sim::{Scheme, Steps, Window};

/// Of the longest step at which the scheme still follows a decay, this share is used: bodies move, and their inertia
/// with them.
const STABLE_SHARE: f64 = 0.7;

/// The steps of a fit in which every joint of a model comes to rest as it should: its own, or shorter ones, but none below
/// `shortest_s`.
pub fn stable_steps(shooting: &Shooting<'_>, dynamics: &Dynamics, shortest_s: f64) -> Steps {
    let own = shooting.steps();
    own.at_most(longest_stable_step(shooting, dynamics, own.scheme).max(shortest_s))
}

/// The longest step in s at which every joint of a model comes to rest as it should in steps of a scheme, at the places where the
/// windows begin; infinite without friction.
pub fn longest_stable_step(shooting: &Shooting<'_>, dynamics: &Dynamics, scheme: &Scheme) -> f64 {
    let values = Values::of(dynamics, shooting.logs);
    let tangent = Tangent::new(dynamics, &[], Local::State);
    let of_some =
        |windows: &[Window]| fastest(shooting, &tangent, &values, dynamics, windows, scheme);
    let shares = shooting.windows.chunks(LANES).map(of_some);
    STABLE_SHARE / shares.fold(0.0, f64::max)
}

/// The largest sum of the rates (1/s) at which the joints' velocities decay at standstill, or swing about the internal
/// states that hold them, as shares of those that a step of 1 s could follow: no eigenvalue of the friction exceeds it.
fn fastest<'l>(
    shooting: &Shooting<'l>,
    tangent: &Tangent,
    values: &Values,
    dynamics: &Dynamics,
    windows: &[Window],
    scheme: &Scheme,
) -> f64 {
    let named = |log: &'l Log| Measured::named(&log.measured, dynamics.measured_names());
    let given: Vec<Vec<&Vec<f64>>> = shooting.logs.iter().map(named).collect();
    let (n, layout) = (tangent.joints, dynamics.layout());
    let mut tape = (tangent.program).tape_at::<f64, LANES>(tangent.first_parameter, &values.common);
    let at = |lane: usize| &windows[lane.min(windows.len() - 1)];
    let inputs = tape.moving();
    for joint in 0..n {
        inputs[joint] = Row::from_fn(|lane| shooting.logs[at(lane).log].q[joint][at(lane).first]);
        let tau = |lane: usize| shooting.logs[at(lane).log].held(joint, at(lane).first);
        inputs[layout.driving().start + joint] = Row::from_fn(tau);
    }
    let measured = layout.driving().end..layout.given().end;
    for (k, input) in inputs[measured].iter_mut().enumerate() {
        let held = |lane: usize| given[at(lane).log][k][at(lane).first];
        *input = Row::from_fn(held);
    }
    tape.run();
    let decay = |joint: usize, lane: usize| -tape.output(tangent.by_state(joint, n + joint))[lane];
    let swing = |joint: usize, lane: usize| -> f64 {
        let held = |state: usize| {
            let rate = tangent.rate_by_state(state - 2 * n, n + joint)?;
            let force = tape.output(tangent.by_state(joint, state))[lane];
            Some((-force * tape.output(rate)[lane]).max(0.0))
        };
        layout.internal().filter_map(held).sum::<f64>().sqrt()
    };
    let of_joint = |joint: usize, lane: usize| {
        let decay = decay(joint, lane).max(0.0) / scheme.most_damping;
        match swing(joint, lane) {
            0.0 => decay,
            swing => decay + swing / scheme.most_swing,
        }
    };
    let all = |lane: usize| -> f64 { (0..n).map(|joint| of_joint(joint, lane)).sum() };
    (0..LANES).map(all).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::longest_stable_step;
    use crate::data::{Joint, Log};
    use crate::identify::{Shooting, cut};
    use crate::model::{FittedEffect, Library};
    use crate::sim::RK4;

    /// Friction of 0.4 N m that reverses over 1 mrad/s brings an inertia of 1 kg m^2 to rest at 400/s.
    #[test]
    fn steps_follow_how_fast_friction_brings_a_joint_to_rest() {
        let library = Library::built_in();
        let friction = library.effect("coulomb_friction").unwrap();
        let rig = "[system]\nname = \"joint\"\njoints = 1\n[parameters]\nJ = { value = 1 }\n\
                   [dynamics]\nmass = [[\"J\"]]\nbias = [\"0\"]\n";
        let rig = library.model_from_text("joint.toml", rig).unwrap();
        let mut log = Log::empty(1);
        log.time = (0..100).map(|row| 0.01 * f64::from(row)).collect();
        let rest = vec![vec![0.0; 100]];
        (log.q, log.qd, log.tau) = (rest.clone(), rest.clone(), rest);
        let logs = [log];
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[1e-3]);
        let step_s = |size: f64, width: f64| {
            let mut effect = FittedEffect::absent(friction, Joint::at(0));
            effect.values[0].0 = size;
            let model = rig
                .with_effects(vec![effect])
                .with_smoothing_velocities(vec![width]);
            longest_stable_step(&shooting, &model.dynamics(), RK4)
        };
        let usual = step_s(0.4, 1e-3);
        assert!((2e-3..1e-2).contains(&usual), "{usual}");
        assert!((step_s(0.8, 1e-3) / usual - 0.5).abs() < 1e-9);
        assert!((step_s(0.4, 5e-4) / usual - 0.5).abs() < 1e-9);
        assert_eq!(step_s(0.0, 1e-3), f64::INFINITY);
    }
}

//! The equations of the built-in systems, written by hand.

use nalgebra::{Matrix4, Vector4};

/// Accelerations from `[q, qd, tau, t, parameters]`.
pub type Oracle = fn(&[f64]) -> Vec<f64>;

pub const ORACLES: [(&str, Oracle); 4] = [
    ("pendulum", pendulum),
    ("acrobot", acrobot),
    ("cartpole", cartpole),
    ("drive", drive),
];

/// Systems driven by commands instead of torques.
pub const COMMANDED: [(&str, Oracle); 2] = [("servo", servo), ("motor", motor)];

fn pendulum(x: &[f64]) -> Vec<f64> {
    let [phi, _, a, _, c_g, c_i] = x.try_into().unwrap();
    vec![c_g * phi.sin() + c_i * a]
}

/// As published, corrected: Spong's equations with a torque on both joints.
fn acrobot(x: &[f64]) -> Vec<f64> {
    let [phi1, phi2, phid1, phid2, tau1, tau2, _, rest @ ..] = x else {
        unreachable!()
    };
    let &[m1, m2, l1, lc1, lc2, i1, i2, g] = rest else {
        unreachable!()
    };
    let d1 =
        m1 * lc1.powi(2) + m2 * (l1.powi(2) + lc2.powi(2) + 2.0 * l1 * lc2 * phi2.cos()) + i1 + i2;
    let d2 = m2 * (lc2.powi(2) + l1 * lc2 * phi2.cos()) + i2;
    let s2 = m2 * lc2 * g * (phi1 + phi2).sin();
    let s1 = -m2 * l1 * lc2 * phid2 * phi2.sin() * (phid2 + 2.0 * phid1)
        + (m1 * lc1 + m2 * l1) * g * phi1.sin()
        + s2;
    let phidd2 = (tau2 - d2 / d1 * (tau1 - s1) - m2 * l1 * lc2 * phid1.powi(2) * phi2.sin() - s2)
        / (m2 * lc2.powi(2) + i2 - d2.powi(2) / d1);
    vec![(tau1 - d2 * phidd2 - s1) / d1, phidd2]
}

/// Newton and Euler for both bodies, with the forces (x, y) that the cart puts on the pole at the joint
/// as unknowns besides the accelerations.
fn cartpole(x: &[f64]) -> Vec<f64> {
    let &[
        _,
        angle,
        _,
        spin,
        force,
        torque,
        _,
        cart,
        pole,
        l,
        inertia,
        g,
    ] = x
    else {
        unreachable!()
    };
    let (s, c) = angle.sin_cos();
    #[rustfmt::skip]
    let matrix = Matrix4::new(
        // cart:                cart a = force - x
        cart, 0.0, 1.0, 0.0,
        // pole, sideways:      pole (a + l c spin' - l s spin^2) = x
        pole, pole * l * c, -1.0, 0.0,
        // pole, up:            pole (-l s spin' - l c spin^2) = y - pole g
        0.0, -pole * l * s, 0.0, -1.0,
        // pole, turning right: inertia spin' = torque + y l s - x l c
        0.0, inertia, l * c, -l * s,
    );
    let right = Vector4::new(
        force,
        pole * l * s * spin * spin,
        pole * l * c * spin * spin - pole * g,
        torque,
    );
    let solution = matrix.lu().solve(&right).unwrap();
    vec![solution[0], solution[1]]
}

fn drive(x: &[f64]) -> Vec<f64> {
    let [_, _, force, _, m] = x.try_into().unwrap();
    vec![force / m]
}

/// A link pulled to its target by a spring with limited torque.
fn servo(x: &[f64]) -> Vec<f64> {
    let [q, v, target, _, inertia, gravity, stiffness, damping, limit] = x.try_into().unwrap();
    let pull = stiffness * (target - q) - damping * v;
    let held = if pull.abs() > limit {
        limit.copysign(pull)
    } else {
        pull
    };
    vec![(held - gravity * q.sin()) / inertia]
}

/// A pendulum on a motor whose current follows from its voltage minus its back-EMF.
fn motor(x: &[f64]) -> Vec<f64> {
    let [q, v, volts, _, inertia, gravity, constant, resistance] = x.try_into().unwrap();
    let current = (volts - constant * v) / resistance;
    vec![(constant * current - gravity * q.sin()) / inertia]
}

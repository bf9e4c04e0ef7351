use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// One number for each of two joints; the second is idle in a rig with one joint.
pub type Pair = [f64; 2];

/// The bare mechanism: `mass(q) a + bias(q, v) = torque`, written by hand. Angles in rad, q = 0 hangs down, the
/// second joint is relative to the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "form", rename_all = "snake_case", deny_unknown_fields)]
pub enum Mechanics {
    /// A rod on a pivot.
    Pendulum {
        /// About the pivot \[kg m^2\].
        inertia: f64,
        /// Mass times distance of the centre of mass \[kg m\].
        moment: f64,
        /// \[m/s^2\]
        g: f64,
    },
    /// Two links, both joints driven; SI units.
    DoublePendulum {
        m1: f64,
        m2: f64,
        l1: f64,
        lc1: f64,
        lc2: f64,
        #[serde(rename = "I1")]
        i1: f64,
        #[serde(rename = "I2")]
        i2: f64,
        g: f64,
    },
}

impl Mechanics {
    /// Number of joints.
    pub fn joints(&self) -> usize {
        match self {
            Self::Pendulum { .. } => 1,
            Self::DoublePendulum { .. } => 2,
        }
    }

    /// Mass matrix \[kg m^2\].
    pub fn mass(&self, q: Pair) -> [Pair; 2] {
        match *self {
            Self::Pendulum { inertia, .. } => [[inertia, 0.0], [0.0, 1.0]],
            Self::DoublePendulum {
                m1,
                m2,
                l1,
                lc1,
                lc2,
                i1,
                i2,
                ..
            } => {
                let outer = i2 + m2 * lc2 * lc2;
                let coupling = m2 * l1 * lc2 * q[1].cos();
                let inner = i1 + m1 * lc1 * lc1 + m2 * l1 * l1;
                [
                    [inner + outer + 2.0 * coupling, outer + coupling],
                    [outer + coupling, outer],
                ]
            }
        }
    }

    /// Bias torques: gravity, turned by `tilt` rad, and velocity-dependent inertial torques \[N m\].
    pub fn bias(&self, q: Pair, v: Pair, tilt: f64) -> Pair {
        match *self {
            Self::Pendulum { moment, g, .. } => [moment * g * (q[0] + tilt).sin(), 0.0],
            Self::DoublePendulum {
                m1,
                m2,
                l1,
                lc1,
                lc2,
                g,
                ..
            } => {
                let shoulder = (m1 * lc1 + m2 * l1) * g * (q[0] + tilt).sin();
                let elbow = m2 * lc2 * g * (q[0] + q[1] + tilt).sin();
                let turning = m2 * l1 * lc2 * q[1].sin();
                [
                    shoulder + elbow - turning * v[1] * (2.0 * v[0] + v[1]),
                    elbow + turning * v[0] * v[0],
                ]
            }
        }
    }

    /// Give a parameter another value; `None` if there is no such parameter.
    pub fn set(&mut self, name: &str, value: f64) -> Option<()> {
        let mut fields = serde_json::to_value(&*self).ok()?;
        *fields.get_mut(name)? = value.into();
        *self = serde_json::from_value(fields).ok()?;
        Some(())
    }

    /// True values of the parameters that a declared model names differently and that its logs determine, with a rotor
    /// of inertia `rotor` \[kg m^2\] on the first joint.
    pub fn declared(&self, rotor: f64) -> BTreeMap<String, f64> {
        match *self {
            Self::Pendulum { inertia, moment, g } => [
                ("C_g".to_owned(), -moment * g / (inertia + rotor)),
                ("C_i".to_owned(), 1.0 / (inertia + rotor)),
                ("inertia".to_owned(), inertia + rotor),
                ("moment".to_owned(), moment),
            ]
            .into(),
            Self::DoublePendulum { m1, m2, i1, i2, .. } => [
                ("mass_1".to_owned(), m1),
                ("mass_2".to_owned(), m2),
                ("inertia_1".to_owned(), i1 + rotor),
                ("inertia_2".to_owned(), i2),
            ]
            .into(),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{Mechanics, Pair};

    pub fn pendulum() -> Mechanics {
        Mechanics::Pendulum {
            inertia: 0.15,
            moment: 0.3,
            g: 9.81,
        }
    }

    pub fn double_pendulum() -> Mechanics {
        Mechanics::DoublePendulum {
            m1: 1.2,
            m2: 0.9,
            l1: 0.8,
            lc1: 0.45,
            lc2: 0.45,
            i1: 0.5,
            i2: 0.4,
            g: 9.8,
        }
    }

    /// Energy from positions and speeds of the two centres of mass \[J\], without the mass matrix.
    pub fn energy(mechanics: &Mechanics, q: Pair, v: Pair) -> f64 {
        match *mechanics {
            Mechanics::Pendulum { inertia, moment, g } => {
                0.5 * inertia * v[0] * v[0] - moment * g * q[0].cos()
            }
            Mechanics::DoublePendulum {
                m1,
                m2,
                l1,
                lc1,
                lc2,
                i1,
                i2,
                g,
            } => {
                let (a, w) = (q[0] + q[1], v[0] + v[1]);
                let speed1 = (lc1 * v[0]).powi(2);
                let across = l1 * v[0] * q[0].cos() + lc2 * w * a.cos();
                let up = l1 * v[0] * q[0].sin() + lc2 * w * a.sin();
                let height1 = -lc1 * q[0].cos();
                let height2 = -l1 * q[0].cos() - lc2 * a.cos();
                let moving = m1 * speed1 + m2 * (across * across + up * up);
                0.5 * (moving + i1 * v[0] * v[0] + i2 * w * w) + g * (m1 * height1 + m2 * height2)
            }
        }
    }
}

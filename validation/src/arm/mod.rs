//! Arms of many joints under stiff control: a prescribed motion, and the torques that it takes.

mod draw;
mod friction;
mod motion;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use self::friction::Friction;
use self::motion::Motion;
use super::bodies::Bodies;
use super::hidden::Hidden;
use super::recording::log_name;
use residyn_core::data::Log;
use residyn_core::model::Model;

/// What an arm hides in addition to bodies that differ from their model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lacks {
    Nothing,
    /// Coulomb and viscous friction on every joint.
    CoulombViscous,
    /// One of four kinds on every joint.
    Friction,
    /// Friction as above, and load-dependent friction on one joint.
    LoadFriction,
    /// Friction as above, and a motor that turns with two joints.
    Coupling,
    /// Friction as above, and a load at the tip.
    Payload,
}

impl Lacks {
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::CoulombViscous => "coulomb_viscous",
            Self::Friction => "friction",
            Self::LoadFriction => "load_friction",
            Self::Coupling => "coupling",
            Self::Payload => "payload",
        }
    }
}

/// What a row of a torque column holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Column {
    /// The torque at its time.
    #[default]
    Sampled,
    /// The torque commanded from its time to the next.
    Held,
    /// The mean since the row before.
    Mean,
}

impl Column {
    /// The instants whose mean a row holds, in periods after its own.
    fn instants(self) -> Vec<f64> {
        const EACH: u32 = 8;
        let after = (0..EACH).map(|k| (f64::from(k) + 0.5) / f64::from(EACH));
        match self {
            Self::Sampled => vec![0.0],
            Self::Held => after.collect(),
            Self::Mean => after.map(|share| share - 1.0).collect(),
        }
    }
}

/// An arm of the bench.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    pub lacks: Lacks,
    /// Bodies are off by shares of their mass and size within this range, up or down.
    pub bodies: [f64; 2],
    /// Largest amplitude of each joint, rad.
    pub amplitude: Vec<f64>,
    pub rate_hz: f64,
    /// Length of each log \[s\]; the last one is the test.
    pub seconds: Vec<f64>,
    /// Noise of angles \[rad\], and of torques as a share of their root mean square.
    pub noise: [f64; 2],
    #[serde(default)]
    pub column: Column,
}

impl Arm {
    /// The effects that this arm hides.
    ///
    /// # Errors
    /// A model that is not a chain of bodies.
    pub(crate) fn hidden(&self, model: &Model, rng: &mut impl Rng) -> Result<Vec<Hidden>, String> {
        let bodies = Bodies::of(model).ok_or("its model is not a chain of bodies")?;
        let motion = Motion::draw(&self.amplitude, rng);
        Ok(self.draw(&bodies, &motion, rng))
    }

    /// Logs of the arm with these effects, on bodies that differ from their model.
    ///
    /// # Errors
    /// As [`Arm::hidden`], and effects that an arm cannot have.
    pub(crate) fn record(
        &self,
        model: &Model,
        effects: &[Hidden],
        rng: &mut impl Rng,
    ) -> Result<Vec<Log>, String> {
        let drawn = Bodies::of(model).ok_or("its model is not a chain of bodies")?;
        let mut bodies = drawn.off_by(self.bodies, rng);
        let friction = Friction::of(effects, model.joints, &mut bodies)?;
        let lengths = self.seconds.iter().enumerate();
        let logs = lengths.map(|(index, seconds)| {
            let motion = Motion::draw(&self.amplitude, rng);
            let mut log = self.run(&bodies, &friction, &motion, *seconds);
            self.add_noise(&mut log, rng);
            log.path = log_name(index).into();
            log
        });
        Ok(logs.collect())
    }

    fn run(&self, bodies: &Bodies, friction: &Friction, motion: &Motion, seconds: f64) -> Log {
        let mut log = Log::empty(self.amplitude.len());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand rows
        let rows = (self.rate_hz * seconds) as usize;
        let torques = |time: f64| {
            let [q, qd, qdd] = motion.at(time);
            friction.commanded(&bodies.torques(&q, &qd, &qdd), &qd, &qdd)
        };
        for row in 0..rows {
            let time = row as f64 / self.rate_hz;
            let [q, qd, _] = motion.at(time);
            let tau = self.logged(row, torques);
            log.time.push(time);
            for (channels, values) in [(&mut log.q, q), (&mut log.qd, qd), (&mut log.tau, tau)] {
                channels.iter_mut().zip(values).for_each(|(c, v)| c.push(v));
            }
        }
        log
    }

    /// What the torque columns hold in a row.
    fn logged(&self, row: usize, torques: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
        let instants = self.column.instants();
        let all = instants
            .iter()
            .map(|after| torques((row as f64 + after) / self.rate_hz));
        let sum = all.reduce(|sum, more| sum.iter().zip(more).map(|(a, b)| a + b).collect());
        let count = instants.len() as f64;
        sum.unwrap_or_default()
            .iter()
            .map(|sum| sum / count)
            .collect()
    }

    fn add_noise(&self, log: &mut Log, rng: &mut impl Rng) {
        let [of_angles, of_torques] = self.noise;
        let mut add = |values: &mut Vec<f64>, deviation: f64| {
            for value in values {
                let drawn: f64 = StandardNormal.sample(rng);
                *value += deviation * drawn;
            }
        };
        for (q, tau) in log.q.iter_mut().zip(&mut log.tau) {
            let mean = tau.iter().map(|tau| tau * tau).sum::<f64>() / tau.len() as f64;
            add(q, of_angles);
            add(tau, of_torques * mean.sqrt());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Arm, Column, Lacks};

    #[test]
    fn a_row_holds_the_torque_of_its_time_of_the_time_after_or_before() {
        let logged = |column| {
            let arm = Arm {
                lacks: Lacks::Nothing,
                bodies: [0.1, 0.3],
                amplitude: vec![1.0],
                rate_hz: 100.0,
                seconds: vec![1.0],
                noise: [0.0; 2],
                column,
            };
            arm.logged(10, |time| vec![time])[0]
        };
        for (column, wanted) in [
            (Column::Sampled, 0.1),
            (Column::Held, 0.105),
            (Column::Mean, 0.095),
        ] {
            assert!((logged(column) - wanted).abs() < 1e-12, "{column:?}");
        }
    }
}

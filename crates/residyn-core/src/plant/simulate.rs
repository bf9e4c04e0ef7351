use rand::Rng;
use rand_distr::{Distribution, Normal};

use super::file::{Plant, PlantError};
use crate::data::Log;
use crate::lanes::Row;
use crate::limits::is_reading;
use crate::model::{Dynamics, Model};
use crate::sim::{Commands, Hold, RIG_S, RK4, Simulator, substeps};

/// Velocity over which dry friction reverses (rad/s): much narrower than in any fit.
const SIGN_WIDTH: f64 = 1e-3;

impl Plant {
    /// The rig as a model: its true values and effects.
    pub fn model(&self) -> Model {
        let mut model = self.system.with_effects(self.effects.clone());
        for (parameter, value) in model.parameters.iter_mut().zip(&self.parameters) {
            parameter.value = *value;
        }
        model.with_smoothing_velocities(vec![SIGN_WIDTH; model.joints])
    }

    /// The true equations of motion, with their true values.
    pub fn dynamics(&self) -> Dynamics {
        self.model().dynamics()
    }

    /// Record one log. Velocities are backward differences of the measured angles, as on many rigs.
    ///
    /// # Errors
    /// A rig that diverges, or one whose model reads measured columns.
    pub fn record(&self, rng: &mut impl Rng) -> Result<Log, PlantError> {
        self.check_measured()?;
        let n = self.system.joints;
        let tones = self.excitation.draw(rng);
        let dynamics = self.dynamics();
        let dt = 1.0 / self.sensor.rate_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // checked to be a few thousand
        let rows = (self.recording.duration_s * self.sensor.rate_hz).round() as usize + 1;
        let substeps = substeps(&Row([dt]), RIG_S);
        let mut log = Log {
            driven_by: self.system.driven_by(),
            ..Log::empty(n)
        };
        #[allow(clippy::cast_precision_loss)] // a few thousand rows
        let times: Vec<f64> = (0..rows).map(|row| row as f64 * dt).collect();
        let driving: Vec<Vec<f64>> = times.iter().map(|time| tones.at(*time)).collect();
        let of_joint = |joint: usize| driving.iter().map(|tau| tau[joint]).collect();
        let by_joint: Vec<Vec<f64>> = (0..n).map(of_joint).collect();
        let commands = [&Commands::new(&dynamics, &times, &by_joint)];
        let mut simulator = Simulator::new(&dynamics, RK4);
        simulator.place(&self.as_read(&self.recording.start));
        for (row, (&time, tau)) in times.iter().zip(&driving).enumerate() {
            let [angles, _] = simulator.shown(commands, [row]);
            self.measure(&mut log, time, angles, tau, rng);
            let held: Vec<Row<f64, 1>> = tau.iter().map(|tau| Row([*tau])).collect();
            simulator.advance(&Hold::lasting(commands, &held, Row([time]), dt, substeps));
            if !simulator.state.iter().all(|value| is_reading(value[0])) {
                return Err(self.diverged(time));
            }
        }
        Ok(log)
    }

    /// Nothing says what further measured columns would read on a simulated rig.
    ///
    /// # Errors
    /// A model that reads some.
    pub fn check_measured(&self) -> Result<(), PlantError> {
        Ok(self.system.runs_without_logs("a simulated rig")?)
    }

    /// Why the rig diverged at a time \[s\].
    pub(super) fn diverged(&self, time_s: f64) -> PlantError {
        match self.model().mass_fault() {
            Some(fault) => PlantError::Mass { time_s, fault },
            None => PlantError::Diverged { time_s },
        }
    }

    /// A true state as the sensors read it: the state of the equations.
    pub fn as_read(&self, state: &[f64]) -> Vec<f64> {
        let mut start = state.to_vec();
        let sensors = self.effects.iter().filter(|e| e.effect.is_of_sensor());
        for effect in sensors {
            let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
            let angle = &mut start[effect.joint];
            *angle = effect.effect.reading(&values, *angle);
        }
        start
    }

    fn measure(
        &self,
        log: &mut Log,
        time: f64,
        angles: &[Row<f64, 1>],
        tau: &[f64],
        rng: &mut impl Rng,
    ) {
        let noise = Normal::new(0.0, self.sensor.position_noise)
            .expect("a standard deviation is not negative");
        let previous = log.time.last().copied();
        log.time.push(time);
        for j in 0..tau.len() {
            let step = self.sensor.position_step;
            let read = angles[j][0] + noise.sample(rng);
            let q = match step > 0.0 {
                true => (read / step).round() * step,
                false => read,
            };
            let qd = match (previous, log.q[j].last()) {
                (Some(before), Some(last)) => (q - last) / (time - before),
                _ => 0.0,
            };
            log.q[j].push(q);
            log.qd[j].push(qd);
            log.tau[j].push(tau[j]);
        }
    }
}

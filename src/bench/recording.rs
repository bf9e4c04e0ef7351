//! A rig is driven and its encoders are read: one log.

use std::path::PathBuf;

use rand::Rng;
use rand_distr::{Distribution, Normal};
use serde::{Deserialize, Serialize};

use super::drive::{Approach, whole_steps};
use super::excitation::{Controller, Multisine};
use super::machine::{Machine, State};
use super::mechanics::Pair;
use super::motion::STEP_S;
use crate::data::Log;

/// How a rig is driven: numbers of its joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Driving {
    /// Band of torques and references \[Hz\].
    pub band_hz: [f64; 2],
    /// Open loop: root mean square of the torque \[N m\].
    pub torque: Vec<f64>,
    /// Closed loop: root mean square of the reference \[rad\].
    pub reference: Vec<f64>,
    /// Gains of the controller \[N m/rad\], \[N m s/rad\].
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
    /// Largest torque that it commands \[N m\].
    pub limit: Vec<f64>,
}

/// Whether the torque answers to what is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loop {
    Open,
    Closed,
}

/// How logs are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    #[serde(rename = "loop")]
    pub drive: Loop,
    pub rate_hz: f64,
    /// Standard deviation of white noise on positions \[rad\].
    pub noise: f64,
    /// Step of the encoder \[rad\]; zero for a fine one.
    #[serde(default)]
    pub quantum: f64,
    pub logs: usize,
    pub seconds: f64,
}

/// Logs differ in how hard the rig is driven; the last of them lies within the range of the others where there
/// are more than two.
const STRENGTHS: [f64; 6] = [1.2, 0.5, 0.8, 1.0, 0.7, 0.9];

/// Where the torque comes from.
enum Source {
    Open(Multisine),
    Closed(Multisine, Controller),
}

impl Source {
    fn draw(driving: &Driving, how: Loop, strength: f64, j: usize, rng: &mut impl Rng) -> Self {
        match how {
            Loop::Open => {
                let size = strength * driving.torque[j];
                Self::Open(Multisine::draw(size, driving.band_hz, rng))
            }
            Loop::Closed => {
                let size = strength * driving.reference[j];
                let reference = Multisine::draw(size, driving.band_hz, rng);
                let controller =
                    Controller::new(driving.stiffness[j], driving.damping[j], driving.limit[j]);
                Self::Closed(reference, controller)
            }
        }
    }

    fn command(&mut self, measured: f64, time: f64, dt: f64) -> f64 {
        match self {
            Self::Open(torque) => torque.at(time),
            Self::Closed(reference, controller) => {
                let wanted = [reference.at(time), reference.rate(time)];
                controller.command(measured, wanted, dt)
            }
        }
    }
}

/// Reads one encoder: offset, white noise, rounding.
fn read(angle: f64, condition: &Condition, rng: &mut impl Rng) -> f64 {
    let noise = Normal::new(0.0, condition.noise).expect("the grid was checked");
    let angle = angle + noise.sample(rng);
    match condition.quantum {
        quantum if quantum > 0.0 => (angle / quantum).round() * quantum,
        _ => angle,
    }
}

/// Commands of a rig and what its drives are given of them.
struct Wires {
    /// One each step from the start.
    commands: Vec<Pair>,
    given: [Approach; 2],
}

impl Wires {
    /// The command of joint `j` that is `steps` old in step `row`; before the start there was none.
    fn command(&self, row: usize, steps: usize, j: usize) -> f64 {
        row.checked_sub(steps).map_or(0.0, |k| self.commands[k][j])
    }

    /// Each joint's drive gets the target that its delay brings from `at` s after the start of step `row` on.
    fn set(&mut self, machine: &Machine, row: usize, dt: f64, at: f64) {
        for j in 0..machine.joints() {
            let drive = &machine.drives[j];
            let (steps, rest) = whole_steps(drive.delay, dt);
            let target = self.command(row, steps + usize::from(at < rest), j);
            #[allow(clippy::cast_precision_loss)] // rows are few
            let now = row as f64 * dt + at;
            self.given[j] = Approach {
                since: now,
                from: self.given[j].at(now, drive.lag),
                target,
            };
        }
    }
}

impl Machine {
    /// Record the `index`-th log of a rig that starts at rest, hanging down; encoders read too much by `offset`
    /// rad. Velocities are backward differences of what the encoders read.
    pub fn record(
        &self,
        driving: &Driving,
        condition: &Condition,
        index: usize,
        offset: Pair,
        rng: &mut impl Rng,
    ) -> Log {
        let joints = self.joints();
        let strength = STRENGTHS[index % STRENGTHS.len()];
        let mut sources: Vec<Source> = (0..joints)
            .map(|j| Source::draw(driving, condition.drive, strength, j, rng))
            .collect();
        let dt = 1.0 / condition.rate_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
        let rows = (condition.seconds * condition.rate_hz).round() as usize + 1;
        let mut wires = Wires {
            commands: Vec::with_capacity(rows),
            given: [Approach::default(); 2],
        };
        let mut state = State::at_rest([0.0; 2]);
        let mut log = empty(index, joints);
        for row in 0..rows {
            #[allow(clippy::cast_precision_loss)] // rows are few
            let time = row as f64 * dt;
            let encoders = self.encoders(&state);
            let mut command = [0.0; 2];
            for j in 0..joints {
                let q = read(encoders[j] + offset[j], condition, rng);
                command[j] = sources[j].command(q, time, dt);
                let qd = log.q[j].last().map_or(0.0, |last| (q - last) / dt);
                log.q[j].push(q);
                log.qd[j].push(qd);
                log.tau[j].push(command[j]);
            }
            log.time.push(time);
            wires.commands.push(command);
            self.hold(&mut state, &mut wires, row, dt);
        }
        log
    }

    /// Move over one step of the log, halting where a delay brings in the next command.
    fn hold(&self, state: &mut State, wires: &mut Wires, row: usize, dt: f64) {
        let changes = [0, 1].map(|j| whole_steps(self.drives[j].delay, dt).1);
        let mut cuts = vec![0.0, changes[0], changes[1], dt];
        cuts.sort_by(f64::total_cmp);
        for span in cuts.windows(2).filter(|span| span[1] > span[0]) {
            wires.set(self, row, dt, span[0]);
            #[allow(clippy::cast_precision_loss)] // rows are few
            let from = row as f64 * dt + span[0];
            self.advance(state, from, span[1] - span[0], &wires.given, STEP_S);
        }
    }
}

fn empty(index: usize, joints: usize) -> Log {
    Log {
        path: PathBuf::from(format!("log{}.csv", index + 1)),
        time: Vec::new(),
        q: vec![Vec::new(); joints],
        qd: vec![Vec::new(); joints],
        tau: vec![Vec::new(); joints],
        leave_out: Vec::new(),
        notes: Vec::new(),
    }
}

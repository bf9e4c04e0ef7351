//! Position-controlled robots: joints on loops that follow targets, on bodies that differ from their model.

mod draw;
mod servo;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use self::servo::{Motion, Rig, Servo};
use super::bodies::Bodies;
use super::condition::check_rows;
use super::excitation::Multisine;
use super::hidden::Hidden;
use super::recording::{STRENGTHS, log_name};
use super::sensors::{Clock, Flaws, Losses, Speed, repeat, sensed};
use residyn_core::data::{Joint, Log, Quantity};
use residyn_core::limits::{RUNS, check_readings};
use residyn_core::model::Model;

/// What a robot hides in addition to bodies that differ from their model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hides {
    Nothing,
    /// Friction and rotors on most joints; on every second robot a delay of all targets.
    Drives,
    /// As above, and one of like joints has more friction than the others.
    Worn,
    /// As above, and drives that give more or less torque than their loops ask for, where gravity tells.
    Gains,
    /// As above, and like joints whose drives give less torque than their loops ask for at times.
    Limits,
    /// As above, and sensors that read high or low.
    Zeros,
    /// As `Drives`, and all joints move as one.
    Together,
}

impl Hides {
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Drives => "drives",
            Self::Worn => "worn",
            Self::Gains => "gains",
            Self::Limits => "limits",
            Self::Zeros => "zeros",
            Self::Together => "together",
        }
    }
}

/// How a robot is built and how its logs are taken; `targets` has one number per joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Build {
    /// Bodies are off by shares of their mass and size within this range, up or down.
    pub bodies: [f64; 2],
    /// Joints that are built alike, set by set; any other is like none.
    #[serde(default)]
    pub like: Vec<Vec<Joint>>,
    /// Root mean square of each joint's target about its middle \[rad\], and its band \[Hz\].
    pub targets: Vec<f64>,
    pub targets_hz: [f64; 2],
    pub rate_hz: f64,
    pub logs: usize,
    pub seconds: f64,
    /// Standard deviation of white noise on angles, and the step of the encoders \[rad\].
    pub noise: f64,
    #[serde(default)]
    pub quantum: f64,
}

impl Build {
    /// Whether logs can be taken.
    ///
    /// # Errors
    /// Why not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let [low, high] = self.targets_hz;
        let of_robot = |joint: &Joint| joint.is_of(self.targets.len());
        let sound = 0.0 < low
            && low < high
            && self.noise >= 0.0
            && self.quantum >= 0.0
            && (2..=RUNS).contains(&self.logs)
            && self.rate_hz > 0.0
            && self.seconds * self.rate_hz >= 10.0
            && self.like.iter().flatten().all(of_robot);
        if !sound {
            return Err(
                "needs increasing `targets_hz`, `noise` and `quantum` not negative, at least two logs of ten rows, and \
                 `like` joints that it has"
                    .to_owned(),
            );
        }
        check_rows(self.rate_hz, &[self.seconds])?;
        let numbers = [&self.targets[..], &self.bodies, &[self.noise, self.quantum]];
        check_readings("targets, bodies, noise and quantum", numbers.concat())
    }
}

/// A robot of the bench.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    pub hides: Hides,
    pub build: Build,
    pub flaws: Flaws,
}

impl Robot {
    /// The effects that this robot hides, in sizes that fit its motion.
    ///
    /// # Errors
    /// A model that has no bodies or no gains, or has another number of joints.
    pub(crate) fn hidden(&self, model: &Model, rng: &mut impl Rng) -> anyhow::Result<Vec<Hidden>> {
        let rig = self.as_declared(model)?;
        Ok(self.draw(&rig, rng))
    }

    /// Logs of the robot with these effects, on bodies that differ from their model.
    ///
    /// # Errors
    /// As [`Robot::hidden`], and effects that a robot cannot have.
    pub(crate) fn record(
        &self,
        model: &Model,
        effects: &[Hidden],
        rng: &mut impl Rng,
    ) -> anyhow::Result<Vec<Log>> {
        let mut rig = self.as_declared(model)?;
        rig.bodies = rig.bodies.off_by(self.build.bodies, rng);
        for effect in effects {
            let added = rig.servos[effect.joint].add(effect);
            added.map_err(anyhow::Error::msg)?;
        }
        let logs = 0..self.build.logs;
        Ok(logs.map(|index| self.run(&rig, index, rng)).collect())
    }

    /// With the bodies and the gains that its model declares, and nothing else.
    fn as_declared(&self, model: &Model) -> anyhow::Result<Rig> {
        let joints = self.build.targets.len();
        let bodies = Bodies::of(model).filter(|_| joints == model.joints);
        let needs = || anyhow::anyhow!("{}: needs the bodies of {joints} joints", model.name);
        let gain = |stem: &str, joint: Joint| {
            let name = joint.name(stem);
            let gain = model.parameters.iter().find(|own| own.name == name);
            let missing = || anyhow::anyhow!("{}: no gain `{name}`", model.name);
            gain.map(|gain| gain.value).ok_or_else(missing)
        };
        let servos = Joint::all(joints).map(|joint| {
            Ok(Servo {
                stiffness: gain("kp_", joint)?,
                damping: gain("kd_", joint)?,
                ..Servo::default()
            })
        });
        Ok(Rig {
            bodies: bodies.ok_or_else(needs)?,
            servos: servos.collect::<anyhow::Result<_>>()?,
        })
    }

    /// The angles about which the joints move \[rad\], and how each moves about its own.
    fn targets(&self, strength: f64, rng: &mut impl Rng) -> Vec<(f64, Multisine)> {
        let Build {
            targets,
            targets_hz,
            ..
        } = &self.build;
        let one = match self.hides {
            Hides::Together => Some(Multisine::draw(strength, *targets_hz, rng)),
            _ => None,
        };
        let target = |size: &f64| {
            let middle = rng.random_range(-1.0..=1.0) * size;
            let waves = match &one {
                Some(one) => one.times(*size),
                None => Multisine::draw(strength * size, *targets_hz, rng),
            };
            (middle, waves)
        };
        targets.iter().map(target).collect()
    }

    /// The `index`-th log: the robot starts at rest where its first targets are. Lost rows are not in the log, while the
    /// robot goes on.
    fn run(&self, rig: &Rig, index: usize, rng: &mut impl Rng) -> Log {
        let Self { build, flaws, .. } = self;
        let joints = rig.servos.len();
        let targets = self.targets(STRENGTHS[index % STRENGTHS.len()], rng);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand
        let rows = (build.seconds * build.rate_hz).round() as usize + 1;
        let mut clock = Clock::new(build.rate_hz, flaws);
        let mut losses = Losses::new(flaws.dropped, flaws.burst);
        let mut speeds = vec![Speed::default(); joints];
        let mut bus = Bus(vec![(f64::NEG_INFINITY, at(&targets, 0.0))]);
        let mut motion = Motion::at_rest(&at(&targets, 0.0));
        let mut log = Log {
            path: log_name(index).into(),
            driven_by: Quantity::Command,
            ..Log::empty(joints)
        };
        let (mut time, mut dt) = (0.0, 1.0 / build.rate_hz);
        for row in 0..rows {
            let is_kept = !losses.next(rng) || row == 0 || row == rows - 1;
            let wanted = at(&targets, time);
            for j in 0..joints {
                let angle = motion.q[j] + rig.servos[j].zero;
                let q = sensed(angle, build.noise, build.quantum, rng);
                let qd = speeds[j].at(q, dt, flaws.filter_s);
                if is_kept {
                    log.q[j].push(q);
                    log.qd[j].push(qd);
                    log.tau[j].push(wanted[j]);
                }
            }
            if is_kept {
                log.time.push(clock.stamp(time, rng));
            }
            bus.0.push((time, wanted));
            let next = clock.next(rng);
            for span in bus.arrivals(rig, time, next).windows(2) {
                rig.advance(&mut motion, &bus.given(rig, span[0]), span[1] - span[0]);
            }
            (dt, time) = (next - time, next);
        }
        repeat(&mut log, flaws, rng);
        log
    }
}

/// Targets at a time (s).
fn at(targets: &[(f64, Multisine)], time: f64) -> Vec<f64> {
    let target = |(middle, waves): &(f64, Multisine)| middle + waves.at(time);
    targets.iter().map(target).collect()
}

/// Instants closer than this \[s\] are the same instant: they differ by rounding.
const INSTANT_S: f64 = 1e-12;

/// The targets that were sent, each from a time on \[s\], in order.
struct Bus(Vec<(f64, Vec<f64>)>);

impl Bus {
    /// The target that each drive holds at a time \[s\].
    fn given(&self, rig: &Rig, time: f64) -> Vec<f64> {
        let held = |(j, servo): (usize, &Servo)| {
            let there = |(sent, _): &(f64, Vec<f64>)| sent + servo.drive.delay <= time + INSTANT_S;
            self.0[self.0.partition_point(there) - 1].1[j]
        };
        rig.servos.iter().enumerate().map(held).collect()
    }

    /// `from`, `to`, and the instants between them when a target arrives at a drive \[s\].
    fn arrivals(&self, rig: &Rig, from: f64, to: f64) -> Vec<f64> {
        let mut cuts = vec![from, to];
        for servo in &rig.servos {
            let arrivals = self.0.iter().map(|(sent, _)| sent + servo.drive.delay);
            let late = arrivals.rev().take_while(|at| *at > from + INSTANT_S);
            cuts.extend(late.filter(|at| *at < to - INSTANT_S));
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|next, last| *next - *last <= INSTANT_S);
        cuts
    }
}

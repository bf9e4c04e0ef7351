use std::collections::BTreeMap;

use super::drive::{Approach, Drive};
use super::laws::{At, Law};
use super::mechanics::{Mechanics, Pair};
use super::presliding::Presliding;
use super::transmission::Transmission;
use super::warming::Warming;

/// A rig with its undeclared effects.
#[derive(Debug, Clone)]
pub struct Machine {
    pub mechanics: Mechanics,
    /// Angle by which gravity is turned \[rad\].
    pub tilt: f64,
    /// Rotor inertia of each joint, which acts on that joint alone \[kg m^2\].
    pub rotor: Pair,
    /// Each with the joint that it acts on.
    pub smooth: Vec<(usize, Law)>,
    pub dry: Vec<(usize, Law)>,
    pub presliding: Vec<(usize, Presliding)>,
    /// Of all friction of a joint.
    pub warming: [Option<Warming>; 2],
    pub transmissions: [Option<Transmission>; 2],
    pub drives: [Drive; 2],
    /// Amount by which each encoder reads high \[rad\]: the parts that follow the sine and the cosine of its angle.
    pub eccentricity: [Pair; 2],
}

/// State of a rig: positions in rad, speeds in rad/s. Motor entries are used only behind a transmission, bristle
/// entries only with presliding friction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    pub q: Pair,
    pub v: Pair,
    pub motor_q: Pair,
    pub motor_v: Pair,
    pub bristle: Pair,
}

impl State {
    /// At rest, motors in the middle of their play.
    pub fn at_rest(q: Pair) -> Self {
        Self {
            q,
            motor_q: q,
            ..Self::default()
        }
    }

    pub(super) fn plus(&self, slope: &Self, h: f64) -> Self {
        let add = |a: Pair, b: Pair| [a[0] + h * b[0], a[1] + h * b[1]];
        Self {
            q: add(self.q, slope.q),
            v: add(self.v, slope.v),
            motor_q: add(self.motor_q, slope.motor_q),
            motor_v: add(self.motor_v, slope.motor_v),
            bristle: add(self.bristle, slope.bristle),
        }
    }
}

/// Direction of motion of each joint: 1, -1, or 0 if friction holds it.
pub(super) type Directions = Pair;

/// The torques at one instant, without dry friction.
pub(super) struct Balance {
    /// In s.
    time: f64,
    mass: [Pair; 2],
    /// Torque on each joint \[N m\].
    free: Pair,
    /// Torque through each gear \[N m\].
    load: Pair,
    motor_acceleration: Pair,
    bristle_rate: Pair,
}

impl Machine {
    pub fn bare(mechanics: Mechanics) -> Self {
        Self {
            mechanics,
            tilt: 0.0,
            rotor: [0.0; 2],
            smooth: Vec::new(),
            dry: Vec::new(),
            presliding: Vec::new(),
            warming: [None, None],
            transmissions: [None, None],
            drives: [Drive::default(), Drive::default()],
            eccentricity: [[0.0; 2]; 2],
        }
    }

    pub fn joints(&self) -> usize {
        self.mechanics.joints()
    }

    /// True values of declared parameters; on average, a motor behind a gear with play turns with its link.
    pub fn declared(&self) -> BTreeMap<String, f64> {
        let gear = self.transmissions[0].as_ref();
        let motor = gear
            .filter(|gear| gear.is_lumped)
            .map_or(0.0, |gear| gear.inertia);
        self.mechanics.declared(self.rotor[0] + motor)
    }

    /// The encoder readings: angles of the motors or of the joints, read from discs that may be off their axes.
    pub fn encoders(&self, state: &State) -> Pair {
        [0, 1].map(|j| {
            let angle = match &self.transmissions[j] {
                Some(gear) if gear.has_encoder => state.motor_q[j],
                _ => state.q[j],
            };
            let [by_sine, by_cosine] = self.eccentricity[j];
            angle + by_sine * angle.sin() + by_cosine * angle.cos()
        })
    }

    pub(super) fn has_dry_friction(&self, joint: usize) -> bool {
        self.dry.iter().any(|(of, _)| *of == joint)
    }

    pub(super) fn balance(&self, time: f64, state: &State, commands: &[Approach; 2]) -> Balance {
        let mut mass = self.mechanics.mass(state.q);
        let bias = self.mechanics.bias(state.q, state.v, self.tilt);
        let mut balance = Balance {
            time,
            mass,
            free: [-bias[0], -bias[1]],
            load: [0.0; 2],
            motor_acceleration: [0.0; 2],
            bristle_rate: [0.0; 2],
        };
        for j in 0..self.joints() {
            mass[j][j] += self.rotor[j];
            let drive = &self.drives[j];
            let given = commands[j].at(time, drive.lag);
            balance.load[j] = match &self.transmissions[j] {
                None => drive.shape.at(given, state.v[j]),
                Some(gear) => {
                    let driving = drive.shape.at(given, state.motor_v[j]);
                    let ahead = state.motor_q[j] - state.q[j];
                    let passed = gear.torque(ahead, state.motor_v[j] - state.v[j]);
                    balance.motor_acceleration[j] = (driving - passed) / gear.inertia;
                    passed
                }
            };
            balance.free[j] += balance.load[j];
        }
        for (j, law) in &self.smooth {
            let torque = law.at(At {
                q: state.q[*j],
                v: state.v[*j],
                t: time,
                load: balance.load[*j],
                ..At::default()
            });
            balance.free[*j] += match law.is_friction {
                true => torque * self.friction_left(*j, time),
                false => torque,
            };
        }
        for (j, friction) in &self.presliding {
            let torque = friction.torque(state.bristle[*j], state.v[*j]);
            balance.free[*j] += torque * self.friction_left(*j, time);
            balance.bristle_rate[*j] = friction.rate(state.bristle[*j], state.v[*j]);
        }
        balance.mass = mass;
        balance
    }

    /// The torques that a motion takes \[N m\].
    pub(super) fn needed(&self, time: f64, state: &State, acceleration: Pair) -> Pair {
        let balance = self.balance(time, state, &[Approach::default(); 2]);
        [0, 1].map(|j| {
            let [first, second] = balance.mass[j];
            let inertial = first * acceleration[0] + second * acceleration[1];
            let direction = state.v[j].signum();
            inertial - balance.free[j] + direction * self.level(j, direction, state, [time, 0.0])
        })
    }

    /// What is left of a joint's friction at a time \[s\], as a share.
    fn friction_left(&self, joint: usize, time: f64) -> f64 {
        let warming = self.warming[joint].as_ref();
        warming.map_or(1.0, |warming| warming.left(time))
    }

    /// Total dry-friction level of a joint against motion in `direction` \[N m\], at a time and under a load.
    fn level(&self, joint: usize, direction: f64, state: &State, [time, load]: [f64; 2]) -> f64 {
        let own = self.dry.iter().filter(|(of, _)| *of == joint);
        let at = At {
            q: state.q[joint],
            v: state.v[joint],
            load,
            direction,
            ..At::default()
        };
        let level: f64 = own.map(|(_, law)| law.at(at)).sum();
        level * self.friction_left(joint, time)
    }

    /// Accelerations while the joints move in these directions; held joints have none.
    fn accelerations(
        &self,
        balance: &Balance,
        state: &State,
        directions: Directions,
    ) -> (Pair, Pair) {
        let acting = [0, 1].map(|j| {
            let direction = directions[j];
            balance.free[j]
                - direction * self.level(j, direction, state, [balance.time, balance.load[j]])
        });
        let free = [0, 1].map(|j| directions[j] != 0.0 || !self.has_dry_friction(j));
        let a = solve(&balance.mass, acting, free);
        let held =
            [0, 1].map(|j| acting[j] - balance.mass[j][0] * a[0] - balance.mass[j][1] * a[1]);
        (a, held)
    }

    /// The directions of joints in motion, and for joints at rest the only directions consistent with the forces: held
    /// if friction can carry the net torque, else sliding the way it acts.
    pub(super) fn directions(
        &self,
        time: f64,
        state: &State,
        commands: &[Approach; 2],
    ) -> Directions {
        let options = |j: usize| -> &[f64] {
            match state.v[j] {
                _ if !self.has_dry_friction(j) => &[0.0],
                v if v > 0.0 => &[1.0],
                v if v < 0.0 => &[-1.0],
                _ => &[0.0, 1.0, -1.0],
            }
        };
        let all = options(0)
            .iter()
            .flat_map(|a| options(1).iter().map(move |b| [*a, *b]));
        let balance = self.balance(time, state, commands);
        let agrees = |directions: &Directions| self.agrees(&balance, state, *directions);
        // The mass matrix is positive definite, so one choice is always consistent, up to rounding at the boundary.
        all.clone()
            .find(agrees)
            .or_else(|| all.clone().next())
            .expect("there is at least one choice")
    }

    fn agrees(&self, balance: &Balance, state: &State, directions: Directions) -> bool {
        let (a, held) = self.accelerations(balance, state, directions);
        (0..2).all(|j| {
            if state.v[j] != 0.0 || !self.has_dry_friction(j) {
                return true;
            }
            if directions[j] != 0.0 {
                return directions[j] * a[j] > 0.0;
            }
            let push = held[j].signum();
            held[j].abs() <= self.level(j, push, state, [balance.time, balance.load[j]])
        })
    }

    /// Time derivative of the state, in its units per second.
    pub(super) fn slope(
        &self,
        time: f64,
        state: &State,
        commands: &[Approach; 2],
        directions: Directions,
    ) -> State {
        let balance = self.balance(time, state, commands);
        let (v, _) = self.accelerations(&balance, state, directions);
        State {
            q: state.v,
            v,
            motor_q: state.motor_v,
            motor_v: balance.motor_acceleration,
            bristle: balance.bristle_rate,
        }
    }
}

/// Accelerations of the free joints under `acting` torques; the other joints have none.
fn solve(mass: &[Pair; 2], acting: Pair, free: [bool; 2]) -> Pair {
    match free {
        [true, true] => {
            let determinant = mass[0][0] * mass[1][1] - mass[0][1] * mass[1][0];
            [
                (mass[1][1] * acting[0] - mass[0][1] * acting[1]) / determinant,
                (mass[0][0] * acting[1] - mass[1][0] * acting[0]) / determinant,
            ]
        }
        [true, false] => [acting[0] / mass[0][0], 0.0],
        [false, true] => [0.0, acting[1] / mass[1][1]],
        [false, false] => [0.0, 0.0],
    }
}

//! Motors that stand behind a transmission: a second body on the joint's axis, with an inertia of its own.
//!
//! The internal states are those of the relative motion, which is the stiff one: by what the motor leads the link, and how
//! fast that grows. Over a step their linear part is implicit; the torque that passes is the mean over the same step, so that
//! both bodies feel it alike and no momentum is lost. Where a play ends within a step, so does a part of the step: before they
//! meet both bodies move freely, and after they part.

use std::ops::Range;

use super::play::{Play, Relative, beyond, jump};
use super::{Assembly, lower};
use crate::data::Joint;
use crate::expr::Node;
use crate::model::FittedEffect;
use crate::model::effect::{Effect, MOTOR_INERTIA, SIDES};
use crate::model::internal_state::mean_of_two;

/// A motor behind the transmission of its joint.
pub(super) struct Motor {
    joint: Joint,
    /// Its angle and its speed.
    pub motion: [Node; 2],
    inertia: Node,
    /// The torque on it, without that which passes on.
    tau: Node,
    /// The torque that passes to the link at `twist`, which holds the twist and its rate.
    passed: Node,
    twist: [Node; 2],
    /// Its play, if it has one.
    play: Option<Play>,
    /// What the sensor's angle moves over a step beyond the mean of its speeds, as a rate.
    jump: Option<Node>,
    /// The places of both among the internal states.
    states: Range<usize>,
    /// Whether the sensor is on the motor, not on the link.
    has_sensor: bool,
    /// Whether the friction of the joint is.
    has_friction: bool,
}

impl Assembly<'_> {
    /// Let the torques act on motors, and what passes from them on the links. What follows reads the motion of the links.
    pub(super) fn apply_transmissions(&mut self) {
        for (index, joint, formula) in self.entries(Effect::is_transmission) {
            let mut scope = self.effect_scope(index);
            let placed = &self.effects[index];
            let states = placed.states.clone();
            let [twist, rate] = [0, 1].map(|k| self.internal[states.start + k]);
            let [sensor, friction] = SIDES.map(|side| placed.value(side) > 0.5);
            let at = match &self.step {
                Some(step) => [0, 1].map(|k| step.starts[states.start + k]),
                None => [twist, rate],
            };
            let [twist_name, rate_name] = [0, 1].map(|k| &placed.effect.effect.states[k].name);
            let ends = placed.effect.effect.states[0].within.as_ref();
            let mut end = |end| lower(&scope, &mut self.graph, end);
            let ends = ends.map(|ends| ends.each_ref().map(&mut end));
            let pressed = ends.map_or(at[0], |ends| beyond(&mut self.graph, ends, at[0]));
            scope.bind(twist_name, pressed);
            scope.bind(rate_name, at[1]);
            let called = lower(&scope, &mut self.graph, formula);
            let play = ends.map(|ends| Play::of(&mut self.graph, ends, [pressed, at[1]], called));
            let passed = play.map_or(called, |play| play.passed(&mut self.graph));
            let shown = [self.q[joint], self.qd[joint]];
            let ahead = [twist, rate];
            let motion = match sensor {
                true => {
                    [self.q[joint], self.qd[joint]] =
                        [0, 1].map(|k| self.graph.sub(shown[k], ahead[k]));
                    shown
                }
                false => [0, 1].map(|k| self.graph.add(shown[k], ahead[k])),
            };
            self.motors.push(Motor {
                joint,
                motion,
                inertia: self.parameter(index, MOTOR_INERTIA),
                tau: std::mem::replace(&mut self.tau[joint], passed),
                passed,
                twist: at,
                play,
                jump: None,
                states,
                has_sensor: sensor,
                has_friction: friction,
            });
        }
    }

    /// The motor on which an effect acts, if it is not the link: the friction of some joints.
    pub(super) fn motor_under(&self, effect: &FittedEffect) -> Option<usize> {
        let is_under = |motor: &Motor| motor.joint == effect.joint && motor.has_friction;
        let motor = self.motors.iter().position(is_under);
        motor.filter(|_| effect.effect.is_friction())
    }

    /// Add a force of an effect to the body that it acts on.
    pub(super) fn add_force(&mut self, effect: &FittedEffect, force: Node) {
        let tau = match self.motor_under(effect) {
            Some(motor) => &mut self.motors[motor].tau,
            None => &mut self.tau[effect.joint],
        };
        *tau = self.graph.add(*tau, force);
    }

    /// The accelerations of what the sensors show, and the mean rates of all twists over the step. Under what passes at its
    /// start, links would have the accelerations `before`.
    pub(super) fn accelerations_of_shown(&mut self, before: &[Node]) -> Vec<Node> {
        for k in 0..self.motors.len() {
            self.pass_over_step(k, before);
        }
        let mut shown = self.accelerations_of_links();
        for motor in &self.motors {
            let own = self.graph.sub(motor.tau, motor.passed);
            let own = self.graph.div(own, motor.inertia);
            self.rates[motor.states.start + 1] = self.graph.sub(own, shown[motor.joint]);
            if motor.has_sensor {
                shown[motor.joint] = own;
            }
            if let Some(jump) = motor.jump {
                let rate = &mut self.shown_qd[motor.joint];
                *rate = self.graph.add(*rate, jump);
            }
        }
        shown
    }

    /// Replace the torque that passes at the start of the step by its mean.
    fn pass_over_step(&mut self, motor: usize, before: &[Node]) {
        let step = self.step.as_ref();
        let length = step.expect("a motion is made of steps").length;
        let Motor {
            joint,
            inertia,
            tau,
            passed,
            twist,
            play,
            has_sensor,
            ..
        } = self.motors[motor];
        let of_link = self.slopes(before[joint], &[self.tau[joint]])[0];
        let graph = &mut self.graph;
        let [zero, one] = [0.0, 1.0].map(|value| graph.constant(value));
        let of_motor = graph.div(one, inertia);
        let mobility = graph.add(of_motor, of_link);
        let own = graph.sub(tau, passed);
        let own = graph.div(own, inertia);
        let rates = [twist[1], graph.sub(own, before[joint])];
        let slopes = graph.gradient(&[passed], &[one], &twist);
        let [by_twist, by_rate] = [0, 1].map(|k| {
            let scaled = graph.mul(slopes[k], mobility);
            let over_step = graph.mul(scaled, length);
            graph.neg(over_step)
        });
        let mut means = mean_of_two(graph, rates, [[zero, length], [by_twist, by_rate]]);
        if let Some(play) = play {
            let relative = Relative {
                twist,
                gaining: rates[1],
                mobility,
                step: length,
            };
            means = relative.with_ends_of(graph, play, means);
            let share = match has_sensor {
                true => of_motor,
                false => graph.neg(of_link),
            };
            let share = graph.div(share, mobility);
            self.motors[motor].jump = Some(jump(graph, means, twist[1], (share, length)));
        }
        self.rates[self.motors[motor].states.start] = means[0];
        let gained = graph.sub(rates[1], means[1]);
        let more = graph.div(gained, mobility);
        self.motors[motor].passed = graph.add(passed, more);
        self.tau[joint] = graph.add(self.tau[joint], more);
    }

    /// The torques that these accelerations of what the sensors show need. Where that is a motor, its link's acceleration
    /// follows from what passes to it, and `tau` becomes the torque on the motor.
    pub(super) fn torques_of_shown(&mut self, qdd: &[Node]) -> Option<Vec<Node>> {
        let seen = self.motors.iter().enumerate();
        let seen = seen.filter(|(_, motor)| motor.has_sensor);
        let seen: Vec<(usize, Joint)> = seen.map(|(k, motor)| (k, motor.joint)).collect();
        if seen.is_empty() {
            return self.torques(qdd);
        }
        let (matrix, _) = self.mass_and_bias()?;
        let mut others = qdd.to_vec();
        for (_, joint) in &seen {
            others[joint.index()] = self.graph.constant(0.0);
        }
        let mut needed = self.torques(&others)?;
        let rows = seen.iter().map(|(_, row)| {
            let columns = seen
                .iter()
                .map(|(_, column)| matrix[row.index()][column.index()]);
            columns.collect::<Vec<Node>>()
        });
        let rows: Vec<Vec<Node>> = rows.collect();
        let left = seen
            .iter()
            .map(|(_, joint)| self.graph.sub(self.tau[*joint], needed[*joint]));
        let left: Vec<Node> = left.collect();
        let links = self.graph.solve_spd(&rows, &left);
        for (row, needed) in needed.iter_mut().enumerate() {
            let of_links: Vec<Node> = (seen.iter())
                .map(|(_, joint)| matrix[row][joint.index()])
                .collect();
            let more = self.graph.dot(&of_links, &links);
            *needed = self.graph.add(*needed, more);
        }
        for (k, joint) in seen {
            let motor = &self.motors[k];
            let own = self.graph.mul(motor.inertia, qdd[joint.index()]);
            needed[joint.index()] = self.graph.add(own, motor.passed);
            self.tau[joint] = motor.tau;
        }
        Some(needed)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::data::{Joint, Log};
    use crate::model::{Dynamics, FittedEffect, Library, Model};
    use crate::sim::{Commands, Point, RK4, Simulator, internal_along};

    const STIFFNESS: f64 = 60.0;
    const DAMPING: f64 = 0.2;

    fn pendulum(library: &Library) -> Model {
        let text = "[system]\nname = \"pendulum\"\njoints = 1\n[parameters]\nI = { value = 0.15 }\n\
                    [dynamics]\nmass = [[\"I\"]]\nbias = [\"3*sin(q1)\"]\n";
        library.model_from_text("pendulum.toml", text).unwrap()
    }

    /// The same motion as that of two joints: a motor, and a pendulum behind a spring and a damper.
    fn two_bodies(friction_on_motor: bool) -> Dynamics {
        let passed = format!("({STIFFNESS}*(q1 - q2) + {DAMPING}*(qd1 - qd2))");
        two_bodies_with(&passed, friction_on_motor)
    }

    /// A motor, and a pendulum to which this passes.
    fn two_bodies_with(passed: &str, friction_on_motor: bool) -> Dynamics {
        let friction = [0.3, 0.0].map(|b| if friction_on_motor { b } else { 0.3 - b });
        let text = format!(
            "[system]\nname = \"two\"\njoints = 2\n[parameters]\n\
             [dynamics]\nmass = [[\"0.02\", \"0\"], [\"0\", \"0.15\"]]\n\
             bias = [\"{passed} + {}*qd1\", \"3*sin(q2) - {passed} + {}*qd2\"]\n",
            friction[0], friction[1]
        );
        let library = Library::built_in();
        library
            .model_from_text("two.toml", &text)
            .unwrap()
            .dynamics()
    }

    fn on(joint: Joint, name: &str, values: &[f64]) -> FittedEffect {
        let library = Library::built_in();
        let mut own = FittedEffect::absent(library.effect(name).unwrap(), joint);
        own.values = values.iter().map(|value| (*value, None)).collect();
        own
    }

    /// An elastic joint with its sensor and its friction on these sides.
    pub(crate) fn elastic(joint: Joint, sides: [f64; 2]) -> FittedEffect {
        let values = [STIFFNESS, DAMPING, 0.02, sides[0], sides[1]];
        on(joint, "joint_elasticity", &values)
    }

    const CONTACT: f64 = 4000.0;
    const RATIO: f64 = 0.3;

    /// A joint with a play of 0.04 rad, and its sensor and its friction on these sides.
    pub(crate) fn loose(joint: Joint, sides: [f64; 2]) -> FittedEffect {
        let values = [0.04, CONTACT, RATIO, 0.02, sides[0], sides[1]];
        on(joint, "motor_backlash", &values)
    }

    pub(crate) fn viscous(joint: Joint) -> FittedEffect {
        on(joint, "viscous_friction", &[0.3])
    }

    fn elastic_pendulum(sides: [f64; 2]) -> Dynamics {
        let effects = [viscous(Joint::at(0)), elastic(Joint::at(0), sides)];
        let pendulum = pendulum(&Library::built_in());
        pendulum.with_effects(effects.to_vec()).dynamics()
    }

    /// Two seconds of a torque that swings slowly and through the resonance.
    fn command(joints: usize, step_s: f64) -> Log {
        let mut log = Log::empty(joints);
        log.time = (0..(2.0 / step_s) as u32)
            .map(|row| step_s * f64::from(row))
            .collect();
        let torque = |t: &f64| 0.6 * (5.0 * t).sin() + 0.5 * (8.0 * t * t).sin();
        let rest = vec![0.0; log.rows()];
        log.tau = vec![log.time.iter().map(torque).collect()];
        log.tau.resize(joints, rest.clone());
        (log.q, log.qd) = (vec![rest.clone(); joints], vec![rest; joints]);
        log
    }

    /// The angles and velocities at each row, in steps of at most `longest_s`.
    fn motion(model: &Dynamics, log: &Log, longest_s: f64) -> Vec<Vec<f64>> {
        let point = Point::from(model);
        let commands = Commands::of_log(&point, log);
        let mut simulator = Simulator::<1>::new(&point, RK4);
        let mut all = Vec::new();
        for row in 0..log.rows() {
            all.push(simulator.state.iter().map(|state| state[0]).collect());
            if row + 1 < log.rows() {
                simulator.follow([&commands], [row], longest_s);
            }
        }
        all
    }

    /// The largest difference between the angles of a joint and those of two bodies, in their own and in these steps.
    fn off([bodies, model]: [(&Dynamics, f64); 2], sides: [f64; 2]) -> f64 {
        let exact = motion(bodies.0, &command(2, 0.002), bodies.1);
        let (model, longest_s) = model;
        let found = motion(model, &command(1, 0.002), longest_s);
        let shown = if sides[0] > 0.5 { 0 } else { 1 };
        let rows = exact.iter().zip(&found);
        rows.map(|(exact, found)| (exact[shown] - found[0]).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn an_elastic_joint_moves_like_two_bodies() {
        for sides in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            let [bodies, model] = [two_bodies(sides[1] > 0.5), elastic_pendulum(sides)];
            let at = |longest_s: f64| off([(&bodies, 1e-4), (&model, longest_s)], sides);
            let [coarse, fine] = [2e-3, 1e-3].map(at);
            assert!(coarse < 2e-3, "{sides:?}: {coarse}");
            assert!(fine < 0.35 * coarse, "{sides:?}: {fine} {coarse}");
        }
    }

    /// Contacts of which each lasts ten milliseconds, in steps of two and of one.
    #[test]
    fn a_joint_with_play_moves_like_two_bodies() {
        let pressed = "max(abs(q1 - q2) - 0.02, 0)";
        // Not `sign`, which is smooth.
        let side = "where(q1 - q2, 1, -1)";
        let damping = 2.0 * RATIO * (CONTACT * 0.02_f64).sqrt();
        let push = format!("max({CONTACT}*{pressed} + {damping}*{side}*(qd1 - qd2), 0)");
        let contact = format!("where({pressed}, {side}*{push}, 0)");
        for sides in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            let bodies = two_bodies_with(&contact, sides[1] > 0.5);
            let effects = vec![viscous(Joint::at(0)), loose(Joint::at(0), sides)];
            let model = pendulum(&Library::built_in())
                .with_effects(effects)
                .dynamics();
            let at = |longest_s: f64| off([(&bodies, 1e-5), (&model, longest_s)], sides);
            let [coarse, fine] = [2e-3, 5e-4].map(at);
            assert!(
                coarse < 1.5e-3 && fine < 0.3 * coarse,
                "{sides:?}: {coarse} {fine}"
            );
        }
    }

    #[test]
    fn values_that_stand_on_one_that_no_log_tells_have_no_interval() {
        let elastic = elastic(Joint::at(0), [0.0, 0.0]);
        for (elastic, known) in [
            (elastic.clone(), true),
            (elastic.with_unknown_held().unwrap(), false),
        ] {
            let effects = vec![viscous(Joint::at(0)), elastic];
            let mut model = pendulum(&Library::built_in()).with_effects(effects);
            for parameter in 0..model.values().len() {
                model.set_half_width(parameter, None, 0.1);
            }
            let found = |k: usize| model.all_parameters()[k].ci95.is_some();
            // Inertia, friction, stiffness, damping, inertia of the motor.
            assert_eq!(
                [0, 1, 2, 3, 4].map(found),
                [true, true, known, known, known]
            );
            assert_eq!(model.all_parameters()[4].fixed, !known);
        }
    }

    /// A log of the sensor's angles alone gives the twist of the two bodies, also where it begins in motion.
    #[test]
    fn the_twist_follows_from_a_log() {
        for sides in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            let mut log = command(1, 0.002);
            let exact = motion(&two_bodies(sides[1] > 0.5), &command(2, 0.002), 1e-4);
            let shown = if sides[0] > 0.5 { 0 } else { 1 };
            log.q[0] = exact.iter().map(|row| row[shown]).collect();
            log.qd[0] = exact.iter().map(|row| row[2 + shown]).collect();
            log.time.drain(..250);
            for channels in [&mut log.q, &mut log.qd, &mut log.tau] {
                channels[0].drain(..250);
            }
            let model = elastic_pendulum(sides);
            let point = Point::from(&model);
            let found = internal_along(&point, &log, &Commands::of_log(&point, &log));
            // The swing with which a log begins is unknown, and dies out.
            for (twist, exact) in found[0].iter().zip(&exact[250..]).skip(150) {
                let wanted = exact[0] - exact[1];
                assert!(
                    (twist - wanted).abs() < 1.5e-3,
                    "{sides:?}: {twist} {wanted}"
                );
            }
        }
    }
}

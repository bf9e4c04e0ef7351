use super::description::{Commanded, Description, Limits};

/// Keeps the commands that the host sends within the limits of a plant, which does the same once more.
///
/// A command is clipped to its range, to its rate of change, and in the braking zone: a joint that is past a limit of its
/// angle, or will be in `brake_s` at its present speed, is only pushed away or braked, and so is a joint above its speed
/// limit. A torque then stays on the safe torque's other side, a commanded position on the measured one's. Braking may
/// exceed the rate.
pub struct Guard {
    limits: Limits,
    command: Commanded,
    safe: Vec<f64>,
    step_s: f64,
    last: Vec<f64>,
}

impl Guard {
    /// For an episode of a plant in which nothing was commanded yet, from the measured positions `q`.
    pub fn new(description: &Description, q: &[f64]) -> Self {
        let Description {
            limits,
            command,
            safe,
            step_s,
            ..
        } = description;
        Self::within(limits.clone(), (*command, safe), *step_s, q)
    }

    /// For limits of one's own, with the kind of the commands, the one that is safe to hold, and how long each is held.
    pub fn within(
        limits: Limits,
        (command, safe): (Commanded, &[f64]),
        step_s: f64,
        q: &[f64],
    ) -> Self {
        let from = match command {
            Commanded::Torque => safe,
            // The first command is no jump, wherever the safe one is.
            Commanded::Position => q,
        };
        let from = from.iter().zip(&limits.command);
        Self {
            last: from.map(|(at, range)| clip(*at, *range)).collect(),
            limits,
            command,
            safe: safe.to_vec(),
            step_s,
        }
    }

    /// Another command was applied than the one that was admitted last.
    pub fn applied(&mut self, command: Vec<f64>) {
        self.last = command;
    }

    /// Commands for the steps after the one that was admitted last. They keep to range and rate; in which state they act nobody
    /// knows, and the plant brakes.
    pub fn continued(&self, next: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let clipped = next.iter().scan(self.last.clone(), |last, asked| {
            let joints = asked.iter().enumerate();
            *last = joints
                .map(|(joint, asked)| self.clipped(joint, *asked, last[joint]))
                .collect();
            Some(last.clone())
        });
        clipped.collect()
    }

    /// The command next to the one that is asked that may be sent in the measured state.
    pub fn admit(&mut self, command: &[f64], q: &[f64], qd: &[f64]) -> Vec<f64> {
        let admitted = (command.iter().enumerate())
            .map(|(joint, asked)| self.admit_one(joint, *asked, q[joint], qd[joint]));
        self.last = admitted.collect();
        self.last.clone()
    }

    fn admit_one(&self, joint: usize, asked: f64, q: f64, qd: f64) -> f64 {
        let Self {
            limits,
            command,
            safe,
            ..
        } = self;
        let speed = limit(&limits.speed, joint);
        let angle = limits.angle.as_ref().and_then(|list| list[joint]);
        let [low, high] = angle.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let ahead = q + limits.brake_s * qd;
        let neutral = match command {
            Commanded::Torque => safe[joint],
            Commanded::Position => q,
        };
        let mut admitted = self.clipped(joint, asked, self.last[joint]);
        if q.max(ahead) > high || qd > speed {
            admitted = admitted.min(neutral);
        }
        if q.min(ahead) < low || qd < -speed {
            admitted = admitted.max(neutral);
        }
        clip(admitted, limits.command[joint])
    }

    /// Within range, and within rate of the command before.
    fn clipped(&self, joint: usize, asked: f64, last: f64) -> f64 {
        let Self { limits, step_s, .. } = self;
        let change = limit(&limits.rate, joint) * step_s;
        clip(
            clip(asked, limits.command[joint]),
            [last - change, last + change],
        )
    }
}

/// Of a joint; infinite if it has none.
fn limit(list: &Option<Vec<Option<f64>>>, joint: usize) -> f64 {
    let given = list.as_ref().and_then(|list| list[joint]);
    given.unwrap_or(f64::INFINITY)
}

fn clip(value: f64, [low, high]: [f64; 2]) -> f64 {
    value.clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{Clock, Limits};

    fn described(command: Commanded) -> Description {
        Description {
            name: "joint".into(),
            joints: vec!["joint".into()],
            step_s: 0.01,
            command,
            clock: Clock::Simulated,
            limits: Limits {
                command: vec![[-3.0, 2.0]],
                rate: Some(vec![Some(100.0)]),
                speed: Some(vec![Some(10.0)]),
                angle: Some(vec![Some([-1.0, 1.0])]),
                brake_s: 0.1,
            },
            safe: vec![0.0],
            measured: Vec::new(),
            patience: 5,
            next: 0,
        }
    }

    #[test]
    fn commands_stay_within_range_rate_and_braking_zone() {
        for (asked, q, qd, sent) in [
            // Range and rate: at most 1 N m a step.
            (5.0, 0.0, 0.0, 1.0),
            (-0.5, 0.0, 0.0, -0.5),
            // Toward a limit that is 0.1 s away, and away from it.
            (1.0, 0.5, 6.0, 0.0),
            (-1.0, 0.5, 6.0, -1.0),
            (-1.0, -1.2, 0.0, 0.0),
            (0.5, -1.2, 0.0, 0.5),
            // Above the greatest speed, away from any limit.
            (0.5, 0.0, -11.0, 0.5),
            (-0.5, 0.0, -11.0, 0.0),
        ] {
            let mut guard = Guard::new(&described(Commanded::Torque), &[q]);
            assert_eq!(
                guard.admit(&[asked], &[q], &[qd]),
                [sent],
                "{asked} {q} {qd}"
            );
        }
    }

    #[test]
    fn a_rate_counts_from_the_last_command_and_braking_may_exceed_it() {
        let mut guard = Guard::new(&described(Commanded::Torque), &[0.0]);
        for sent in [1.0, 2.0, 2.0] {
            assert_eq!(guard.admit(&[9.0], &[0.0], &[0.0]), [sent]);
        }
        assert_eq!(guard.admit(&[9.0], &[2.0], &[0.0]), [0.0]);
    }

    #[test]
    fn commands_for_later_keep_to_range_and_rate_and_leave_the_next_as_it_was() {
        let mut guard = Guard::new(&described(Commanded::Torque), &[0.0]);
        guard.admit(&[0.5], &[0.0], &[0.0]);
        let later = guard.continued(&[vec![9.0], vec![9.0], vec![-9.0]]);
        assert_eq!(later, [[1.5], [2.0], [1.0]]);
        assert_eq!(guard.admit(&[9.0], &[0.0], &[0.0]), [1.5]);
        // The plant went on by itself.
        guard.applied(vec![-1.0]);
        assert_eq!(guard.admit(&[9.0], &[0.0], &[0.0]), [0.0]);
    }

    #[test]
    fn a_commanded_position_begins_where_the_joint_is() {
        let mut guard = Guard::new(&described(Commanded::Position), &[0.4]);
        assert_eq!(guard.admit(&[-3.0], &[0.4], &[0.0]), [0.4 - 1.0]);
        // Past its limit, a joint is not asked to go farther.
        assert_eq!(guard.admit(&[2.0], &[1.1], &[0.0]), [0.4]);
    }
}

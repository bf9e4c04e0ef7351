use super::{Commands, Point, Scheme, Sensors, StepTorque, Stepper, substeps};
use crate::lanes::Row;
use crate::model::InputLayout;

/// `W` trajectories of one model side by side: torques are commanded and held, delays and lags turn them into the
/// acting torques, a scheme integrates the motion, and sensors show its angles.
pub struct Simulator<const W: usize> {
    /// `[state][lane]`: positions, velocities, then internal states.
    pub state: Vec<Row<f64, W>>,
    stepper: Stepper<W>,
    sensors: Sensors<W>,
    torque: StepTorque<W>,
    layout: InputLayout,
}

/// An interval over which commanded torques are held, one interval per lane.
#[derive(Debug, Clone, Copy)]
pub struct Hold<'a, const W: usize> {
    /// The filtered commands of each lane's model.
    pub commands: [&'a Commands<'a>; W],
    /// `[joint][lane]`, as commanded, in N m (or N).
    pub held: &'a [Row<f64, W>],
    /// `[joint][lane]`, added to the acting torque; none if empty.
    pub force: &'a [Row<f64, W>],
    /// Its ends and its length, in s.
    pub from: Row<f64, W>,
    pub to: Row<f64, W>,
    pub length: Row<f64, W>,
    /// Number of equal parts, integrated one after the other.
    pub substeps: usize,
}

impl<'a, const W: usize> Hold<'a, W> {
    /// A hold between two times.
    pub fn between(
        commands: [&'a Commands<'a>; W],
        held: &'a [Row<f64, W>],
        [from, to]: [Row<f64, W>; 2],
        substeps: usize,
    ) -> Self {
        Self {
            commands,
            held,
            force: &[],
            from,
            to,
            length: difference(&from, &to),
            substeps,
        }
    }

    /// A hold of `length_s` in all lanes.
    pub fn lasting(
        commands: [&'a Commands<'a>; W],
        held: &'a [Row<f64, W>],
        from: Row<f64, W>,
        length_s: f64,
        substeps: usize,
    ) -> Self {
        let to = Row(from.map(|from| from + length_s));
        Self {
            length: Row::splat(length_s),
            ..Self::between(commands, held, [from, to], substeps)
        }
    }
}

fn difference<const W: usize>(from: &Row<f64, W>, to: &Row<f64, W>) -> Row<f64, W> {
    Row::from_fn(|lane| to[lane] - from[lane])
}

impl<const W: usize> Simulator<W> {
    /// A model at rest at zero, with its internal states as before a log.
    pub fn new<'d>(model: impl Into<Point<'d>>, scheme: &'static Scheme) -> Self {
        let model = model.into();
        let layout = model.dynamics.layout();
        let starts = model.dynamics.internal_starts(model.values());
        let mut state = vec![Row::splat(0.0); layout.internal().start];
        state.extend(starts.iter().map(|start| Row::splat(*start)));
        Self {
            state,
            layout,
            sensors: Sensors::new(model.clone()),
            stepper: Stepper::new(model, scheme),
            torque: StepTorque::default(),
        }
    }

    /// Set the value of a parameter in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        self.stepper.set_in_lane(parameter, lane, value);
        self.sensors.set_in_lane(parameter, lane, value);
    }

    /// Move the states to the end of a hold.
    pub fn advance(&mut self, hold: &Hold<'_, W>) {
        self.torque.fill(hold);
        let (state, given) = (&mut self.state, &self.torque.given);
        self.stepper
            .advance(state, given, hold.from, hold.length, hold.substeps);
    }

    /// Move the states from a row of each lane's command history to the next, in substeps of at most `longest_s`.
    pub fn follow(&mut self, commands: [&Commands<'_>; W], rows: [usize; W], longest_s: f64) {
        let held = Commands::held(commands, rows);
        let ends = [rows, rows.map(|row| row + 1)].map(|rows| Commands::times(commands, rows));
        let substeps = substeps(&difference(&ends[0], &ends[1]), longest_s);
        self.advance(&Hold::between(commands, &held, ends, substeps));
    }

    /// The angles that sensors show when each lane's command history has reached a row, and the velocities, both
    /// `[n][lane]`.
    pub fn shown(&mut self, commands: [&Commands<'_>; W], rows: [usize; W]) -> [&[Row<f64, W>]; 2] {
        let before = || Commands::just_before(commands, rows);
        let time = Commands::times(commands, rows);
        let angles = self.sensors.show(&self.state, before, time);
        [angles, &self.state[self.layout.velocities()]]
    }

    /// The angles that sensors show at `time` (s), after the last hold.
    pub fn angles_at(&mut self, time: Row<f64, W>) -> &[Row<f64, W>] {
        let before = || self.torque.at_end(self.layout.given().len());
        self.sensors.show(&self.state, before, time)
    }

    /// The torque (`[n][lane]`) that acted over the last part of the last hold; 0 before the first.
    pub fn acting(&self) -> Vec<Row<f64, W>> {
        let mut given = self.torque.at_end(self.layout.given().len());
        given.truncate(self.layout.driving().len());
        given
    }
}

impl Simulator<1> {
    /// Put the model in this state.
    ///
    /// # Panics
    /// When there is not one value for each state.
    pub fn put(&mut self, state: &[f64]) {
        assert_eq!(state.len(), self.state.len(), "one value for each state");
        self.write(state);
    }

    /// Put the joints at these positions, then velocities; internal states stay as they are unless they are given as well.
    ///
    /// # Panics
    /// When there are neither two values for each joint nor one for each state.
    pub fn place(&mut self, state: &[f64]) {
        let expected = [self.layout.internal().start, self.layout.states().end];
        assert!(expected.contains(&state.len()), "two values for each joint");
        self.write(state);
    }

    fn write(&mut self, values: &[f64]) {
        for (lane, value) in self.state.iter_mut().zip(values) {
            *lane = Row([*value]);
        }
    }
}

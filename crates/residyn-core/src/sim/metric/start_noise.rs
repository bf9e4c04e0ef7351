//! How far predictions move if the states that they start from are off.

use rayon::prelude::*;

use super::open_loop::Replay;
use crate::data::Log;
use crate::lanes::Row;
use crate::model::Dynamics;
use crate::sim::{Simulator, Steps, Window};

/// The first lane has the start state of the log, each of the others one value of it moved.
const LANES: usize = 8;

/// The open-loop error, root mean square over the rows of the windows with all joints together (rad or m), if each value
/// of a window's start state is off by a deviation of its own: positions, then velocities, one row of `deviations` a
/// window.
pub fn error_of_starts(
    dynamics: &Dynamics,
    logs: &[Log],
    windows: &[Window],
    deviations: &[Vec<f64>],
    steps: Steps,
) -> f64 {
    let models: Vec<_> = logs.iter().map(|log| dynamics.in_log(log)).collect();
    let each = models.iter().zip(logs);
    let replays: Vec<Replay<'_>> = each.map(|(model, log)| Replay::new(model, log)).collect();
    let square = |(window, deviations): (&Window, &Vec<f64>)| {
        replays[window.log].square_of_start(window, deviations, steps)
    };
    let squares: Vec<f64> = (windows.par_iter().zip(deviations)).map(square).collect();
    let rows: usize = windows.iter().map(|window| window.rows() - 1).sum();
    (squares.iter().sum::<f64>() / rows.max(1) as f64).sqrt()
}

impl Replay<'_> {
    /// The square of that error, summed over the rows of a window.
    fn square_of_start(&self, window: &Window, deviations: &[f64], steps: Steps) -> f64 {
        let start = self.start(window);
        let values: Vec<usize> = (0..deviations.len()).collect();
        let packs = values.chunks(LANES - 1);
        let of_pack = |moved: &[usize]| {
            let state = |value: usize, lane: usize| match lane.checked_sub(1) {
                Some(lane) if moved.get(lane) == Some(&value) => start[value] + deviations[value],
                _ => start[value],
            };
            let states = Row::table(start.len(), state);
            self.square_of_lanes(window, states, moved.len(), steps)
        };
        packs.map(of_pack).sum()
    }

    /// The squared distances of the first lane's angles to those of the next `others` lanes.
    fn square_of_lanes(
        &self,
        window: &Window,
        states: Vec<Row<f64, LANES>>,
        others: usize,
        steps: Steps,
    ) -> f64 {
        let commands = [&self.commands; LANES];
        let mut simulator = Simulator::<LANES>::new(&self.model, steps.scheme);
        simulator.state = states;
        let mut sum = 0.0;
        for row in window.first..window.last {
            simulator.follow(commands, [row; LANES], steps.longest_s);
            let [angles, _] = simulator.shown(commands, [row + 1; LANES]);
            let square = |angle: &Row<f64, LANES>| -> f64 {
                (1..=others)
                    .map(|lane| (angle[lane] - angle[0]).powi(2))
                    .sum()
            };
            sum += angles.iter().map(square).sum::<f64>();
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Steps, Window, error_of_starts};
    use crate::data::Log;
    use crate::model::Model;

    /// Two joints that nothing moves: a position that is off stays off, a velocity that is off grows with time.
    #[test]
    fn a_start_that_is_off_carries_through_the_window() {
        let text = "[system]\nname = \"free\"\njoints = 2\n[parameters]\nk = { value = 0.0 }\n\
                    [dynamics]\nqdd1 = \"k\"\nqdd2 = \"k\"\n";
        let model = Model::from_text(Path::new("free.toml"), text, &[]).unwrap();
        let mut log = Log::empty(2);
        log.time = (0..200).map(|row| 0.01 * f64::from(row)).collect();
        let rest = vec![vec![0.0; 200]; 2];
        (log.q, log.qd, log.tau) = (rest.clone(), rest.clone(), rest);
        let window = Window {
            log: 0,
            first: 20,
            last: 120,
        };
        let error = |deviations: [f64; 4]| {
            let deviations = [deviations.to_vec()];
            error_of_starts(
                &model.dynamics(),
                &[log.clone()],
                &[window],
                &deviations,
                Steps::FIT,
            )
        };
        assert!((error([0.3, 0.0, 0.0, 0.0]) - 0.3).abs() < 1e-12);
        // The root mean square of 1 to 100 rows of 10 ms.
        let slope = (101.0_f64 * 201.0 / 6.0).sqrt() * 0.01;
        assert!((error([0.0, 0.0, 0.0, 2.0]) - 2.0 * slope).abs() < 1e-9);
        let both = (0.3_f64.powi(2) + (2.0 * slope).powi(2)).sqrt();
        assert!((error([0.0, 0.3, 2.0, 0.0]) - both).abs() < 1e-9);
    }
}

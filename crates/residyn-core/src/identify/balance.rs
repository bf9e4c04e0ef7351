//! The torques that logged motions need, compared with those that act: windows of smoothed logs, one per lane.

use std::ops::{Range, RangeInclusive};

use super::normal_equations::{Reduced, WindowTerms};
use super::sensitivity::{LANES, Tangent};
use super::sums::{Sums, loss};
use super::values::Values;
use crate::data::{Joint, Log, Measured, Smooth, Smoothing, row_from};
use crate::expr::{Program, Tape};
use crate::lanes::Row;
use crate::model::{Dynamics, Filter};
use crate::sim::{Commands, Course, Mean, Point, Window};

/// A log as the torque error reads it, thinned out.
pub(super) struct Rows {
    smooth: Smooth,
    smoothing: Smoothing,
}

impl Rows {
    /// Friction reverses over these speeds, one per joint.
    pub fn of(log: &Log, smoothing_velocities: &[f64]) -> Self {
        let smoothing = Smoothing::precise(log).thinned();
        Self {
            smooth: Smooth::by(&smoothing, log, smoothing_velocities),
            smoothing,
        }
    }

    /// The rows within a window.
    pub fn within(&self, log: &Log, window: &Window) -> Range<usize> {
        let at = |row: usize| row_from(&self.smooth.time, log.time[row]);
        at(window.first)..at(window.last)
    }
}

/// What each log gives at its rows.
pub(super) struct Acting {
    logs: Vec<ActingIn>,
}

/// What one log gives, `[channel][row]`.
#[derive(Default)]
struct ActingIn {
    /// The model's internal states.
    internal: Vec<Vec<f64>>,
    /// The torques that act, then the model's further measured columns.
    given: Vec<Vec<f64>>,
    /// The slopes of the torques with respect to the parameters of some filters, then those of the internal states with
    /// respect to parameters.
    slopes: Vec<Vec<f64>>,
}

/// Time constants after which a lag has forgotten a command.
const FORGOTTEN: f64 = 30.0;

impl Acting {
    /// With the course of the internal states in each log, if there are any, and with the slopes of all of the model's
    /// filters or of none. Logs of which no window is used give nothing, and rows outside the windows of a log do not
    /// matter.
    pub fn of(
        dynamics: &Dynamics,
        values: &Values,
        (logs, rows, windows): (&[Log], &[Rows], &[Window]),
        (courses, slopes_of): (&[Course], &[Filter]),
    ) -> Self {
        let of_log = |(index, (log, rows)): (usize, (&Log, &Rows))| {
            let own = windows.iter().filter(|window| window.log == index);
            let first = own.clone().map(|window| window.first).min();
            let last = own.map(|window| window.last).max();
            first
                .zip(last)
                .map_or_else(Default::default, |(first, last)| {
                    let point = Point::new(dynamics, values.of_log(index));
                    rows.acting(&point, (log, first..=last), (courses.get(index), slopes_of))
                })
        };
        let all = logs.iter().zip(rows).enumerate().map(of_log);
        Self {
            logs: all.collect(),
        }
    }
}

impl Rows {
    /// What acts between two rows of the log, with its slopes by some filters.
    fn acting(
        &self,
        point: &Point<'_>,
        (log, within): (&Log, RangeInclusive<usize>),
        (course, slopes_of): (Option<&Course>, &[Filter]),
    ) -> ActingIn {
        let (smoothing, dynamics) = (&self.smoothing, point.dynamics);
        let constants = dynamics
            .filters
            .iter()
            .map(|filter| point.values()[filter.parameter]);
        let memory_s = FORGOTTEN * constants.fold(0.0, f64::max);
        let stretch = smoothing.stretch(&within, memory_s);
        let commands = Commands::of_rows(point, log, stretch.logged.clone());
        let filtered: Vec<Option<Vec<Mean>>> = Joint::all(dynamics.joints)
            .map(|joint| commands.delivered(joint))
            .collect();
        let each = |means: &Vec<Mean>, of: &dyn Fn(&Mean) -> f64| means.iter().map(of).collect();
        let values = |means: &Option<Vec<Mean>>| Some(each(means.as_ref()?, &|mean| mean.value));
        let means: Vec<Option<Vec<f64>>> = filtered.iter().map(values).collect();
        let tau = smoothing.delivered(log, &stretch, (&self.smooth.tau, &means));
        let measured = Measured::named(&self.smooth.measured, dynamics.measured_names());
        let slopes = slopes_of.iter().map(|filter| {
            let means = filtered[filter.joint].as_ref();
            let means = means.expect("the joint has a filter");
            each(means, &|mean| mean.slope(filter.kind))
        });
        let slopes: Vec<Vec<f64>> = slopes.collect();
        let given = tau.into_iter().chain(measured.into_iter().cloned());
        let along = |of: fn(&Course, Range<usize>) -> Vec<Vec<f64>>| {
            let channels = course.map(|course| of(course, stretch.logged.clone()));
            smoothing.sampled_in(&stretch, &channels.unwrap_or_default())
        };
        let by_filters = smoothing.held_in(&stretch, &slopes);
        ActingIn {
            internal: along(Course::states),
            given: given.collect(),
            slopes: [by_filters, along(Course::slopes)].concat(),
        }
    }
}

/// Up to [`LANES`] windows side by side. Shorter windows are padded with rows of zero weight.
pub(super) struct Balance {
    pub windows: Vec<usize>,
    /// The log of each lane.
    logs: [usize; LANES],
    /// `[row][lane]`: the row of the lane's smoothed log, if its window has one.
    at: Vec<[Option<usize>; LANES]>,
    /// 1 / noise of each joint.
    weight: Vec<f64>,
}

impl Balance {
    pub fn new(
        logs: &[Log],
        rows: &[Rows],
        windows: &[Window],
        members: &[usize],
        noise: &[f64],
    ) -> Self {
        let lane = |lane: usize| members[lane.min(members.len() - 1)];
        let range = |&w: &usize| {
            let window = &windows[w];
            rows[window.log].within(&logs[window.log], window)
        };
        let ranges: Vec<_> = members.iter().map(range).collect();
        let longest = ranges.iter().map(|range| range.len()).max().unwrap_or(0);
        let at = |row: usize| {
            std::array::from_fn(|lane| {
                let range = ranges.get(lane)?;
                (row < range.len()).then_some(range.start + row)
            })
        };
        Self {
            windows: members.to_vec(),
            logs: std::array::from_fn(|l| windows[lane(l)].log),
            at: (0..longest).map(at).collect(),
            weight: noise.iter().map(|noise| 1.0 / noise).collect(),
        }
    }

    /// Rows of all windows.
    pub fn rows(&self) -> usize {
        self.at.iter().flatten().flatten().count()
    }

    /// The weight of a row's residual: none where the joint rests, since dry friction takes any torque there.
    fn weight_at(&self, rows: &[Rows], lane: usize, at: usize, joint: usize) -> f64 {
        match rows[self.logs[lane]].smooth.rests[joint][at] {
            true => 0.0,
            false => self.weight[joint],
        }
    }

    /// Evaluate a program at each row, calling `see(lanes, tape)`, where `lanes` gives each lane's row, if it has one.
    /// A program may take the slopes of what acts before its parameters.
    fn over_rows<'d>(
        &self,
        program: &Program,
        first_parameter: usize,
        values: &Values,
        (rows, acting): (&'d [Rows], &'d Acting),
        mut see: impl FnMut(&[Option<usize>; LANES], &Tape<f64, LANES>),
    ) {
        let mut tape = program.tape_at(first_parameter, &values.common);
        values.by_lane(&self.logs, |parameter, lane, value| {
            tape.inputs()[first_parameter + parameter][lane] = value;
        });
        let of_log = |(log, Rows { smooth, .. }): (usize, &'d Rows)| -> Vec<&'d Vec<f64>> {
            let acting = &acting.logs[log];
            let moving = smooth.q.iter().chain(&smooth.qd).chain(&acting.internal);
            let driven = moving.chain(&acting.given);
            let timed = driven.chain([&smooth.time]).chain(&smooth.qdd);
            timed
                .chain(&smooth.directions)
                .chain(&acting.slopes)
                .collect()
        };
        // In the order of a torque balance's inputs.
        let inputs: Vec<Vec<&Vec<f64>>> = rows.iter().enumerate().map(of_log).collect();
        for lanes in &self.at {
            for (k, input) in tape.moving().iter_mut().enumerate() {
                let read = |lane: usize, at: usize| inputs[self.logs[lane]][k][at];
                *input = Row::from_fn(|lane| lanes[lane].map_or(0.0, |at| read(lane, at)));
            }
            tape.run();
            see(lanes, &tape);
        }
    }

    /// Residuals over their noise, window by window: `[row * n + joint]`.
    pub fn residuals(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        data: (&[Rows], &Acting),
    ) -> Vec<(usize, Vec<f64>)> {
        let mut all: Vec<(usize, Vec<f64>)> =
            self.windows.iter().map(|&w| (w, Vec::new())).collect();
        let first = dynamics.layout().parameters_of_balance();
        self.over_rows(&dynamics.program, first, values, data, |lanes, tape| {
            for (lane, (_, residuals)) in all.iter_mut().enumerate() {
                if let Some(at) = lanes[lane] {
                    let weight = |joint| self.weight_at(data.0, lane, at, joint);
                    let of_joint = |joint: usize| tape.output(joint)[lane] * weight(joint);
                    residuals.extend((0..self.weight.len()).map(of_joint));
                }
            }
        });
        all
    }

    /// The Huber loss of each window at residual scale `scale`.
    pub fn costs(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        data: (&[Rows], &Acting),
        scale: f64,
    ) -> Vec<(usize, f64)> {
        let residuals = self.residuals(dynamics, values, data).into_iter();
        let cost = |residuals: Vec<f64>| residuals.iter().map(|r| loss(r / scale).0).sum();
        residuals
            .map(|(w, of_window)| (w, cost(of_window)))
            .collect()
    }

    pub fn linearise(
        &self,
        tangent: &Tangent,
        values: &Values,
        data: (&[Rows], &Acting),
        scale: f64,
    ) -> Vec<(usize, WindowTerms)> {
        let of_joint = |columns: &Vec<usize>| Sums::new(columns.len());
        let mut sums: Vec<Sums> = tangent.columns_of.iter().map(of_joint).collect();
        let first = tangent.first_parameter;
        self.over_rows(&tangent.program, first, values, data, |lanes, tape| {
            let of_joints = sums.iter_mut().zip(tangent.slopes());
            for (j, (sums, (_, slopes))) in of_joints.enumerate() {
                let weight = Row::from_fn(|lane| {
                    let weight = |at| self.weight_at(data.0, lane, at, j) / scale;
                    lanes[lane].map_or(0.0, weight)
                });
                let out = tape.output(j);
                let residual = Row::from_fn(|l| out[l] * weight[l]);
                sums.add(&residual, slopes.map(|output| tape.output(output)), &weight);
            }
        });
        let mut all = vec![WindowTerms::zeros(tangent.columns()); self.windows.len()];
        for (columns, sums) in tangent.columns_of.iter().zip(sums) {
            for (all, terms) in all.iter_mut().zip(sums.lanes(self.windows.len())) {
                let columns = columns.clone();
                Reduced { columns, terms }.add_to(all);
            }
        }
        self.windows.iter().copied().zip(all).collect()
    }
}

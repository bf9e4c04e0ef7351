//! An episode to watch: a simulated mechanism in motion, with its torques and rewards over time.

mod animation;
mod strips;

use self::animation::{Animation, Chain, animation};
use self::strips::{Strip, StripLine};
use super::plot::{PlotError, Quantity};
use crate::control::{Episode, Meter, Task};
use crate::data::Joint;
use crate::expr::FormulaError;

/// An episode to watch, as SVG text; none for a task without a figure.
///
/// # Errors
/// None for an episode of `task`.
pub fn film(task: &Task, episode: &Episode, title: &str) -> Result<Option<String>, PlotError> {
    let chains: Vec<Chain> = task
        .figure
        .iter()
        .map(|points| chain(task, points, episode))
        .collect();
    if chains.is_empty() {
        return Ok(None);
    }
    let torques = episode
        .stretch
        .log
        .tau
        .iter()
        .zip(Joint::all(task.joints()))
        .map(|(tau, joint)| StripLine {
            label: format!("joint {joint}"),
            values: tau.clone(),
        });
    let last = episode.rewards.last().copied();
    let reward = StripLine {
        label: "reward".to_owned(),
        values: episode.rewards.iter().copied().chain(last).collect(),
    };
    let strips = vec![
        Strip {
            quantity: Quantity::new("torque", "N m"),
            lines: torques.collect(),
        },
        Strip {
            quantity: Quantity::new("reward", ""),
            lines: vec![reward],
        },
    ];
    animation(&Animation {
        title: title.to_owned(),
        step_s: task.step_s,
        chains,
        strips,
    })
    .map(Some)
}

fn chain(task: &Task, points: &[[String; 2]], episode: &Episode) -> Chain {
    let meter = |formula: &String| Meter::new(formula, task.joints());
    let meters: Result<Vec<[Meter; 2]>, FormulaError> = (points.iter())
        .map(|[x, y]| Ok([meter(x)?, meter(y)?]))
        .collect();
    let meters = meters.expect("formulas are checked when a task is read");
    let idle = vec![0.0; task.joints()];
    let rows = episode.stretch.states.iter().zip(&episode.stretch.log.time);
    let frame = |(state, time): (&Vec<f64>, &f64)| {
        let read = |meter: &Meter| meter.read(state, &idle, *time);
        meters
            .iter()
            .map(|point| point.each_ref().map(read))
            .collect()
    };
    Chain {
        frames: rows.map(frame).collect(),
    }
}

//! An episode to watch: a simulated mechanism in motion, with its torques and rewards over time.

mod animation;
mod strips;

use self::animation::{Animation, Chain, animation};
use self::strips::{Strip, StripLine};
use super::plot::{PlotError, Quantity};
use crate::control::{Episode, Task};
use crate::data::Joint;
use crate::expr::FormulaError;
use crate::plan::Objective;

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
    let formula = |text: &String| Objective::new(text, task.joints());
    let formulas: Result<Vec<[Objective; 2]>, FormulaError> = (points.iter())
        .map(|[x, y]| Ok([formula(x)?, formula(y)?]))
        .collect();
    let formulas = formulas.expect("formulas are checked when a task is read");
    let idle = vec![0.0; task.joints()];
    let rows = episode.stretch.states.iter().zip(&episode.stretch.log.time);
    let frame = |(state, time): (&Vec<f64>, &f64)| {
        let value = |formula: &Objective| formula.value(state, &idle, *time);
        formulas
            .iter()
            .map(|point| point.each_ref().map(value))
            .collect()
    };
    Chain {
        frames: rows.map(frame).collect(),
    }
}

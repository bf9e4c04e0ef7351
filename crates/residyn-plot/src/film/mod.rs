//! An episode to watch: a simulated mechanism in motion, with its torques and rewards over time.

mod animation;
mod strips;

use residyn_core::data::Joint;

use self::animation::{Animation, Chain, animation};
use self::strips::{Strip, StripLine};
use crate::{PlotError, Quantity};

/// What a film shows.
#[derive(Debug)]
pub struct Film<'e> {
    pub title: String,
    /// Time from one frame to the next in s.
    pub step_s: f64,
    /// The bodies as bars joined end to end: `[chain][frame][point]` as x and y in m.
    pub figure: Vec<Vec<Vec<[f64; 2]>>>,
    /// Torques in N m, `[joint][frame]`.
    pub torques: &'e [Vec<f64>],
    /// The reward of each step; the last one is shown for two frames.
    pub rewards: &'e [f64],
}

/// An episode to watch, as SVG text.
///
/// # Errors
/// No chain or no frame to show; chains that differ in their number of frames or change their number of points.
pub fn film(film: Film<'_>) -> Result<String, PlotError> {
    let joints = Joint::all(film.torques.len());
    let torques = film
        .torques
        .iter()
        .zip(joints)
        .map(|(tau, joint)| StripLine {
            label: format!("joint {joint}"),
            values: tau.clone(),
        });
    let last = film.rewards.last().copied();
    let reward = StripLine {
        label: "reward".to_owned(),
        values: film.rewards.iter().copied().chain(last).collect(),
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
    let chains = film.figure.into_iter().map(|frames| Chain { frames });
    animation(&Animation {
        title: film.title,
        step_s: film.step_s,
        chains: chains.collect(),
        strips,
    })
}

use super::Evaluate;
use residyn_core::sim::batch::{Block, Rows};

/// Initial condition of a plan: state (positions, velocities, then internal states), time, and what the torques commanded
/// before still do.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    state: Vec<f32>,
    time_s: f32,
    /// See [`Rollouts::carried`](residyn_core::sim::batch::Rollouts::carried).
    carried: Vec<f32>,
}

impl Start {
    /// From f64; no torque was commanded before.
    pub fn new(state: &[f64], time_s: f64) -> Self {
        Self::after(state, time_s, Vec::new())
    }

    /// While torques of before still act: `carried` is their part of the acting torques, from
    /// [`Rollouts::carried`](residyn_core::sim::batch::Rollouts::carried).
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn after(state: &[f64], time_s: f64, carried: Vec<f32>) -> Self {
        Self {
            state: state.iter().map(|x| *x as f32).collect(),
            time_s: time_s as f32,
            carried,
        }
    }
}

impl Evaluate for Block<'_> {
    type Start = Start;

    fn returns(&mut self, start: &Start, inputs: &[Rows], returns: &mut Rows) {
        let Start {
            state,
            time_s,
            carried,
        } = start;
        Block::returns(self, state, *time_s, carried, inputs, returns);
    }

    fn excess(&self) -> Option<&Rows> {
        Block::excess(self)
    }
}

use super::Evaluate;
use crate::batch::{Block, Rows};

/// Where a plan starts: a state (positions, then velocities) and a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    state: Vec<f32>,
    time_s: f32,
}

impl Start {
    /// In f64, as the rest of the program has it.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn new(state: &[f64], time_s: f64) -> Self {
        Self {
            state: state.iter().map(|x| *x as f32).collect(),
            time_s: time_s as f32,
        }
    }
}

impl Evaluate for Block<'_> {
    type Start = Start;

    fn returns(&mut self, start: &Start, inputs: &[Rows], returns: &mut Rows) {
        Block::returns(self, &start.state, start.time_s, inputs, returns);
    }
}

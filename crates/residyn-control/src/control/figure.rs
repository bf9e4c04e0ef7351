use residyn_core::expr::FormulaError;

use super::{Episode, Task};
use crate::plan::Objective;

impl Task {
    /// The mechanism in an episode, as bars joined end to end: `[chain][frame][point]` as x and y in m. Empty for a task
    /// without a figure.
    ///
    /// # Panics
    /// Never: formulas are checked when a task is read.
    pub fn figure_of(&self, episode: &Episode) -> Vec<Vec<Vec<[f64; 2]>>> {
        let chains = self.figure.iter();
        chains.map(|points| self.chain(points, episode)).collect()
    }

    fn chain(&self, points: &[[String; 2]], episode: &Episode) -> Vec<Vec<[f64; 2]>> {
        let formula = |text: &String| Objective::new(text, self.joints());
        let formulas: Result<Vec<[Objective; 2]>, FormulaError> = (points.iter())
            .map(|[x, y]| Ok([formula(x)?, formula(y)?]))
            .collect();
        let formulas = formulas.expect("formulas are checked when a task is read");
        let idle = vec![0.0; self.joints()];
        let rows = episode.stretch.states.iter().zip(&episode.stretch.log.time);
        let frame = |(state, time): (&Vec<f64>, &f64)| {
            let value = |formula: &Objective| formula.value(state, &idle, *time);
            formulas
                .iter()
                .map(|point| point.each_ref().map(value))
                .collect()
        };
        rows.map(frame).collect()
    }
}

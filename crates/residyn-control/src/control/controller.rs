use std::collections::VecDeque;

use rand::{Rng, RngExt};
use thiserror::Error;

use super::Task;
use crate::plan::{Planner, Start};
use residyn_core::sim::Environment;
use residyn_core::sim::batch::{Block, Rollouts};

/// Decides the torque of each step.
pub trait Policy {
    /// The torque (N m or N, one per joint) to hold from `time_s` on, given the sensor readings `measured` (positions,
    /// then velocities); `None` if there is none to be trusted: the plant then holds its safe one.
    fn torque(&mut self, measured: &[f64], time_s: f64) -> Option<Vec<f64>>;

    /// The torques of the steps after the one that was just decided, as far as they are known before anything else is measured.
    fn ahead(&self) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// The plant holds these, each for a step, in this order: what was decided, which its limits may have changed, or several if
    /// it did not wait.
    fn held(&mut self, _torques: &[Vec<f64>]) {}
}

/// An episode of plans in which no candidate has a finite return.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "no candidate plan at {time_s:.3} s has a finite return, nor at any time after it: all of them reach numbers that are not \
     finite; fix the model or the objective of the task, or shorten the planner's horizon"
)]
pub struct LostPlan {
    pub time_s: f64,
}

/// Model-predictive control with a receding horizon: the first steps of the best plan are executed; the rest of it
/// initialises the search for the next. A plan in which no candidate has a finite return is not executed.
pub struct Controller<'p, 'r> {
    planner: &'p Planner<Block<'r>>,
    rollouts: &'r Rollouts,
    /// Follows the states of the model's effects.
    observer: Option<Environment<'r>>,
    replan: usize,
    /// The steps to be executed before the next plan.
    plan: VecDeque<Vec<f64>>,
    /// The steps after them, for a plant that does not wait for the next plan.
    rest: VecDeque<Vec<f64>>,
    /// Steps since the plan was made.
    executed: usize,
    /// The last torques, as many as the model's delays need.
    past: VecDeque<Vec<f64>>,
    /// The newest readings and their time.
    at: (Vec<f64>, f64),
    decisions: usize,
    diverged: usize,
    lost: Vec<f64>,
}

impl<'p, 'r> Controller<'p, 'r> {
    /// Executes `replan` steps of each plan; the planner's blocks are of these rollouts, whose model `observer` follows if it
    /// has internal states.
    pub fn new(
        planner: &'p Planner<Block<'r>>,
        rollouts: &'r Rollouts,
        observer: Option<Environment<'r>>,
        replan: usize,
    ) -> Self {
        planner.forget();
        Self {
            planner,
            rollouts,
            observer,
            replan,
            plan: VecDeque::new(),
            rest: VecDeque::new(),
            executed: 0,
            past: VecDeque::new(),
            at: (Vec::new(), 0.0),
            decisions: 0,
            diverged: 0,
            lost: Vec::new(),
        }
    }

    /// Number of plans made.
    pub fn decisions(&self) -> usize {
        self.decisions
    }

    /// Number of candidates, over all plans, whose rollout diverged.
    pub fn diverged(&self) -> usize {
        self.diverged
    }

    /// Times of plans in which no candidate had a finite return \[s\]: the model diverged in all of them.
    pub fn lost(&self) -> &[f64] {
        &self.lost
    }

    /// Whether any plan had a candidate with a finite return.
    ///
    /// # Errors
    /// The first plan, if none had.
    pub fn check(&self) -> Result<(), LostPlan> {
        match self.lost.first() {
            Some(&time_s) if self.lost.len() == self.decisions => Err(LostPlan { time_s }),
            _ => Ok(()),
        }
    }

    /// A torque acts for a step.
    fn hold(&mut self, torque: &[f64]) {
        self.executed += 1;
        self.past.push_back(torque.to_vec());
        if self.past.len() > self.rollouts.memory() {
            self.past.pop_front();
        }
    }

    fn decide(&mut self, measured: &[f64], time_s: f64) {
        if self.decisions > 0 {
            self.planner.shift(self.executed);
            self.executed = 0;
        }
        let past = self.past.make_contiguous();
        let carried = self.rollouts.carried(past, self.planner.horizon());
        let internal = self.observer.as_ref().map(Environment::internal);
        let state = [measured, &internal.unwrap_or_default()].concat();
        let plan = self.planner.plan(Start::after(&state, time_s, carried));
        self.decisions += 1;
        self.diverged += plan.diverged;
        self.rest.clear();
        match plan.best.is_finite() {
            true => {
                self.plan = plan.inputs.into();
                self.rest = self.plan.split_off(self.replan.min(self.plan.len()));
            }
            false => self.lost.push(time_s),
        }
    }
}

impl Policy for Controller<'_, '_> {
    fn torque(&mut self, measured: &[f64], time_s: f64) -> Option<Vec<f64>> {
        if self.plan.is_empty() {
            self.decide(measured, time_s);
        }
        self.at = (measured.to_vec(), time_s);
        self.plan.pop_front()
    }

    fn ahead(&self) -> Vec<Vec<f64>> {
        self.plan.iter().chain(&self.rest).cloned().collect()
    }

    fn held(&mut self, torques: &[Vec<f64>]) {
        if let (Some(observer), Some(torque)) = (&mut self.observer, torques.last()) {
            let (measured, time_s) = &self.at;
            observer.step(&mut measured.clone(), torque, *time_s);
        }
        let late = torques.len().saturating_sub(1);
        self.plan.drain(..self.plan.len().min(late));
        for torque in torques {
            self.hold(torque);
        }
    }
}

/// Uniformly random torques, new in each step.
pub struct RandomTorque<'t, R> {
    ranges: &'t [[f64; 2]],
    rng: R,
}

impl<'t, R: Rng> RandomTorque<'t, R> {
    /// Within the bounds of a task.
    pub fn new(task: &'t Task, rng: R) -> Self {
        Self {
            ranges: &task.torque,
            rng,
        }
    }
}

impl<R: Rng> Policy for RandomTorque<'_, R> {
    fn torque(&mut self, _: &[f64], _: f64) -> Option<Vec<f64>> {
        let draw = |[low, high]: &[f64; 2]| self.rng.random_range(*low..=*high);
        Some(self.ranges.iter().map(draw).collect())
    }
}

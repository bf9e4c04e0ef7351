use std::slice::from_ref;

use burn::tensor::Tensor;

use super::{Derivative, Unpacked};
use residyn_core::sim::{Integrator, Scheme};

/// A batch after one step.
#[derive(Debug, Clone)]
pub struct StepResult {
    /// Columns `[batch]`.
    pub state: Vec<Tensor<1>>,
    /// F_r at the start of the step only, `[batch, n or 2n]`, not at inner stages, so that its norm is comparable
    /// between integrators.
    pub residual: Option<Tensor<2>>,
}

impl Unpacked<'_> {
    /// Advances columns `[batch]` of states by `dt` seconds (`[batch]`) from `time`, under `input`.
    pub fn step(
        &self,
        integrator: Integrator,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        dt: &Tensor<1>,
    ) -> StepResult {
        let h = match integrator.substeps() {
            1 => dt.clone(),
            substeps => dt.clone() / substeps as f64,
        };
        let first = self.derivative(state, input, time, [state, from_ref(&h)]);
        let residual = first.residual.clone();
        let mut state = self.substep(integrator.scheme(), state, input, time, &h, first);
        for k in 1..integrator.substeps() {
            let time = time.clone() + h.clone() * k as f64;
            let start = self.derivative(&state, input, &time, [&state, from_ref(&h)]);
            state = self.substep(integrator.scheme(), &state, input, &time, &h, start);
        }
        StepResult { state, residual }
    }

    /// A substep of length `h`; `first` is the derivative at its start.
    fn substep(
        &self,
        scheme: &Scheme,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        h: &Tensor<1>,
        first: Derivative,
    ) -> Vec<Tensor<1>> {
        let mut rates = first.rates;
        if scheme.semi_implicit {
            return semi_implicit(input.len(), state, &rates, h);
        }
        let mut mean: Vec<Tensor<1>> = Vec::new();
        for (k, stage) in scheme.stages.iter().enumerate() {
            if k > 0 {
                let after = h.clone() * stage.time;
                let inner = along(state, &rates, &after);
                let time = time.clone() + after;
                let taken = self.derivative(&inner, input, &time, [state, from_ref(h)]);
                rates = taken.rates;
            }
            let weighted = rates.iter().map(|rate| rate.clone() * stage.weight);
            mean = match k {
                0 => weighted.collect(),
                _ => mean.into_iter().zip(weighted).map(|(a, b)| a + b).collect(),
            };
        }
        along(state, &mean, h)
    }
}

/// v' = v + h f_v, q' = q + h (f_q + h f_v); internal states move with their mean rates.
fn semi_implicit(
    joints: usize,
    state: &[Tensor<1>],
    rates: &[Tensor<1>],
    h: &Tensor<1>,
) -> Vec<Tensor<1>> {
    let mut next = along(state, rates, h);
    for (position, rate) in next.iter_mut().zip(&rates[joints..2 * joints]) {
        *position = position.clone() + rate.clone() * h.clone() * h.clone();
    }
    next
}

/// state + h * rates
fn along(state: &[Tensor<1>], rates: &[Tensor<1>], h: &Tensor<1>) -> Vec<Tensor<1>> {
    (state.iter().zip(rates))
        .map(|(s, rate)| s.clone() + rate.clone() * h.clone())
        .collect()
}

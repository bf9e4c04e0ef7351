use burn::tensor::Tensor;

use super::{Derivative, Unpacked};
use residyn_core::sim::{Integrator, Scheme};

/// A batch after one step.
#[derive(Debug, Clone)]
pub struct StepResult {
    /// `2n` columns `[batch]`.
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
        let first = self.derivative(state, input, time);
        let residual = first.residual.clone();
        let h = match integrator.substeps() {
            1 => dt.clone(),
            substeps => dt.clone() / substeps as f64,
        };
        let mut state = substep(integrator.scheme(), self, state, input, time, &h, first);
        for k in 1..integrator.substeps() {
            let time = time.clone() + h.clone() * k as f64;
            let start = self.derivative(&state, input, &time);
            state = substep(integrator.scheme(), self, &state, input, &time, &h, start);
        }
        StepResult { state, residual }
    }
}

/// A substep of length `h`; `first` is the derivative at its start.
fn substep(
    scheme: &Scheme,
    model: &Unpacked,
    state: &[Tensor<1>],
    input: &[Tensor<1>],
    time: &Tensor<1>,
    h: &Tensor<1>,
    first: Derivative,
) -> Vec<Tensor<1>> {
    if scheme.semi_implicit {
        return semi_implicit(state, &first, h);
    }
    let mut rates = first.rates;
    let mut mean: Vec<Tensor<1>> = Vec::new();
    for (k, stage) in scheme.stages.iter().enumerate() {
        if k > 0 {
            let after = h.clone() * stage.time;
            let inner = along(state, &rates, &after);
            rates = model
                .derivative(&inner, input, &(time.clone() + after))
                .rates;
        }
        let weighted = rates.iter().map(|rate| rate.clone() * stage.weight);
        mean = match k {
            0 => weighted.collect(),
            _ => mean.into_iter().zip(weighted).map(|(a, b)| a + b).collect(),
        };
    }
    along(state, &mean, h)
}

fn semi_implicit(state: &[Tensor<1>], derivative: &Derivative, h: &Tensor<1>) -> Vec<Tensor<1>> {
    let joints = state.len() / 2;
    let (q, v) = state.split_at(joints);
    let (f_q, f_v) = derivative.rates.split_at(joints);
    let gains: Vec<Tensor<1>> = f_v.iter().map(|f| f.clone() * h.clone()).collect();
    let positions = (q.iter().zip(f_q).zip(&gains))
        .map(|((q, f), gain)| q.clone() + (f.clone() + gain.clone()) * h.clone());
    let velocities = v
        .iter()
        .zip(&gains)
        .map(|(v, gain)| v.clone() + gain.clone());
    positions.chain(velocities).collect()
}

/// state + h * rates
fn along(state: &[Tensor<1>], rates: &[Tensor<1>], h: &Tensor<1>) -> Vec<Tensor<1>> {
    (state.iter().zip(rates))
        .map(|(s, rate)| s.clone() + rate.clone() * h.clone())
        .collect()
}

use burn::tensor::Tensor;

use super::{Flow, Prepared};
use crate::model::Integrator;

/// One step of a batch.
#[derive(Debug, Clone)]
pub struct Step {
    /// `2n` columns `[batch]`.
    pub state: Vec<Tensor<1>>,
    /// F_r at the start of the step, `[batch, n or 2n]`: not at inner stages, so that its norm means the
    /// same under every integrator.
    pub residual: Option<Tensor<2>>,
}

impl Prepared<'_> {
    /// Advance columns `[batch]` of states by `dt` seconds (`[batch]`) from `time`, under `input`.
    pub fn step(
        &self,
        integrator: Integrator,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        dt: &Tensor<1>,
    ) -> Step {
        let first = self.flow(state, input, time);
        let residual = first.residual.clone();
        let state = match integrator {
            Integrator::SemiImplicitEuler => semi_implicit(state, &first, dt),
            Integrator::Rk4 => rk4(self, state, input, time, dt, first),
            Integrator::Fine { steps } => {
                let h = dt.clone() / f64::from(steps.get());
                let mut now = rk4(self, state, input, time, &h, first);
                for k in 1..steps.get() {
                    let time = time.clone() + h.clone() * f64::from(k);
                    let start = self.flow(&now, input, &time);
                    now = rk4(self, &now, input, &time, &h, start);
                }
                now
            }
        };
        Step { state, residual }
    }
}

fn semi_implicit(state: &[Tensor<1>], flow: &Flow, h: &Tensor<1>) -> Vec<Tensor<1>> {
    let joints = state.len() / 2;
    let (q, v) = state.split_at(joints);
    let (f_q, f_v) = flow.rates.split_at(joints);
    let gains: Vec<Tensor<1>> = f_v.iter().map(|f| f.clone() * h.clone()).collect();
    let positions = (q.iter().zip(f_q).zip(&gains))
        .map(|((q, f), gain)| q.clone() + (f.clone() + gain.clone()) * h.clone());
    let velocities = v
        .iter()
        .zip(&gains)
        .map(|(v, gain)| v.clone() + gain.clone());
    positions.chain(velocities).collect()
}

/// `first` is the flow at the start of the step.
fn rk4(
    model: &Prepared,
    state: &[Tensor<1>],
    input: &[Tensor<1>],
    time: &Tensor<1>,
    h: &Tensor<1>,
    first: Flow,
) -> Vec<Tensor<1>> {
    let half = h.clone() * 0.5;
    let (middle, end) = (time.clone() + half.clone(), time.clone() + h.clone());
    let k1 = first.rates;
    let k2 = model.flow(&along(state, &k1, &half), input, &middle).rates;
    let k3 = model.flow(&along(state, &k2, &half), input, &middle).rates;
    let k4 = model.flow(&along(state, &k3, h), input, &end).rates;
    let sixth = h.clone() / 6.0;
    let mean: Vec<Tensor<1>> = (k1.into_iter().zip(k2).zip(k3).zip(k4))
        .map(|(((a, b), c), d)| a + (b + c) * 2.0 + d)
        .collect();
    along(state, &mean, &sixth)
}

/// state + h * rates
fn along(state: &[Tensor<1>], rates: &[Tensor<1>], h: &Tensor<1>) -> Vec<Tensor<1>> {
    (state.iter().zip(rates))
        .map(|(s, rate)| s.clone() + rate.clone() * h.clone())
        .collect()
}

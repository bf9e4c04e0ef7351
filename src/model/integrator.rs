use std::fmt::{self, Display, Formatter};
use std::num::NonZeroU32;
use std::str::FromStr;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::hybrid::{Flow, Prepared};

/// How ds/dt becomes the next state. The input is held over the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Integrator {
    /// Velocity first, then position with the new velocity: v' = v + h f_v, q' = q + h (f_q + h f_v).
    /// Where f_q = v this is q' = q + h v'; whatever else f_q holds is taken at the step's start. Order 1.
    #[default]
    SemiImplicitEuler,
    /// The classical Runge-Kutta method of order 4.
    Rk4,
    /// Equal substeps of [`Integrator::Rk4`], which reach a given error in far fewer evaluations than
    /// substeps of order 1.
    Fine { steps: NonZeroU32 },
}

impl Integrator {
    /// How it is written on a command line.
    const USAGE: &str = "semi_implicit_euler, rk4, or fine:N for N substeps of rk4";

    /// The equal parts of a step that are integrated one after the other.
    pub fn parts(self) -> usize {
        match self {
            Self::SemiImplicitEuler | Self::Rk4 => 1,
            Self::Fine { steps } => steps.get() as usize,
        }
    }
}

impl FromStr for Integrator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unknown = || format!("unknown integrator {text:?}; there are {}", Self::USAGE);
        match (text, text.split_once(':')) {
            ("semi_implicit_euler", _) => Ok(Self::SemiImplicitEuler),
            ("rk4", _) => Ok(Self::Rk4),
            (_, Some(("fine", steps))) => {
                let steps = steps.parse().map_err(|_| unknown())?;
                Ok(Self::Fine { steps })
            }
            _ => Err(unknown()),
        }
    }
}

impl Display for Integrator {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::SemiImplicitEuler => f.write_str("semi_implicit_euler"),
            Self::Rk4 => f.write_str("rk4"),
            Self::Fine { steps } => write!(f, "fine:{steps}"),
        }
    }
}

/// One step of a batch.
#[derive(Debug, Clone)]
pub struct Step {
    /// `2n` columns `[batch]`.
    pub state: Vec<Tensor<1>>,
    /// F_r at the start of the step, `[batch, n or 2n]`: not at inner stages, so that its norm means the
    /// same under every integrator.
    pub residual: Option<Tensor<2>>,
}

impl Integrator {
    /// Advance columns `[batch]` of states by `dt` seconds (`[batch]`) from `time`, under `input`.
    pub fn step(
        self,
        model: &Prepared,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        dt: &Tensor<1>,
    ) -> Step {
        let first = model.flow(state, input, time);
        let residual = first.residual.clone();
        let state = match self {
            Self::SemiImplicitEuler => semi_implicit(state, &first, dt),
            Self::Rk4 => rk4(model, state, input, time, dt, first),
            Self::Fine { steps } => {
                let h = dt.clone() / f64::from(steps.get());
                let mut now = rk4(model, state, input, time, &h, first);
                for k in 1..steps.get() {
                    let time = time.clone() + h.clone() * f64::from(k);
                    let start = model.flow(&now, input, &time);
                    now = rk4(model, &now, input, &time, &h, start);
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

//! One step of the integrator as a graph.

use super::builder::{Builder, Value};
use super::derivative::Derivative;
use super::proto::Graph;
use crate::formats::ExportModel;
use crate::formats::discrete_filter::{Combination, DiscreteFilter};
use crate::model::Integrator;

/// Inputs of a graph, as columns.
pub struct Inputs {
    pub state: Vec<Value>,
    pub torque: Vec<Value>,
    /// Where the equations depend on it.
    pub time: Option<Value>,
}

pub fn inputs(builder: &mut Builder, model: &ExportModel, torque: &str) -> Inputs {
    let n = model.joints();
    let units: Vec<_> = (0..n).map(|joint| model.units(joint).join(", ")).collect();
    let about = format!("of joints in {}", units.join("; "));
    let state = builder.input(
        "state",
        2 * n,
        &format!("positions, then velocities {about}"),
    );
    let torque = builder.input("torque", n, &format!("{torque} {about}"));
    let time = model.depends_on_time();
    Inputs {
        state: builder.split(&state, 2 * n),
        torque: builder.split(&torque, n),
        time: time.then(|| builder.input("time", 1, "in s, at the start of the step")),
    }
}

/// The graph of a whole step.
pub fn graph(model: &ExportModel) -> Graph {
    let n = model.joints();
    let mut builder = Builder::default();
    let inputs = inputs(&mut builder, model, "torque commanded over the step");
    let acting = act(&mut builder, model, &inputs);
    let derivative = Derivative::new(&mut builder, model);
    let mut step = Step {
        builder: &mut builder,
        derivative,
        h: model.step_s,
    };
    let next = match model.integrator {
        Integrator::SemiImplicitEuler => step.semi_implicit(&inputs, &acting[0]),
        Integrator::Rk4 | Integrator::Fine { .. } => {
            step.h /= acting.len() as f64;
            let mut state = inputs.state.clone();
            for (k, torque) in acting.iter().enumerate() {
                state = step.rk4(&state, torque, inputs.time.as_ref(), k);
            }
            state
        }
    };
    let next = builder.concat(&next, &inputs.state[0]);
    builder.output("next_state", &next, 2 * n, "as `state`, a step later");
    builder.finish("step")
}

/// The torque that acts over each substep. The memory of delays and lags is one more input and output.
fn act(builder: &mut Builder, model: &ExportModel, inputs: &Inputs) -> Vec<Vec<Value>> {
    let filters = DiscreteFilter::all(model);
    let mut acting = vec![inputs.torque.clone(); model.integrator.parts()];
    let width: usize = filters.iter().map(DiscreteFilter::memory).sum();
    if width == 0 {
        return acting;
    }
    let about = "for each filtered joint its earlier torques, the newest first, then its lagged torque; zeros at rest";
    let memory = builder.input("memory", width, about);
    let mut memory = builder.split(&memory, width).into_iter();
    let mut next = Vec::new();
    for filter in filters {
        let mut torques = vec![inputs.torque[filter.joint].clone()];
        torques.extend(memory.by_ref().take(filter.past));
        let lagged = filter.lags.then(|| memory.next()).flatten();
        let [first, then] = filter.places.map(|k| torques[k].clone());
        let mut sum = |sum: &Combination| {
            let lag = lagged.as_ref().map(|lagged| (sum.lagged, lagged));
            let terms = [(sum.first, &first), (sum.then, &then)];
            weighted(builder, lag.into_iter().chain(terms))
        };
        for (part, mean) in filter.mean.iter().enumerate() {
            acting[part][filter.joint] = sum(mean);
        }
        let end = filter.lags.then(|| sum(&filter.end));
        next.extend(torques.into_iter().take(filter.past).chain(end));
    }
    let next = builder.concat(&next, &inputs.state[0]);
    builder.output("next_memory", &next, width, "`memory` of the next step");
    acting
}

/// A sum of values times constants, without those that are zero.
fn weighted<'v>(builder: &mut Builder, terms: impl Iterator<Item = (f64, &'v Value)>) -> Value {
    let mut sum: Option<Value> = None;
    for (factor, value) in terms.filter(|(factor, _)| *factor != 0.0) {
        let factor = builder.constant(factor);
        let term = builder.apply("Mul", &[&factor, value]);
        sum = Some(match sum {
            Some(sum) => builder.apply("Add", &[&sum, &term]),
            None => term,
        });
    }
    sum.unwrap_or_else(|| builder.constant(0.0))
}

struct Step<'b, 'm> {
    builder: &'b mut Builder,
    derivative: Derivative<'m>,
    /// In s.
    h: f64,
}

impl Step<'_, '_> {
    /// v' = v + h f_v, q' = q + h (f_q + h f_v)
    fn semi_implicit(&mut self, inputs: &Inputs, torque: &[Value]) -> Vec<Value> {
        let time = inputs.time.as_ref();
        let rates = self
            .derivative
            .write(self.builder, &inputs.state, torque, time);
        let n = torque.len();
        let gains: Vec<Value> = rates[n..].iter().map(|f| self.times(self.h, f)).collect();
        let (q, v) = inputs.state.split_at(n);
        let mut next = Vec::new();
        for ((q, f), gain) in q.iter().zip(&rates).zip(&gains) {
            let speed = self.builder.apply("Add", &[f, gain]);
            next.push(self.along(q, self.h, &speed));
        }
        for (v, gain) in v.iter().zip(&gains) {
            next.push(self.builder.apply("Add", &[v, gain]));
        }
        next
    }

    /// The classical Runge-Kutta method of order 4, in substep `k`.
    fn rk4(
        &mut self,
        state: &[Value],
        torque: &[Value],
        time: Option<&Value>,
        k: usize,
    ) -> Vec<Value> {
        let h = self.h;
        let from = k as f64 * h;
        let k1 = self.stage(state, torque, time, from);
        let at = self.all_along(state, 0.5 * h, &k1);
        let k2 = self.stage(&at, torque, time, from + 0.5 * h);
        let at = self.all_along(state, 0.5 * h, &k2);
        let k3 = self.stage(&at, torque, time, from + 0.5 * h);
        let at = self.all_along(state, h, &k3);
        let k4 = self.stage(&at, torque, time, from + h);
        let slopes = (0..state.len()).map(|j| {
            let middle = self.builder.apply("Add", &[&k2[j], &k3[j]]);
            let ends = self.builder.apply("Add", &[&k1[j], &k4[j]]);
            let middle = self.times(2.0, &middle);
            self.builder.apply("Add", &[&ends, &middle])
        });
        let slopes: Vec<Value> = slopes.collect();
        self.all_along(state, h / 6.0, &slopes)
    }

    fn stage(
        &mut self,
        state: &[Value],
        torque: &[Value],
        time: Option<&Value>,
        after: f64,
    ) -> Vec<Value> {
        let time = time.map(|time| {
            let after = self.builder.constant(after);
            self.builder.apply("Add", &[time, &after])
        });
        self.derivative
            .write(self.builder, state, torque, time.as_ref())
    }

    fn all_along(&mut self, state: &[Value], h: f64, slopes: &[Value]) -> Vec<Value> {
        let pairs = state.iter().zip(slopes);
        pairs.map(|(x, slope)| self.along(x, h, slope)).collect()
    }

    /// x + h * slope
    fn along(&mut self, x: &Value, h: f64, slope: &Value) -> Value {
        let part = self.times(h, slope);
        self.builder.apply("Add", &[x, &part])
    }

    fn times(&mut self, factor: f64, value: &Value) -> Value {
        let factor = self.builder.constant(factor);
        self.builder.apply("Mul", &[&factor, value])
    }
}

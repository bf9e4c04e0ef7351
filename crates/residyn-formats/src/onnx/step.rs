//! One step of the integrator as a graph.

use super::builder::{Builder, Value};
use super::derivative::{Derivative, Moment};
use super::proto::Graph;
use crate::ExportModel;
use crate::discrete_filter::{Combination, DiscreteFilter};
use residyn_core::data::Joint;
use residyn_core::sim::Scheme;

/// Inputs of a graph, as columns.
pub struct Inputs {
    pub state: Vec<Value>,
    pub torque: Vec<Value>,
    /// If the equations depend on it.
    pub time: Option<Value>,
}

pub fn inputs(builder: &mut Builder, model: &ExportModel, torque: &str) -> Inputs {
    let n = model.joints();
    let units: Vec<_> = Joint::all(n)
        .map(|joint| model.units(joint).join(", "))
        .collect();
    let about = format!("of joints in {}", units.join("; "));
    let of_effects = model
        .internal_labels()
        .map(|label| format!(", then {label}"));
    let of_effects: String = of_effects.collect();
    let state = builder.input(
        "state",
        model.states(),
        &format!("positions, then velocities {about}{of_effects}"),
    );
    let torque = builder.input("torque", n, &format!("{torque} {about}"));
    let time = model.depends_on_time();
    Inputs {
        state: builder.split(&state, model.states()),
        torque: builder.split(&torque, n),
        time: time.then(|| builder.input("time", 1, "in s, at the start of the step")),
    }
}

/// The graph of a whole step.
pub fn graph(model: &ExportModel) -> Graph {
    let mut builder = Builder::default();
    let about = format!("{} over the step", model.driving());
    let inputs = inputs(&mut builder, model, &about);
    let acting = act(&mut builder, model, &inputs);
    let derivative = Derivative::new(&mut builder, model);
    let mut step = Step {
        builder: &mut builder,
        derivative,
        h: model.step_s / acting.len() as f64,
    };
    let mut next = inputs.state.clone();
    for (k, torque) in acting.iter().enumerate() {
        next = step.substep(
            model.integrator.scheme(),
            &next,
            torque,
            inputs.time.as_ref(),
            k,
        );
    }
    let next = builder.concat(&next, &inputs.state[0]);
    builder.output(
        "next_state",
        &next,
        model.states(),
        "as `state`, a step later",
    );
    builder.finish("step")
}

/// The torque that acts over each substep. The memory of delays and lags is one more input and output.
fn act(builder: &mut Builder, model: &ExportModel, inputs: &Inputs) -> Vec<Vec<Value>> {
    let filters = DiscreteFilter::all(model);
    let mut acting = vec![inputs.torque.clone(); model.integrator.substeps()];
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

/// A sum of values times constants, without zero terms.
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
    /// Substep `k` by a scheme.
    fn substep(
        &mut self,
        scheme: &Scheme,
        state: &[Value],
        torque: &[Value],
        time: Option<&Value>,
        k: usize,
    ) -> Vec<Value> {
        let begin = k as f64 * self.h;
        let (mut inner, mut next, mut rates) = (state.to_vec(), state.to_vec(), Vec::new());
        for (place, stage) in scheme.stages.iter().enumerate() {
            let time = self.time(time, begin + stage.time * self.h);
            let at = Moment {
                state: &inner,
                torque,
                time: time.as_ref(),
                begun: state,
                length_s: self.h,
            };
            rates = self.derivative.write(self.builder, &at);
            next = self.along(&next, stage.weight * self.h, &rates);
            if place + 1 < scheme.stages.len() {
                inner = self.along(state, stage.reach * self.h, &rates);
            }
        }
        if scheme.semi_implicit {
            let n = torque.len();
            // The change of velocity also moves the positions: h^2 f_v.
            let moved = self.along(&next[..n], self.h * self.h, &rates[n..2 * n]);
            next.splice(..n, moved);
        }
        next
    }

    /// The time so long after the step has begun.
    fn time(&mut self, time: Option<&Value>, after: f64) -> Option<Value> {
        time.map(|time| {
            let after = self.builder.constant(after);
            self.builder.apply("Add", &[time, &after])
        })
    }

    /// x + h * slope
    fn along(&mut self, x: &[Value], h: f64, slopes: &[Value]) -> Vec<Value> {
        let h = self.builder.constant(h);
        let pairs = x.iter().zip(slopes);
        pairs
            .map(|(x, slope)| {
                let part = self.builder.apply("Mul", &[&h, slope]);
                self.builder.apply("Add", &[x, &part])
            })
            .collect()
    }
}

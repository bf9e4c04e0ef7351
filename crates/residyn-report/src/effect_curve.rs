//! The force that the effects' formulas add, over the one variable that they depend on, with 95 % bands.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use residyn_core::closeloop::Outcome;
use residyn_core::data::Joint;
use residyn_core::expr::Program;
use residyn_core::model::FittedEffect;
use residyn_plot::bends;

/// force of the effects added on a joint that depend on this variable alone; linear between the points
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct EffectCurveEntry {
    /// q, qd, tau or t
    pub variable: String,
    /// names of the effects for people
    pub effects: Vec<String>,
    pub x: Vec<f64>,
    /// their sum, N m or N
    pub force: Vec<f64>,
    /// ends of the pointwise 95 % band that follows from the values' intervals; empty if a value is undetermined
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

/// Number of points at which a curve is computed.
const FINE: usize = 1001;
/// Largest error of a curve between the points that are kept, as a share of its largest force.
const OFF: f64 = 3e-3;

/// An added effect, its program over the variable, and the index of its first parameter among all.
struct Term<'a> {
    effect: &'a FittedEffect,
    program: Program,
    first: usize,
}

/// The curves of a joint; `range` gives the range of each variable in the logs.
pub(super) fn effect_curves(
    outcome: &Outcome,
    joint: Joint,
    range: impl Fn(&str) -> [f64; 2],
) -> Vec<EffectCurveEntry> {
    let model = &outcome.models.after.model;
    let mut of_variable: BTreeMap<&str, Vec<Term<'_>>> = BTreeMap::new();
    for k in outcome.models.before.model.effects.len()..model.effects.len() {
        let effect = &model.effects[k];
        let over = effect.effect.over_one_variable();
        if let Some((variable, program)) = over.filter(|_| effect.joint == joint) {
            let first = model.place_of(k).start;
            of_variable.entry(variable).or_default().push(Term {
                effect,
                program,
                first,
            });
        }
    }
    let curves = of_variable.into_iter();
    curves
        .map(|(variable, terms)| curve(outcome, variable, &terms, range(variable)))
        .collect()
}

fn curve(
    outcome: &Outcome,
    variable: &str,
    terms: &[Term<'_>],
    [low, high]: [f64; 2],
) -> EffectCurveEntry {
    #[allow(clippy::cast_precision_loss)] // a thousand points
    let at = |k: usize| low + (high - low) * k as f64 / (FINE - 1) as f64;
    let x: Vec<f64> = (0..FINE).map(at).collect();
    let forces: Vec<[f64; 2]> = x.iter().map(|x| force(outcome, terms, *x)).collect();
    let each = |sign: f64| -> Vec<f64> {
        let ends = forces.iter().map(|[force, half]| force + sign * half);
        ends.collect()
    };
    let lines = match forces.iter().all(|[_, half]| half.is_finite()) {
        true => vec![each(0.0), each(-1.0), each(1.0)],
        false => vec![forces.iter().map(|[force, _]| *force).collect()],
    };
    let largest = forces.iter().map(|[force, _]| force.abs());
    let kept = bends(&x, &lines, OFF * largest.fold(0.0, f64::max));
    let thinned = |line: Option<&Vec<f64>>| -> Vec<f64> {
        let line = line.map_or(&[][..], Vec::as_slice);
        let kept = kept.iter().filter_map(|k| line.get(*k));
        kept.map(|value| super::plot_data::rounded(*value))
            .collect()
    };
    EffectCurveEntry {
        variable: variable.to_owned(),
        effects: terms.iter().map(|term| term.effect.title()).collect(),
        x: thinned(Some(&x)),
        force: thinned(lines.first()),
        low: thinned(lines.get(1)),
        high: thinned(lines.get(2)),
    }
}

/// The force at a value of the variable, and half the width of its interval.
fn force(outcome: &Outcome, terms: &[Term<'_>], x: f64) -> [f64; 2] {
    let models = &outcome.models;
    let mut sum = 0.0;
    // How much the force changes over half the interval of each free value.
    let mut moves: Vec<(usize, f64)> = Vec::new();
    for term in terms {
        let values = &term.effect.values;
        let inputs: Vec<f64> = std::iter::once(x)
            .chain(values.iter().map(|(value, _)| *value))
            .collect();
        let found = term.program.eval(&inputs);
        sum += found[0];
        for (k, (slope, (_, interval))) in found[1..].iter().zip(values).enumerate() {
            let mut columns = models.after.fit.columns.iter();
            let column = columns.position(|column| column.parameter == term.first + k);
            if let (Some(column), Some([low, high])) = (column, interval) {
                moves.push((column, 0.5 * slope * (high - low)));
            }
        }
    }
    let products = moves.iter().flat_map(|(i, a)| {
        let correlation = |j: &usize| models.uncertainty.correlation(*i, *j);
        moves.iter().map(move |(j, b)| a * b * correlation(j))
    });
    let square: f64 = products.sum();
    [sum, square.max(0.0).sqrt()]
}

use std::fmt::Write;
use std::path::Path;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::unexplained::Unexplained;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::select::{Losses, best_start, gain, is_consistent, screened_cost};
use crate::data::{Joint, Quantity};
use crate::model::{Effect, FittedEffect};

/// A formula for the unexplained residual: a proposal, not a finding, supported only by its fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Proposal {
    pub joint: Joint,
    /// Force in N m (or N), such as `-0.0012 * qd1^3`.
    pub formula: String,
    /// Share of the loss above noise that the formula removes, on blocks left out of its fit.
    #[schemars(range(max = 1))]
    pub explains: f64,
    /// The formula as an effect file, for a folder of a library.
    pub file: String,
}

/// A term of a force.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Term {
    /// In the joint's variables and, if it has a memory, its state `w`.
    text: &'static str,
    /// Powers of q, qd, tau and t in its unit.
    powers: [i32; 4],
    memory: Option<Memory>,
}

/// How the state of a term moves: a filtered input, or a loop that depends on the way and not on speed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Memory {
    rate: &'static str,
    /// Of the state.
    unit: &'static str,
    /// The parameter in the rate, which is one of these two.
    scale: &'static str,
}

const TIME: &str = "T = { unit = \"s\", typical = TYPICAL, bounds = [0.001, 1000], search = [0.02, 0.1, 0.5, 2, 10] }";
const WAY: &str = "alpha = { unit = \"rad\", typical = TYPICAL, bounds = [0.0001, 10], search = [0.003, 0.03, 0.3] }";

/// Terms of forces in machines. Linear, square and cubic terms have units that give their coefficients a meaning;
/// functions of the angle and signs have no units.
const TERMS: [(&str, [i32; 4]); 31] = [
    ("1", [0, 0, 0, 0]),
    ("q", [1, 0, 0, 0]),
    ("sin(q)", [0, 0, 0, 0]),
    ("cos(q)", [0, 0, 0, 0]),
    ("sin(2*q)", [0, 0, 0, 0]),
    ("cos(2*q)", [0, 0, 0, 0]),
    ("sin(3*q)", [0, 0, 0, 0]),
    ("cos(3*q)", [0, 0, 0, 0]),
    ("sign(qd)", [0, 0, 0, 0]),
    ("qd", [0, 1, 0, 0]),
    ("abs(qd)", [0, 1, 0, 0]),
    ("qd*abs(qd)", [0, 2, 0, 0]),
    ("qd^2", [0, 2, 0, 0]),
    ("qd^3", [0, 3, 0, 0]),
    ("sign(qd)*sin(q)", [0, 0, 0, 0]),
    ("sign(qd)*cos(q)", [0, 0, 0, 0]),
    ("qd*sin(q)", [0, 1, 0, 0]),
    ("qd*cos(q)", [0, 1, 0, 0]),
    ("tau", [0, 0, 1, 0]),
    ("tau*abs(tau)", [0, 0, 2, 0]),
    ("tau^3", [0, 0, 3, 0]),
    ("sign(tau)", [0, 0, 0, 0]),
    ("tanh(tau)", [0, 0, 0, 0]),
    ("abs(tau)*sign(qd)", [0, 0, 1, 0]),
    ("tau*abs(qd)", [0, 1, 1, 0]),
    ("tau*qd", [0, 1, 1, 0]),
    ("tau*qd^2", [0, 2, 1, 0]),
    ("t", [0, 0, 0, 1]),
    ("t*sign(qd)", [0, 0, 0, 1]),
    ("t*qd", [0, 1, 0, 1]),
    ("t*tau", [0, 0, 1, 1]),
];

/// Terms with a memory: their rates and units, where the input is filtered.
const REMEMBERED: [(&str, [i32; 4], Memory); 8] = [
    ("w", [1, 0, 0, 0], filter("(q - w) / T", "rad")),
    ("w", [0, 1, 0, 0], filter("(qd - w) / T", "rad/s")),
    ("w", [0, 0, 1, 0], filter("(tau - w) / T", "N m")),
    ("w", [0, 0, 0, 0], filter("(sign(qd) - w) / T", "1")),
    ("w*sign(qd)", [0, 0, 0, 0], filter("(1 - w) / T", "1")),
    ("w*qd", [0, 1, 0, 0], filter("(1 - w) / T", "1")),
    ("w*tau", [0, 0, 1, 0], filter("(1 - w) / T", "1")),
    (
        "w",
        [0, 0, 0, 0],
        Memory {
            rate: "(qd - abs(qd) * w) / alpha",
            unit: "1",
            scale: WAY,
        },
    ),
];

const fn filter(rate: &'static str, unit: &'static str) -> Memory {
    Memory {
        rate,
        unit,
        scale: TIME,
    }
}

/// All terms, of which a sum has at most one with a memory.
fn terms() -> impl Iterator<Item = Term> {
    let plain = TERMS.iter().map(|&(text, powers)| Term {
        text,
        powers,
        memory: None,
    });
    let remembered = REMEMBERED.iter().map(|&(text, powers, memory)| Term {
        text,
        powers,
        memory: Some(memory),
    });
    plain.chain(remembered)
}

/// A short sum of terms for the force that the model lacks on the joint with the largest unexplained residual; one of them may have
/// a state. Terms are added while they lower the loss on blocks left out of the fit. `None` if the residual is not significant, or
/// no term fits it.
pub fn proposal(problem: &Problem<'_>, fitted: &Fitted, left: &Unexplained) -> Option<Proposal> {
    if !left.is_significant() {
        return None;
    }
    let noteworthy = problem.settings.diagnostics.noteworthy_share;
    let without = Losses::of(problem, fitted).of_joint(left.joint);
    let mut found: Option<Sum> = None;
    for _ in 0..problem.settings.proposal.most_terms {
        let (terms, losses) = match &found {
            Some(sum) => (sum.terms.as_slice(), &sum.losses),
            None => (&[][..], &without),
        };
        let longer = longer(problem, fitted, left.joint, terms)?;
        if gain(losses, &longer.losses) < noteworthy {
            break;
        }
        found = Some(longer);
    }
    let sum = found?;
    let structured = left.omnibus.shares[left.joint].max(noteworthy);
    Some(Proposal {
        joint: left.joint,
        formula: sum.formula(),
        explains: (gain(&without, &sum.losses) / structured).min(1.0),
        file: file(&sum.terms, &sum.magnitudes()),
    })
}

/// Terms that were fitted together with all parameters of a model.
struct Sum {
    terms: Vec<Term>,
    effect: FittedEffect,
    losses: Vec<f64>,
}

/// The sum with one more term, the one that lowers the loss most. What has no state goes first: a filter that is fast enough, or a
/// loop that is small enough, is its input.
fn longer(problem: &Problem<'_>, model: &Fitted, joint: Joint, sum: &[Term]) -> Option<Sum> {
    let is_new = |term: &Term| !sum.contains(term);
    let (remembered, plain): (Vec<Term>, Vec<Term>) = terms()
        .filter(is_new)
        .partition(|term| term.memory.is_some());
    let best = |of: Vec<Term>| best_of(problem, model, joint, sum, of);
    let plain = best(plain);
    if sum.iter().any(|term| term.memory.is_some()) {
        return plain;
    }
    let noteworthy = problem.settings.diagnostics.noteworthy_share;
    match (plain, best(remembered)) {
        (Some(plain), Some(remembered)) if gain(&plain.losses, &remembered.losses) < noteworthy => {
            Some(plain)
        }
        (plain, remembered) => remembered.or(plain),
    }
}

/// The sum with that one of these terms which lowers the loss most, and no value of which is at the end of its range.
fn best_of(
    problem: &Problem<'_>,
    model: &Fitted,
    joint: Joint,
    sum: &[Term],
    others: Vec<Term>,
) -> Option<Sum> {
    let screen = |term: Term| {
        let terms = [sum, &[term]].concat();
        let effect = effect(&terms);
        if !problem.shows(&effect) {
            return None;
        }
        let start = best_start(
            problem,
            model,
            &FittedEffect::absent(&effect, joint),
            f64::INFINITY,
        )?;
        let cost = screened_cost(problem, model, &start)?;
        Some((terms, start, cost))
    };
    let screened = others.into_par_iter().filter_map(screen);
    let mut screened: Vec<(Vec<Term>, FittedEffect, f64)> = screened.collect();
    screened.sort_by(|a, b| a.2.total_cmp(&b.2));
    screened.truncate(problem.settings.proposal.fitted_terms);
    let fit = |(terms, start, _): (Vec<Term>, FittedEffect, f64)| {
        let longer = model.effects_and(&[start]);
        let fitted = problem.with_effects(model, longer).ok()?;
        let effect = fitted.model.effects.last()?.clone();
        is_consistent(&effect).then(|| Sum {
            terms,
            losses: Losses::of(problem, &fitted).of_joint(joint),
            effect,
        })
    };
    let fitted: Vec<Sum> = screened.into_par_iter().filter_map(fit).collect();
    let loss = |sum: &Sum| sum.losses.iter().sum::<f64>();
    (fitted.into_iter()).min_by(|a, b| loss(a).total_cmp(&loss(b)))
}

impl Sum {
    fn formula(&self) -> String {
        let values = self.effect.values.iter().map(|(value, _)| digits(*value));
        let written = self
            .effect
            .expression(&values.collect::<Vec<_>>(), Quantity::Torque);
        written.replace("+ -", "- ")
    }

    fn magnitudes(&self) -> Vec<f64> {
        let values = self.effect.values.iter();
        values.map(|(value, _)| value.abs()).collect()
    }
}

/// Three significant digits, without an exponent.
fn digits(value: f64) -> String {
    let places = (2.0 - value.abs().max(1e-10).log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.places$}")
}

fn effect(terms: &[Term]) -> Effect {
    let text = file(terms, &vec![1.0; terms.len() + 1]);
    Effect::from_text(Path::new("proposal.toml"), &text).expect("terms are formulas of an effect")
}

/// An effect file with one coefficient a term and, if one has a memory, its scale, with these typical magnitudes.
fn file(terms: &[Term], magnitudes: &[f64]) -> String {
    let weighed = |(term, k): (&Term, usize)| format!("c_{k}*{}", term.text);
    let sum: Vec<String> = terms.iter().zip(1..).map(weighed).collect();
    let memory = terms.iter().find_map(|term| term.memory);
    let mut text = format!(
        "[effect]\nname = \"proposed\"\nabout = \"a formula fitted to the residual; not a finding\"\n\
         force = \"{}\"\n\n",
        sum.join(" + ")
    );
    if let Some(Memory { rate, unit, .. }) = memory {
        let _ = write!(
            text,
            "[states]\nw = {{ rate = \"{rate}\", unit = \"{unit}\" }}\n\n"
        );
    }
    let typical = |magnitude: &f64| digits(magnitude.max(1e-9));
    text += "[parameters]\n";
    for ((term, magnitude), k) in terms.iter().zip(magnitudes).zip(1..) {
        let (unit, typical) = (unit(term.powers), typical(magnitude));
        let _ = writeln!(text, "c_{k} = {{ unit = \"{unit}\", typical = {typical} }}");
    }
    if let Some((memory, scale)) = memory.zip(magnitudes.get(terms.len())) {
        let _ = writeln!(text, "{}", memory.scale.replace("TYPICAL", &typical(scale)));
    }
    text
}

/// The unit of a force over these powers of rad, rad/s, N m and s.
fn unit([q, qd, tau, t]: [i32; 4]) -> String {
    let powers = |unit: &str, power: i32| match power {
        0 => None,
        1 => Some(unit.to_owned()),
        _ => Some(format!("{unit}^{power}")),
    };
    // The torque that the term gives, over the torques in it; seconds count on both sides.
    let above = [
        powers("N m", i32::from(tau == 0)),
        powers("s", qd - qd.min(t)),
    ];
    let over = [
        powers("(N m)", (tau - 1).max(0)),
        powers("rad", q + qd),
        powers("s", t - qd.min(t)),
    ];
    let [above, over] = [Vec::from(above), Vec::from(over)]
        .map(|parts| -> Vec<String> { parts.into_iter().flatten().collect() });
    let above = match above.is_empty() {
        true => "1".to_owned(),
        false => above.join(" "),
    };
    match over.as_slice() {
        [] => above,
        [one] => format!("{above}/{one}"),
        many => format!("{above}/({})", many.join(" ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_term_is_a_valid_effect_formula() {
        for term in terms() {
            let effect = effect(&[term]);
            assert_eq!(effect.parameters.len(), 1 + effect.states.len());
        }
    }

    #[test]
    fn coefficients_have_units_that_give_a_force() {
        let units = [
            ([0, 0, 0, 0], "N m"),
            ([0, 3, 0, 0], "N m s^3/rad^3"),
            ([0, 0, 1, 0], "1"),
            ([0, 0, 2, 0], "1/(N m)"),
            ([0, 2, 1, 0], "s^2/rad^2"),
            ([0, 1, 0, 1], "N m/rad"),
            ([0, 0, 0, 1], "N m/s"),
            ([0, 0, 1, 1], "1/s"),
        ];
        for (powers, wanted) in units {
            assert_eq!(unit(powers), wanted);
        }
    }

    #[test]
    fn numbers_have_three_significant_digits() {
        assert_eq!(digits(-0.001_234_5), "-0.00123");
        assert_eq!(digits(1234.5), "1234");
    }
}

//! Starting values for a model that diverges with the values in its file.

use super::problem::{Problem, Sample};
use super::settings::FitSettings;
use crate::identify::Values;
use crate::model::{Model, Parameter};

/// Each free parameter is spread in another base of the van der Corput sequence.
const BASES: [u32; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/// The declared model at values around those in its file at which it does not diverge over short windows, nearest
/// first.
pub(super) fn around(problem: &Problem<'_>) -> impl Iterator<Item = Model> {
    let short = problem.windows_of(problem.settings.fit.short_window_s);
    let sample = Sample::of(&short, problem.settings.fit.sample_windows).shooting;
    spread(problem.declared, &problem.settings.fit).filter(move |model| {
        let dynamics = problem.compiled(model);
        let values = Values::of(&dynamics, problem.logs);
        let costs = sample.costs(&dynamics, &values, &sample.initial_start_states(0), 1.0);
        costs.iter().all(|cost| cost.is_finite())
    })
}

/// A model with its free parameters at values ever farther from its declared ones: spread evenly in the logarithm
/// (Halton 1960), each keeping its sign.
fn spread(declared: &Model, settings: &FitSettings) -> impl Iterator<Item = Model> {
    let most = settings.most_starts;
    (1..=most).map(move |k| {
        let mut model = declared.clone();
        let free = model.parameters.iter_mut().filter(|p| !p.fixed);
        for (parameter, base) in free.zip(BASES.into_iter().cycle()) {
            let reach = settings.farthest_start.ln() * f64::from(k) / f64::from(most);
            move_by(parameter, reach * (2.0 * radical_inverse(k, base) - 1.0));
        }
        model
    })
}

/// Move a value by a factor whose logarithm is `by`; a value at zero moves on its scale.
fn move_by(parameter: &mut Parameter, by: f64) {
    let moved = match parameter.value {
        0.0 => by * parameter.scale,
        value => value * by.exp(),
    };
    let [low, high] = parameter.bounds;
    parameter.value = moved.clamp(low, high);
}

/// The digits of a number mirrored at the radix point: evenly spread over 0 to 1 however many numbers are taken.
fn radical_inverse(mut number: u32, base: u32) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while number > 0 {
        place /= f64::from(base);
        value += place * f64::from(number % base);
        number /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::{FitSettings, radical_inverse, spread};
    use crate::closeloop::tests::pendulum;
    use crate::model::Model;

    #[test]
    fn starting_values_are_spread_ever_farther_around_the_declared_ones() {
        assert_eq!(
            [1, 2, 3, 4].map(|k| radical_inverse(k, 2)),
            [0.5, 0.25, 0.75, 0.125]
        );
        let mut declared = pendulum();
        declared.parameters[0].value = -15.0;
        let factors = |k: usize| -> Vec<f64> {
            let of = |model: Model| model.parameters[k].value;
            spread(&declared, &FitSettings::default())
                .map(|model| of(model) / declared.parameters[k].value)
                .collect()
        };
        for factors in [factors(0), factors(1)] {
            let farthest = |of: &[f64]| of.iter().map(|f| f.ln().abs()).fold(0.0, f64::max);
            assert!(farthest(&factors[..128]) < 10.0_f64.ln() / 4.0);
            assert!((5.0_f64.ln()..10.0_f64.ln()).contains(&farthest(&factors)));
            let up = factors.iter().filter(|f| **f > 1.0).count();
            assert!((250..=262).contains(&up), "{up}");
        }
    }
}

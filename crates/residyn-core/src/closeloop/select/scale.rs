use crate::closeloop::drive_gain::is_of_torque;
use crate::closeloop::problem::Problem;
use crate::data::Joint;
use crate::model::{FittedEffect, Model};

/// Sets in which fewer drives have gains, and all forces have another scale: gains of some drives look like other gains of the
/// other drives on a rig that is heavier or lighter as a whole. Where bodies are free, only what is declared of them tells the
/// scale. There is one set for each gain: that in which its drive has none.
pub(super) fn at_other_scales(
    problem: &Problem<'_>,
    added: &[FittedEffect],
) -> Vec<Vec<FittedEffect>> {
    let (gains, others): (Vec<FittedEffect>, Vec<FittedEffect>) =
        (added.iter().cloned()).partition(|own| factor(own).is_some());
    if !has_free_scale(problem.declared) {
        return Vec::new();
    }
    let of_joint = |joint| {
        let own = gains.iter().find(|own| own.joint == joint);
        own.and_then(factor).unwrap_or(1.0)
    };
    let relative_to = |reference: &FittedEffect| {
        let scale = factor(reference)?;
        let relative = |joint| {
            let effect = problem.measured(&reference.effect, joint);
            with_factor(
                FittedEffect::absent(&effect, joint),
                of_joint(joint) / scale,
            )
        };
        let all: Option<Vec<_>> = Joint::all(problem.declared.joints).map(relative).collect();
        let mut all = all?;
        let off = |own: &FittedEffect| factor(own).map_or(0.0, |factor| factor.ln().abs());
        all.sort_by(|a, b| off(b).total_cmp(&off(a)));
        all.truncate(gains.len() - 1);
        Some([others.as_slice(), &all].concat())
    };
    gains.iter().filter_map(relative_to).collect()
}

/// Whether a fit may change masses, inertias or frictions.
fn has_free_scale(declared: &Model) -> bool {
    let mut free = declared
        .parameters
        .iter()
        .filter(|parameter| !parameter.fixed);
    free.any(|parameter| is_of_torque(&parameter.unit))
}

/// By what an effect with a single value multiplies every command of its drive.
fn factor(effect: &FittedEffect) -> Option<f64> {
    let [(value, _)] = effect.values[..] else {
        return None;
    };
    effect.effect.gain(&[value]).filter(|gain| *gain > 0.0)
}

/// The same effect with the value that multiplies every command by this factor.
fn with_factor(effect: FittedEffect, factor: f64) -> Option<FittedEffect> {
    let [at_zero, at_one] = [0.0, 1.0].map(|value| effect.effect.gain(&[value]));
    let value = (factor - at_zero?) / (at_one? - at_zero?);
    value.is_finite().then(|| FittedEffect {
        values: vec![(value, None)],
        ..effect
    })
}

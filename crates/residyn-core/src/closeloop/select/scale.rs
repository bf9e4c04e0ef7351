use super::simpler::is_free_of;
use crate::data::Joint;
use crate::expr::is_of_torque;
use crate::model::{FittedEffect, Model};

/// Sets in which fewer drives have gains, and all forces have another scale: gains of some drives look like other gains of the
/// other drives on a rig that is heavier or lighter as a whole. Where bodies are free, only what is declared of them tells the
/// scale. There is one set for each gain: that in which its drive has none.
pub(super) fn at_other_scales(declared: &Model, added: &[FittedEffect]) -> Vec<Vec<FittedEffect>> {
    let (gains, others): (Vec<FittedEffect>, Vec<FittedEffect>) =
        (added.iter().cloned()).partition(|own| factor(own).is_some());
    if !has_free_scale(declared) {
        return Vec::new();
    }
    let relative_to = |reference: &FittedEffect| {
        let mut all = gains_relative_to(reference, &gains, declared.joints)?;
        let off = |own: &FittedEffect| factor(own).map_or(0.0, |factor| factor.ln().abs());
        all.sort_by(|a, b| off(b).total_cmp(&off(a)));
        all.truncate(gains.len() - 1);
        // The file may declare gains of its own.
        let mut drives = all.iter();
        let are_free = drives.all(|gain| is_free_of(gain, &declared.effects));
        are_free.then(|| [others.as_slice(), &all].concat())
    };
    gains.iter().filter_map(relative_to).collect()
}

/// The gains of all other drives at the scale at which one of a machine's gains is none.
pub(in crate::closeloop) fn gains_relative_to(
    reference: &FittedEffect,
    gains: &[FittedEffect],
    joints: usize,
) -> Option<Vec<FittedEffect>> {
    let scale = factor(reference)?;
    let of_joint = |joint| {
        let own = gains.iter().find(|own| own.joint == joint);
        own.and_then(factor).unwrap_or(1.0)
    };
    let others = Joint::all(joints).filter(|joint| *joint != reference.joint);
    let relative = |joint| {
        let gain = FittedEffect::absent(&reference.effect, joint);
        with_factor(gain, of_joint(joint) / scale)
    };
    others.map(relative).collect()
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

#[cfg(test)]
mod tests {
    use super::at_other_scales;
    use crate::data::Joint;
    use crate::model::{FittedEffect, Library};

    /// Joints and values of the gains of each set, next to the friction that all sets keep.
    fn gains(own: [f64; 2], free: bool) -> Vec<Vec<(usize, f64)>> {
        let library = Library::built_in();
        let on = |name: &str, joint: usize, value: f64| FittedEffect {
            values: vec![(value, None)],
            ..FittedEffect::absent(library.effect(name).unwrap(), Joint::at(joint))
        };
        let mut declared = library.model("acrobot").unwrap();
        for parameter in &mut declared.parameters {
            parameter.fixed |= !free;
        }
        let added = [
            on("actuator_gain", 0, own[0]),
            on("viscous_friction", 0, 0.2),
            on("actuator_gain", 1, own[1]),
        ];
        let of_set = |set: &Vec<FittedEffect>| {
            assert_eq!(set[0], added[1]);
            let gains = set[1..].iter();
            gains
                .map(|gain| (gain.joint.index(), gain.values[0].0))
                .collect()
        };
        at_other_scales(&declared, &added)
            .iter()
            .map(of_set)
            .collect()
    }

    #[test]
    fn no_drive_has_two_gains() {
        let library = Library::built_in();
        let gain = |joint: usize, value: f64| FittedEffect {
            values: vec![(value, None)],
            ..FittedEffect::absent(library.effect("actuator_gain").unwrap(), Joint::at(joint))
        };
        let mut declared = library.model("acrobot").unwrap();
        declared.effects = vec![gain(0, 0.1)];
        let sets = at_other_scales(&declared, &[gain(0, 0.5), gain(1, 2.0)]);
        assert_eq!(sets, [[gain(1, 1.0)]]);
    }

    #[test]
    fn two_gains_are_one_on_a_rig_of_other_masses() {
        assert_eq!(gains([0.5, 2.0], true), [[(1, 1.0)], [(0, -0.5)]]);
        assert!(
            gains([0.5, 2.0], false).is_empty(),
            "the file gives the masses"
        );
    }
}

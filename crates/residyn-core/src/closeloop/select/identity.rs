use crate::closeloop::problem::Problem;
use crate::data::Joint;
use crate::model::FittedEffect;

/// Identifies an effect within a search. A ripple with another number of periods is another effect.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EffectId {
    kind: Kind,
    joint: Joint,
    /// The bits of the whole-number values.
    whole: Vec<u64>,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Kind {
    /// By its index in the library.
    OfLibrary(usize),
    /// In the model file but not in the library, by its index in the file.
    OfFile(usize),
    /// The shift of a declared parameter, by the parameter's index.
    Shift(usize),
}

impl Problem<'_> {
    /// Identifies an effect that a search may try.
    ///
    /// # Panics
    /// If neither the library nor the model file has the effect: no search tries such an effect.
    pub(super) fn id(&self, effect: &FittedEffect) -> EffectId {
        let name = &effect.effect.name;
        let of_library = || self.effects().iter().position(|known| known.name == *name);
        let of_file = || {
            let mut carried = self.declared.effects.iter();
            carried.position(|carried| carried.effect.name == *name)
        };
        let kind = effect
            .shifted()
            .map(Kind::Shift)
            .or_else(|| of_library().map(Kind::OfLibrary))
            .or_else(|| of_file().map(Kind::OfFile));
        let values = effect.effect.parameters.iter().zip(&effect.values);
        let whole = values.filter(|(parameter, _)| parameter.whole);
        EffectId {
            kind: kind.expect("a search tries what the library or the file has"),
            joint: effect.joint,
            whole: whole.map(|(_, (value, _))| value.to_bits()).collect(),
        }
    }

    /// Identifies a set of effects, in no particular order.
    pub(super) fn key(&self, effects: &[FittedEffect]) -> Vec<EffectId> {
        let mut key: Vec<EffectId> = effects.iter().map(|effect| self.id(effect)).collect();
        key.sort();
        key
    }
}

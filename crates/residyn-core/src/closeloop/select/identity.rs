use crate::closeloop::problem::Problem;
use crate::data::Joint;
use crate::model::FittedEffect;

/// Identifies an effect among those of a search. A ripple of another number of periods is another effect.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EffectId {
    kind: Kind,
    joint: Joint,
    /// The bits of its whole numbers.
    whole: Vec<u64>,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Kind {
    /// By its place in the library.
    OfLibrary(usize),
    /// One that the model file carries and the library has not, by its place in the file.
    OfFile(usize),
    /// The shift of a declared parameter, by that one's place.
    Shift(usize),
}

impl Problem<'_> {
    /// Identifies an effect that a search may try.
    ///
    /// # Panics
    /// On an effect that neither the library nor the model file has: no search tries one.
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

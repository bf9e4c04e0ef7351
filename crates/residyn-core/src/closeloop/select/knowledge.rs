//! Which effects a fit distinguishes from the rest of its model.

use super::equations::Eliminated;
use crate::closeloop::problem::Problem;
use crate::data::Quantity;
use crate::identify::Fit;
use crate::model::{Effect, Model};

impl Problem<'_> {
    /// Whether an effect is one that most machines of the kind have and no file of theirs is about: a drive that closes a
    /// loop of its own is a geared motor, whose file is about the links.
    pub(in crate::closeloop) fn is_usual(&self, effect: &Effect) -> bool {
        self.declared.driven_by() == Quantity::Command && effect.baseline.is_some()
    }
}

/// What is known of a fit's values beside some of them, the base, and how much of it an effect needs for its own.
pub struct Knowledge {
    /// Information of the logs alone; `None` if it does not determine the base.
    logs: Option<Eliminated>,
    /// The same with that of the bodies' declaration, if it counts for some value.
    all: Option<Option<Eliminated>>,
    /// Which values belong to effects that most machines have.
    usual: Vec<bool>,
    /// The share of the information on an effect that must be independent of the rest.
    least: f64,
}

impl Knowledge {
    pub fn of(problem: &Problem<'_>, model: &Model, fit: &Fit, base: &[usize]) -> Self {
        let usual = |k: &usize| problem.is_usual(&model.effects[*k].effect);
        let places: Vec<_> = (problem.added(model).filter(usual))
            .map(|k| model.place_of(k))
            .collect();
        let is_usual = |parameter| places.iter().any(|place| place.contains(&parameter));
        let columns = fit.columns.iter();
        let usual: Vec<bool> = columns.map(|column| is_usual(column.parameter)).collect();
        Self {
            logs: Eliminated::ridged(&fit.equations().hessian, base),
            all: (usual.contains(&true)).then(|| Eliminated::ridged(&fit.information(), base)),
            usual,
            least: problem.settings.select.own_information,
        }
    }

    /// Whether these values are distinguished from each other and from the base. What only
    /// the declared bodies distinguish from errors of theirs, as a rotor next to a link, is distinguished on a rig that
    /// commands drive if most machines have it: anything else would be an error of the bodies under another name.
    pub fn distinguishes(&self, own: &[usize]) -> bool {
        self.distinguishes_all_of(own, |_| true)
    }

    /// As [`Knowledge::distinguishes`], for those of the values that are asked for.
    pub fn distinguishes_all_of(&self, own: &[usize], is_asked: impl Fn(usize) -> bool) -> bool {
        let suffices = |of: &Option<Eliminated>, for_usual: bool| {
            let shares = of.as_ref().and_then(|of| of.own_shares(own));
            shares.is_some_and(|shares| {
                let mut own = own.iter().zip(shares);
                own.all(|(i, share)| {
                    self.usual[*i] != for_usual || !is_asked(*i) || share > self.least
                })
            })
        };
        suffices(&self.logs, false) && self.all.as_ref().is_none_or(|all| suffices(all, true))
    }
}

//! Draws rigs until every effect matters.

use std::collections::BTreeMap;

use anyhow::{Error, Result, anyhow};
use rand::Rng;

use super::recipe::{Drawn, Recipe};
use crate::cell::last_is_test;
use crate::grid::Cell;
use crate::hidden::Hidden;
use crate::identifiable::{Told, at_truth};
use residyn_core::closeloop::{Settings, Split};
use residyn_core::model::{Library, Model};

/// Draws of single effects before the whole rig is redrawn, and draws of whole rigs before giving up.
const EFFECTS: usize = 16;
const RIGS: usize = 16;

impl Recipe {
    /// A rig for `cell` in which every effect matters: effects that do not matter are redrawn.
    ///
    /// # Errors
    /// As [`Recipe::draw`], or rules by which no effect matters.
    pub fn settle(
        &self,
        cell: &Cell,
        model: &Model,
        library: &Library,
        rng: &mut impl Rng,
    ) -> Result<Drawn> {
        for _ in 0..RIGS {
            let mut drawn = self.draw(rng).map_err(Error::msg)?;
            for _ in 0..EFFECTS {
                let Some(place) = self.idle(cell, &drawn, model, library)? else {
                    return Ok(drawn);
                };
                self.draw_effect(&mut drawn, place, rng)
                    .map_err(Error::msg)?;
            }
        }
        Err(anyhow!(
            "none of {} draws had effects that all matter",
            RIGS * EFFECTS
        ))
    }

    /// The index of an effect that does not matter, if there is one.
    fn idle(
        &self,
        cell: &Cell,
        drawn: &Drawn,
        model: &Model,
        library: &Library,
    ) -> Result<Option<usize>> {
        if drawn.effects.is_empty() || self.rules.matters == 0.0 {
            return Ok(None);
        }
        let settings = Settings::default();
        let (inside, outside) = drawn.effects.split_at(self.effects);
        let (split, declared) = record(cell, drawn, inside, model)?;
        let known = at_truth(model, &declared);
        let Some(message) = Told::fit(&known, library, &split, &settings, inside, &declared) else {
            return Ok(Some(0));
        };
        let matters = |rise: f64| rise >= self.rules.matters;
        if let Some(place) = (0..inside.len()).find(|k| !matters(message.rises_without(*k))) {
            return Ok(Some(place));
        }
        for k in 0..outside.len() {
            // Compared with the library's best stand-in for it, relative to the same rig without it.
            let present = [inside, &outside[..=k]].concat();
            let (split, declared) = record(cell, drawn, &present, model)?;
            let nearest = [inside, &drawn.stand_ins[k]].concat();
            let known = at_truth(model, &declared);
            let best = Told::fit(&known, library, &split, &settings, &nearest, &declared);
            if best.is_some_and(|best| !matters(best.error() / message.error())) {
                return Ok(Some(inside.len() + k));
            }
        }
        Ok(None)
    }
}

/// The logs of a drawn rig with these effects alone, and the true values of its declared parameters.
fn record(
    cell: &Cell,
    drawn: &Drawn,
    effects: &[Hidden],
    model: &Model,
) -> Result<(Split, BTreeMap<String, f64>)> {
    let (logs, truth) = cell.drawn(drawn, effects).record(model)?;
    Ok((last_is_test(logs), truth.declared))
}

//! Stage 4: how commands reach the drives of a machine on position control, decided by the motion.
//!
//! The torques that a law asks for, low-passed, hardly tell a delay from a lag, and a search that took the wrong one makes up
//! with friction and rotors for what it leaves. So the motion under the commands is asked which of them it fits better, and if
//! it is another one than was found, the search goes on from there, with that one alone.

use rand::Rng;

use super::by_motion::{estimate, loss_of_motion};
use super::drive_limits;
use super::error::StudyError;
use super::fit::Declared;
use super::problem::Problem;
use super::searched::Searched;
use super::stage::Watch;
use crate::data::Log;
use crate::model::{AlikeOn, Effect, FittedEffect, Library, Model};

/// As [`drive_limits::searched`], with the filter of commands that the motion asks for.
///
/// # Errors
/// As [`Problem::fit_declared`].
pub(super) fn searched<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Searched<'a>, StudyError> {
    let whole = declared.problem.library;
    let mut best = drive_limits::searched(declared, apart, rng, watch)?;
    if best.declared.problem.is_by_law() && is_in_doubt(&best) {
        best = searched_on(&best, apart, rng, watch).unwrap_or(best);
    }
    // What a search left out, like joints may have.
    best.declared.problem.library = whole;
    Ok(best)
}

/// What the search finds from there with the one filter that the motion asks for; `None` if the motion is fitted no better.
fn searched_on<'a>(
    best: &Searched<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Option<Searched<'a>> {
    let problem = &best.declared.problem;
    let found = &best.chosen.after.model;
    let enough = loss_of_motion(problem, found)? * (1.0 - problem.settings.select.round_gain);
    let of_filter = |library: &'a Library| {
        let filter = library.effects().iter().find(|effect| effect.is_filter())?;
        let model = filtered_by(filter, problem, found)?;
        Some((loss_of_motion(problem, &model)?, library, model))
    };
    let filters = problem.library.of_one_filter().iter();
    let likeliest = filters
        .filter_map(of_filter)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, library, model) = likeliest.filter(|(loss, ..)| *loss < enough)?;
    let alone = best.declared.clone().with_library(library);
    let first = estimate(&alone.problem, &model).ok()?;
    let other = Searched::from(first, alone, apart, rng, watch);
    let loss = loss_of_motion(problem, &other.chosen.after.model)?;
    (loss < enough).then_some(other)
}

/// A model whose commands are filtered in this way only, for as long as they were in all; `None` if they are already.
fn filtered_by(filter: &Effect, problem: &Problem<'_>, model: &Model) -> Option<Model> {
    let (declared, added) = model.effects.split_at(problem.added(model).start);
    let filters = added.iter().filter(|own| own.effect.is_filter());
    let filters: Vec<&FittedEffect> = filters.collect();
    if filters.iter().all(|own| own.effect.name == filter.name) {
        return None;
    }
    let of_joint = |joint| filters.iter().filter(move |own| own.joint == joint);
    let instead = |own: &FittedEffect| FittedEffect {
        values: vec![(of_joint(own.joint).map(|own| own.values[0].0).sum(), None)],
        ..FittedEffect::absent(filter, own.joint)
    };
    let is_first = |own: &FittedEffect| {
        of_joint(own.joint)
            .next()
            .is_some_and(|first| std::ptr::eq(*first, own))
    };
    let added = added.iter().filter_map(|own| match own.effect.is_filter() {
        true => is_first(own).then(|| instead(own)),
        false => Some(own.clone()),
    });
    Some(model.with_effects(declared.iter().cloned().chain(added).collect()))
}

/// Whether commands were found to be filtered, but not as one bus to all drives does.
fn is_in_doubt(searched: &Searched<'_>) -> bool {
    let filters: Vec<&FittedEffect> = (searched.added().iter())
        .filter(|added| added.effect.is_filter())
        .collect();
    let is_of_bus = |filter: &&FittedEffect| filter.effect.alike_on == AlikeOn::Commanded;
    let is_of_one_bus =
        filters.len() == searched.declared.problem.declared.joints && filters.iter().all(is_of_bus);
    !filters.is_empty() && !is_of_one_bus
}

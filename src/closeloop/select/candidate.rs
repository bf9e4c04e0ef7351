use rayon::prelude::*;

use crate::closeloop::fitted::Fitted;
use crate::closeloop::study::Study;
use crate::data::Joint;
use crate::identify::{Shooting, predicted_cost};
use crate::model::{Effect, FittedEffect};

/// Every effect of the library on every joint where it can act and where it is not in the model yet, and every
/// shift of a parameter that the file declares fixed.
pub fn candidates(
    study: &Study<'_>,
    library: &[Effect],
    present: &[FittedEffect],
) -> Vec<FittedEffect> {
    let mut all: Vec<FittedEffect> = study.declared.shifts();
    all.extend(acting(study, library));
    all.retain(|new| !present.iter().any(|old| old.excludes(new)));
    all
}

/// These effects on every joint where each can act and be observed.
pub fn acting(study: &Study<'_>, effects: &[Effect]) -> Vec<FittedEffect> {
    let mut all = Vec::new();
    for effect in effects {
        for joint in Joint::all(study.declared.joints) {
            if is_driven_enough(study, effect, joint)
                && study.declared.can_carry(effect, joint).is_ok()
            {
                let (speed, torque) = (study.top_speed[joint], study.top_torque[joint]);
                all.push(FittedEffect::absent(
                    &effect.measured_by(speed, torque),
                    joint,
                ));
            }
        }
    }
    all
}

/// Effects of the torque cannot be observed where there is none.
fn is_driven_enough(study: &Study<'_>, effect: &Effect, joint: Joint) -> bool {
    !effect.entry.needs_torque() || study.top_torque[joint] > 0.0
}

/// The candidate at each of its starting points, every combination of searched values.
pub fn starts(candidate: &FittedEffect) -> Vec<FittedEffect> {
    let mut points = vec![Vec::new()];
    for parameter in &candidate.effect.parameters {
        let grown = points.iter().flat_map(|point| {
            let starts = parameter.starts.iter();
            starts.map(move |start| [point.as_slice(), &[(*start, None)]].concat())
        });
        points = grown.collect();
    }
    let at = |values| FittedEffect {
        values,
        ..candidate.clone()
    };
    points.into_iter().map(at).collect()
}

/// The starting point of a candidate with the largest predicted decrease beside a model, and the predicted cost: chosen
/// on a sample of the windows where there are several, and predicted on all of them.
pub fn best_start(
    study: &Study<'_>,
    fitted: &Fitted,
    candidate: &FittedEffect,
) -> Option<(FittedEffect, f64)> {
    let mut starts = starts(candidate);
    if starts.len() > 1 {
        let locals = study.sample.locals(&fitted.fit.locals);
        let promised = |start: FittedEffect| {
            let cost = promised(study, &study.sample.shooting, fitted, &start, &locals)?;
            Some((start, cost))
        };
        let promised: Vec<(FittedEffect, f64)> =
            starts.into_par_iter().filter_map(promised).collect();
        let best = promised.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        starts = vec![best.0];
    }
    let start = starts.pop()?;
    let cost = promised(study, &study.shooting, fitted, &start, &fitted.fit.locals)?;
    Some((start, cost))
}

/// The cost of some windows that one Gauss-Newton step predicts for a candidate.
fn promised(
    study: &Study<'_>,
    shooting: &Shooting<'_>,
    fitted: &Fitted,
    start: &FittedEffect,
    locals: &[Vec<f64>],
) -> Option<f64> {
    let dynamics = study.extended(fitted, std::slice::from_ref(start));
    let (active, scale) = (study.active(&dynamics), fitted.fit.scale);
    predicted_cost(shooting, &dynamics, &active, locals, scale)
}

/// The model that a candidate joins: without the simpler effects that it contains, unless the file declares
/// them. `None` if the model has an effect that contains the candidate.
pub fn beside(study: &Study<'_>, fitted: &Fitted, candidate: &FittedEffect) -> Option<Fitted> {
    let contains = |a: &FittedEffect, b: &FittedEffect| {
        a.joint == b.joint && a.effect.contains.contains(&b.effect.name)
    };
    let mut present = fitted.model.effects.iter();
    if present.any(|present| contains(present, candidate)) {
        return None;
    }
    let mut beside = fitted.clone();
    let mut added = beside.model.effects.split_off(study.declared.effects.len());
    added.retain(|present| !contains(candidate, present));
    beside.model.effects.extend(added);
    Some(beside)
}

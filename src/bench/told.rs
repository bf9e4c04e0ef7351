//! The fit of the true structure: the best that any search could reach.

use super::hidden::Hidden;
use crate::closeloop::{Settings, Split, Study};
use crate::model::{FittedEffect, Library, Model};
use crate::sim::metric::{Assessment, assess};

/// Error of the model with the true effects, fitted from their true values to the logs that the search had:
/// position, all joints together, at the middle horizon \[rad\]. `None` where the library lacks one of them.
pub fn told(declared: &Model, library: &Library, split: &Split, effects: &[Hidden]) -> Option<f64> {
    let settings = Settings::default();
    let mut study = Study::new(declared, &split.train, &settings);
    let before = study.fit_declared().ok()?;
    let truth: Vec<FittedEffect> = effects
        .iter()
        .map(|hidden| fitted(&study, library, hidden))
        .collect::<Option<_>>()?;
    let locals = before.fit.locals.clone();
    let found = study
        .refit(&before.model.with_effects(truth), locals, None)
        .ok()?;
    let errors: Assessment = assess(
        &found.model.dynamics(),
        &split.test,
        &settings.score.horizons_s,
    );
    Some(errors.position_rms())
}

/// The effect with its true values; `None` where the library has no such effect.
fn fitted(study: &Study<'_>, library: &Library, hidden: &Hidden) -> Option<FittedEffect> {
    if hidden.name == "parameter_shift" {
        return shift(study.declared, hidden);
    }
    let joint = hidden.joint;
    let effect = library.effect(&hidden.name).ok()?;
    let effect = effect.measured_by(study.top_speed[joint], study.top_torque[joint]);
    let mut fitted = FittedEffect::absent(&effect, joint);
    for (slot, parameter) in fitted.values.iter_mut().zip(&effect.parameters) {
        slot.0 = match hidden.values.get(&parameter.name) {
            // Values per log start from zero.
            _ if parameter.per_log => 0.0,
            Some(value) => *value,
            // Selects a form of the effect's formula; the rig has no such number.
            None if parameter.whole => parameter.typical,
            None => return None,
        };
    }
    Some(fitted)
}

fn shift(model: &Model, hidden: &Hidden) -> Option<FittedEffect> {
    let (name, value) = hidden.values.first_key_value()?;
    let declared = model.parameters.iter().find(|p| p.name == *name)?;
    let mut shifts = model.shifts().into_iter();
    let mut shift = shifts.find(|shift| shift.effect.parameters[0].name == *name)?;
    shift.values[0].0 = value - declared.value;
    Some(shift)
}

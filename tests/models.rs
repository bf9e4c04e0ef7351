//! The exported models cover every kind: equations, effects, filters of the command, networks; one joint and two.

use residyn_formats::ExportModel;

use crate::support::catalogue::rng;
use crate::support::exported_models::all;

#[test]
fn the_exported_models_cover_every_kind() {
    let models = all();
    let some = |kind: fn(&ExportModel) -> bool| models.iter().any(|(_, model)| kind(model));
    assert!(some(|m| m.prior.is_none()
        && m.residual.is_none()
        && m.effects.is_empty()));
    assert!(some(
        |m| !m.equations.filters.is_empty() && m.residual.is_some()
    ));
    assert!(some(|m| m.prior.is_some()));
    for (name, model) in &models {
        let samples = model.samples(&mut rng(1)).unwrap();
        let answers = model.predict(&samples).unwrap();
        let numbers = answers.rollout.unwrap().concat();
        assert!(numbers.iter().all(|x| x.abs() < 100.0), "{name} runs away");
    }
}

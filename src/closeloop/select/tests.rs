//! Sets are compared before they are fitted, on a simulated pendulum with dry friction.

use super::candidate::candidates;
use super::folds::{Folds, left_out_losses};
use super::outlook::Outlook;
use crate::closeloop::settings::Settings;
use crate::closeloop::study::Study;
use crate::closeloop::tests::{logs, pendulum};
use crate::model::{FittedEffect, Library};

#[test]
fn what_is_left_out_together_is_a_connected_part_of_one_log() {
    let (declared, logs, settings) = (pendulum(), logs(), Settings::default());
    let study = Study::new(&declared, &logs, &settings);
    let folds = Folds::of(&study);
    assert!(folds.groups.is_sorted(), "{:?}", folds.groups);
    let mut logs_of = std::collections::HashMap::new();
    for (window, &stretch) in study.shooting.windows.iter().zip(&folds.stretches) {
        let log = logs_of.entry(folds.groups[stretch]).or_insert(window.log);
        assert_eq!(*log, window.log);
    }
    assert!(logs_of.len() >= settings.select.fewest_groups);
}

#[test]
fn the_outlook_knows_the_loss_of_the_model_and_promises_the_hidden_effect() {
    let (declared, logs, settings) = (pendulum(), logs(), Settings::default());
    let library = Library::built_in();
    let mut study = Study::new(&declared, &logs, &settings);
    let fitted = study.fit_declared(library.effects()).unwrap();
    let all = candidates(&study, library.effects(), &[]);
    let outlook = Outlook::of(&study, &fitted, &all).unwrap();
    let loss = |set: &[usize]| outlook.losses(set).unwrap().iter().sum::<f64>();
    let known: f64 = left_out_losses(&study, &fitted.fit).iter().sum();
    assert!((loss(&[]) / known - 1.0).abs() < 0.01);

    let items = outlook.items.iter().map(FittedEffect::label);
    let coulomb = items
        .clone()
        .position(|label| label.starts_with("coulomb"))
        .unwrap();
    let effects = outlook.effects(&[coulomb]);
    let with = study.with_effects(&fitted, effects).unwrap();
    let found: f64 = left_out_losses(&study, &with.fit).iter().sum();
    assert!(found < 0.2 * known);
    assert!(
        loss(&[coulomb]) < 0.3 * known,
        "{} {found} {known}",
        loss(&[coulomb])
    );
}

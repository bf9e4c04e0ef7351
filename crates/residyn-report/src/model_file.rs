use residyn_core::closeloop::Outcome;

/// The model that closing the loop ended with, as a model file: the declared equations with fitted values and the
/// effects that were found, with shifts included in the declared values.
pub fn model_file(outcome: &Outcome) -> String {
    format!(
        "# Fitted by residyn {}; the declared equations, then the effects that were found.\n\n{}",
        env!("CARGO_PKG_VERSION"),
        outcome.models.after.model.absorbed().file_text()
    )
}

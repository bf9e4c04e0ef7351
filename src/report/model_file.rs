use std::fmt::Write;

use crate::closeloop::Outcome;
use crate::model::{Parameter, System};

/// The declared model with fitted values and the effects that were found, as a model file. What the user
/// wrote stays as it is, comments included; only numbers of `[parameters]` change.
pub fn model_file(system: &System, outcome: &Outcome) -> String {
    let declared = &outcome.parameters[..outcome.before.declared.len()];
    let mut text = format!(
        "# Fitted by residyn {}; the declared equations, then the effects that were found.\n\n",
        env!("CARGO_PKG_VERSION")
    );
    text += &with_values(&system.declaration, declared, &outcome.sign_widths);
    for (effect, _) in outcome.after.effects.iter().zip(0..) {
        let finding = outcome
            .findings
            .iter()
            .find(|f| f.effect.joint == effect.joint && f.effect.effect.name == effect.effect.name);
        let effect = finding.map_or(effect, |finding| &finding.effect);
        let _ = write!(
            text,
            "\n[[effect]]\nname = \"{}\"\njoint = {}\n",
            effect.effect.name,
            effect.joint + 1
        );
        for (parameter, (value, ci95)) in effect.effect.parameters.iter().zip(&effect.values) {
            let interval = ci95.map_or_else(String::new, |[low, high]| {
                format!(", ci95 = [{low:?}, {high:?}]")
            });
            let _ = writeln!(
                text,
                "{} = {{ value = {value:?}{interval} }}",
                parameter.name
            );
        }
    }
    text
}

/// The declaration with new numbers in place of the declared ones.
fn with_values(declaration: &str, parameters: &[Parameter], sign_widths: &[f64]) -> String {
    let mut document: toml_edit::DocumentMut = declaration
        .parse()
        .expect("the declaration was read as TOML before");
    for parameter in parameters {
        let entry = &mut document["parameters"][&parameter.name];
        if let Some(table) = entry.as_table_like_mut() {
            table.insert("value", toml_edit::value(parameter.value));
            match parameter.ci95 {
                Some([low, high]) if low.is_finite() && high.is_finite() => {
                    let interval: toml_edit::Array = [low, high].into_iter().collect();
                    table.insert("ci95", toml_edit::value(interval));
                }
                _ => {
                    table.remove("ci95");
                }
            }
        }
    }
    // Predictions are only the same again with the same smoothing of dry friction.
    let widths: toml_edit::Array = sign_widths.iter().copied().collect();
    document["system"]["sign_width"] = toml_edit::value(widths);
    document.to_string()
}

use std::fmt::Write;

use crate::closeloop::Outcome;
use crate::model::{FittedEffect, OwnValue, Parameter, System};

/// The declared model with fitted values and the effects that were found, as a model file. What the user
/// wrote stays as it is, comments included; only numbers of `[parameters]` change.
pub fn model_file(system: &System, outcome: &Outcome) -> String {
    let declared = &outcome.models.parameters[..outcome.models.before.declared.len()];
    let mut text = format!(
        "# Fitted by residyn {}; the declared equations, then the effects that were found.\n\n",
        env!("CARGO_PKG_VERSION")
    );
    text += &with_values(&system.declaration, declared, &outcome.models.sign_widths);
    // Shifted parameters stand among the declared ones.
    let effects = outcome.models.after.effects.iter();
    for effect in effects.filter(|effect| effect.shifted().is_none()) {
        let finding =
            (outcome.effects.findings.iter()).find(|f| f.effect.label() == effect.label());
        let effect = finding.map_or(effect, |finding| &finding.effect);
        let _ = write!(
            text,
            "\n[[effect]]\nname = \"{}\"\njoint = {}\n",
            effect.effect.name,
            effect.joint + 1
        );
        for (k, parameter) in effect.effect.parameters.iter().enumerate() {
            let (value, ci95) = effect.values[k];
            let entry = value_and_interval(value, ci95) + &of_logs(effect, k);
            let _ = writeln!(text, "{} = {{ {entry} }}", parameter.name);
        }
    }
    text
}

fn value_and_interval(value: f64, ci95: Option<[f64; 2]>) -> String {
    let interval = ci95.map(|[low, high]| format!(", ci95 = [{low:?}, {high:?}]"));
    format!("value = {value:?}{}", interval.unwrap_or_default())
}

/// What is known of single logs, each called by its file name, or by its path where that is not enough.
fn of_logs(effect: &FittedEffect, k: usize) -> String {
    let own: Vec<&OwnValue> = effect.own.iter().filter(|own| own.parameter == k).collect();
    if own.is_empty() {
        return String::new();
    }
    let entry = |of: &&OwnValue| {
        let alone = own
            .iter()
            .filter(|other| other.log_name() == of.log_name())
            .count()
            == 1;
        let name = if alone { of.log_name() } else { of.log.clone() };
        let value = value_and_interval(of.value, of.ci95);
        format!("{} = {{ {value} }}", toml_edit::Key::new(name))
    };
    let entries: Vec<String> = own.iter().map(entry).collect();
    format!(", logs = {{ {} }}", entries.join(", "))
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

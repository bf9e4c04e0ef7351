//! A model as the text of a model file.

use std::fmt::Write;

use super::dynamics::PerLogValue;
use super::fitted::FittedEffect;
use super::system::Model;

impl Model {
    /// The model as a model file. The user's declarations stay as they are, comments included; only the numbers of
    /// `[parameters]` and the smoothing of friction change. The effects follow.
    pub fn file_text(&self) -> String {
        let mut text = self.declaration_with_values();
        for effect in &self.effects {
            let _ = write!(
                text,
                "\n[[effect]]\nname = \"{}\"\n{}\n",
                effect.effect.name,
                place(effect)
            );
            if let Some(status) = effect.status {
                let _ = writeln!(text, "status = \"{}\"", status.name());
            }
            for (k, parameter) in effect.effect.parameters.iter().enumerate() {
                let (value, ci95) = effect.values[k];
                let of_logs = of_logs(&effect.own, k);
                let of_logs = of_logs.map(|logs| format!(", logs = {logs}"));
                let entry = value_and_interval(value, ci95) + &of_logs.unwrap_or_default();
                let _ = writeln!(text, "{} = {{ {entry} }}", parameter.name);
            }
            if effect.fixed {
                text += "fixed = true\n";
            }
        }
        text
    }

    /// Write values of one log into the declaration, as its table `[logs."name"]`.
    pub(super) fn declare_values_in<'v>(
        &mut self,
        log: &str,
        values: impl Iterator<Item = (&'v str, f64)>,
    ) {
        let mut document = self.declaration_document();
        let logs = document["logs"].or_insert(toml_edit::table());
        if let Some(tables) = logs.as_table_mut() {
            tables.set_implicit(true);
        }
        let table = logs[log].or_insert(toml_edit::table());
        for (name, value) in values {
            table[name] = toml_edit::value(value);
        }
        self.declaration = document.to_string();
    }

    fn declaration_document(&self) -> toml_edit::DocumentMut {
        (self.declaration.parse()).expect("the declaration was read as TOML before")
    }

    fn declaration_with_values(&self) -> String {
        let mut document = self.declaration_document();
        for (k, parameter) in self.parameters.iter().enumerate() {
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
                table.remove("logs");
                if let Some(logs) = of_logs(&self.own, k) {
                    let logs: toml_edit::Value = logs.parse().expect("it is written as TOML");
                    table.insert("logs", toml_edit::value(logs));
                }
            }
        }
        if let Some(torque) = self.columns.torque {
            document["log"]["torque"] = toml_edit::value(torque.key());
        }
        // Predictions are only reproduced with the same smoothing of dry friction.
        if let Some(widths) = &self.smoothing_velocity {
            let widths: toml_edit::Array = widths.iter().copied().collect();
            document["system"]["smoothing_velocity"] = toml_edit::value(widths);
        }
        document.to_string()
    }
}

/// `joint = 1`, or `joints = [5, 6]` for an effect that couples two.
fn place(effect: &FittedEffect) -> String {
    match effect.joints()[..] {
        [joint, next] => format!("joints = [{joint}, {next}]"),
        _ => format!("joint = {}", effect.joint),
    }
}

fn value_and_interval(value: f64, ci95: Option<[f64; 2]>) -> String {
    let interval = ci95.map(|[low, high]| format!(", ci95 = [{low:?}, {high:?}]"));
    format!("value = {value:?}{}", interval.unwrap_or_default())
}

/// The per-log values of a parameter, each under its log's file name, or under its path if file names are equal.
fn of_logs(own: &[PerLogValue], k: usize) -> Option<String> {
    let own: Vec<&PerLogValue> = own.iter().filter(|own| own.parameter == k).collect();
    if own.is_empty() {
        return None;
    }
    let entry = |of: &&PerLogValue| {
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
    Some(format!("{{ {} }}", entries.join(", ")))
}

//! The file of an effect.

use std::path::Path;
use std::str::FromStr;

use super::effect::{
    COUPLING_NAMES, EFFECT_NAMES, Effect, EffectParameter, Entry, Measure, PLACE, RATIO,
};
use super::filter::CommandFilter;
use super::reader::{Document, FileError, Located, Section};
use crate::expr::{Formula, Graph, Scope};

const EFFECT_KEYS: &[&str] = &[
    "name",
    "about",
    "force",
    "torque",
    "angle",
    "inertia",
    "command",
    "reading",
    "coupling",
    "payload",
    "contains",
    "confused_with",
    "shown_by",
    "joints",
    "valid_if",
    "baseline",
];
const PARAMETER_KEYS: &[&str] = &[
    "unit",
    "about",
    "typical",
    "positive",
    "bounds",
    "start",
    "search",
    "relative_to",
    "whole",
    "per",
];
const ONE_WAY: &str =
    "one of force, torque, angle, inertia, command, reading, coupling and payload";
const ALL_OR_FIRST: [(&str, bool); 3] = [("", false), ("all", false), ("first", true)];
const FILTERS: [(&str, Option<CommandFilter>); 3] = [
    ("", None),
    ("delay", Some(CommandFilter::Delay)),
    ("lag", Some(CommandFilter::Lag)),
];
const MEASURES: [(&str, Measure); 3] = [
    ("", Measure::One),
    ("speed", Measure::Speed),
    ("torque", Measure::Torque),
];
const PER_LOG: &str = r#""log" for a parameter with a value of its own in each log"#;

impl Effect {
    /// The effect in `text`; `path` is for messages.
    ///
    /// # Errors
    /// Unknown or missing key, formula error: with line, column and remedy.
    pub fn from_text(path: &Path, text: &str) -> Result<Self, FileError> {
        Self::from_document(&Document::new(path, text))
    }

    fn from_document(document: &Document) -> Result<Self, FileError> {
        let top = document.parse()?;
        top.only(&["effect", "parameters"])?;
        let section = top.required_section("effect")?;
        section.only(EFFECT_KEYS)?;
        let parameters = top
            .required_section("parameters")?
            .named_sections()?
            .into_iter()
            .map(|(name, section)| parameter(name, &section))
            .collect::<Result<Vec<_>, _>>()?;
        let entry = entry(document, &section, &parameters)?;
        let list = |key| -> Result<Vec<String>, FileError> {
            let texts = section.texts(key)?.unwrap_or_default();
            Ok(texts.into_iter().map(|text| text.value).collect())
        };
        let valid_if = section.formula("valid_if")?;
        if let Some(formula) = &valid_if {
            check_names(document, formula, &[], &parameters)?;
        }
        Ok(Self {
            name: section.required_text("name")?.value,
            valid_if: valid_if.map(|formula| formula.value),
            about: section.required_text("about")?.value,
            entry,
            parameters,
            contains: list("contains")?,
            confused_with: list("confused_with")?,
            shown_by: section.text_or_empty("shown_by")?,
            baseline: baseline(&section)?,
            first_joint_only: section.choice("joints", r#""all" or "first""#, &ALL_OR_FIRST)?,
        })
    }
}

/// The effect in the text of a file. Messages call the text `effect`; [`Effect::from_text`] names the file.
impl FromStr for Effect {
    type Err = FileError;

    fn from_str(text: &str) -> Result<Self, FileError> {
        Self::from_text("effect".as_ref(), text)
    }
}

/// The rank of a baseline effect.
fn baseline(section: &Section<'_>) -> Result<Option<usize>, FileError> {
    match section.whole("baseline")? {
        Some(0) => Err(section.error_at(
            "baseline",
            "`baseline` must be a rank of at least 1; leave it out for an effect that few machines have",
        )),
        rank => Ok(rank),
    }
}

fn entry(
    document: &Document,
    section: &Section<'_>,
    parameters: &[EffectParameter],
) -> Result<Entry, FileError> {
    type Make = fn(Formula) -> Entry;
    let kinds: [(&str, Make, &[&str]); 7] = [
        ("force", Entry::Force, &EFFECT_NAMES),
        ("torque", Entry::Torque, &EFFECT_NAMES),
        ("angle", Entry::Angle, &EFFECT_NAMES),
        ("inertia", Entry::Inertia, &EFFECT_NAMES),
        ("reading", Entry::Reading, &EFFECT_NAMES),
        ("coupling", Entry::Coupling, &COUPLING_NAMES),
        ("payload", Entry::Payload, &[]),
    ];
    let mut found = command(section, parameters)?;
    for (key, make, names) in kinds {
        if let Some(formula) = section.formula(key)? {
            if found.is_some() {
                return Err(section.error_at(key, format!("an effect has {ONE_WAY}")));
            }
            check_names(document, &formula, names, parameters)?;
            let needed: &[&str] = match key {
                "coupling" => &[RATIO],
                "payload" => &PLACE,
                _ => &[],
            };
            check_has(section, key, needed, parameters)?;
            found = Some(make(formula.value));
        }
    }
    found.ok_or_else(|| section.error(format!("{ONE_WAY} is missing in [effect]")))
}

/// Parameters that a kind of effect needs by name: the share of the next joint, the position of a load.
fn check_has(
    section: &Section<'_>,
    key: &str,
    needed: &[&str],
    parameters: &[EffectParameter],
) -> Result<(), FileError> {
    let has = |name: &&&str| parameters.iter().any(|p| p.name == **name);
    match needed.iter().find(|name| !has(name)) {
        None => Ok(()),
        Some(name) => Err(section.error_at(key, format!("`{key}` needs a parameter `{name}`"))),
    }
}

/// `command = "delay"` or `"lag"`, with the time as the only parameter.
fn command(
    section: &Section<'_>,
    parameters: &[EffectParameter],
) -> Result<Option<Entry>, FileError> {
    let Some(filter) = section.choice("command", r#""delay" or "lag""#, &FILTERS)? else {
        return Ok(None);
    };
    match parameters {
        [time] if time.unit == "s" && time.bounds[0] >= 0.0 && !time.whole => {
            Ok(Some(Entry::Command(filter)))
        }
        _ => Err(section.error_at(
            "command",
            "a filter of the command has one parameter, with `unit = \"s\"` and `positive = true`",
        )),
    }
}

/// A formula may mention the parameters and these `names`.
fn check_names(
    document: &Document,
    formula: &Located<Formula>,
    names: &[&str],
    parameters: &[EffectParameter],
) -> Result<(), FileError> {
    let parameters = parameters.iter().map(|p| p.name.as_str());
    let mut graph = Graph::new();
    let scope = Scope::of_inputs(&mut graph, names.iter().copied().chain(parameters));
    let lowered = scope.lower(&mut graph, &formula.value);
    lowered
        .map(|_| ())
        .map_err(|error| document.formula_error(formula.at, &error))
}

fn parameter(name: String, section: &Section<'_>) -> Result<EffectParameter, FileError> {
    section.only(PARAMETER_KEYS)?;
    let typical = section.required_number("typical")?;
    if typical <= 0.0 {
        return Err(section.error_at(
            "typical",
            "`typical` must be a magnitude: a number above zero",
        ));
    }
    let starts = match section.numbers("search")? {
        Some(values) if values.is_empty() => {
            return Err(section.error_at("search", "`search` is empty"));
        }
        Some(values) => values,
        None => vec![section.number("start")?.unwrap_or(0.0)],
    };
    Ok(EffectParameter {
        name,
        unit: section.required_text("unit")?.value,
        about: section.text_or_empty("about")?,
        typical,
        bounds: section.bounds()?,
        starts,
        measure: section.choice("relative_to", r#""speed" or "torque""#, &MEASURES)?,
        whole: section.flag("whole")?,
        per_log: section.choice("per", PER_LOG, &[("", false), ("log", true)])?,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::model::Effect;

    #[test]
    fn a_baseline_is_a_rank_from_one_on() {
        let read = |rank: &str| {
            let text = format!(
                "[effect]\nname = \"drag\"\nabout = \"drag\"\nforce = \"-c * qd\"\n{rank}\n\
                 [parameters]\nc = {{ unit = \"N m s/rad\", typical = 1 }}\n"
            );
            Effect::from_text(Path::new("drag.toml"), &text)
        };
        assert_eq!(read("").unwrap().baseline, None);
        assert_eq!(read("baseline = 2").unwrap().baseline, Some(2));
        for wrong in ["baseline = 0", "baseline = 1.5", "baseline = true"] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains("baseline"), "{error}");
        }
    }
}

use std::path::Path;

use super::filter::CommandFilter;
use super::reader::{Document, FileError, Located, Section};
use crate::expr::{Formula, Graph, Scope, SignForm};

/// How an effect enters the equations of its joint. Formulas speak of `q`, `qd`, `tau`, `load`, `t` of
/// that joint and of the effect's parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// Added to the generalised force, and so passed through the mass matrix.
    Force(Formula),
    /// What becomes of the commanded torque.
    Torque(Formula),
    /// What stands for the joint's angle in the declared equations.
    Angle(Formula),
    /// Added to the joint's own entry of the mass matrix.
    Inertia(Formula),
    /// Added to the declared parameter of this number.
    Shift(usize, Formula),
    /// A filter of the commanded torque, ahead of everything else that becomes of it.
    Command(CommandFilter),
    /// What the sensor shows for the joint's angle.
    Reading(Formula),
}

impl Entry {
    /// What the effect file says; a filter has no formula.
    pub fn formula(&self) -> Option<&Formula> {
        match self {
            Self::Force(f)
            | Self::Torque(f)
            | Self::Angle(f)
            | Self::Inertia(f)
            | Self::Shift(_, f)
            | Self::Reading(f) => Some(f),
            Self::Command(_) => None,
        }
    }

    /// Whether the effect cannot be seen on a joint without torque.
    pub fn needs_torque(&self) -> bool {
        self.formula().is_none_or(|formula| {
            let mut names = formula.names().into_iter();
            names.any(|name| ["tau", "load"].contains(&name))
        })
    }
}

/// What a parameter's bounds and starting values are multiples of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Itself, in the parameter's own unit.
    One,
    /// The highest speed of the joint in the logs.
    Speed,
    /// The highest torque of the joint in the logs.
    Torque,
}

/// A parameter of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectParameter {
    pub name: String,
    pub unit: String,
    pub about: String,
    /// Usual magnitude on a rig for the lab bench.
    pub typical: f64,
    /// Admissible range, in `measure`.
    pub bounds: [f64; 2],
    /// Values from which a fit starts, in `measure`. One value: zero or whatever leaves the rig as it is.
    pub starts: Vec<f64>,
    /// What bounds and starting values are multiples of.
    pub measure: Measure,
    /// Only whole numbers make sense: searched, never refined.
    pub whole: bool,
    /// Has a value of its own in each log.
    pub per_log: bool,
}

impl Effect {
    /// The same effect with bounds and starting values in the parameters' own units, for a joint of which the
    /// logs show this top speed and top torque.
    #[must_use]
    pub fn measured_by(&self, top_speed: f64, top_torque: f64) -> Self {
        let mut effect = self.clone();
        for parameter in &mut effect.parameters {
            let unit = match std::mem::replace(&mut parameter.measure, Measure::One) {
                Measure::One => 1.0,
                Measure::Speed => top_speed,
                Measure::Torque => top_torque,
            };
            let multiples = parameter.bounds.iter_mut().chain(&mut parameter.starts);
            multiples.for_each(|value| *value *= unit);
        }
        effect
    }
}

impl Effect {
    /// What the effect does, in the names of its file.
    pub fn text(&self) -> String {
        match &self.entry {
            Entry::Command(filter) => filter.expression("tau", &self.parameters[0].name),
            Entry::Force(f)
            | Entry::Torque(f)
            | Entry::Angle(f)
            | Entry::Inertia(f)
            | Entry::Shift(_, f)
            | Entry::Reading(f) => f.text().to_owned(),
        }
    }

    /// Whether these values of the parameters, in their order, make sense together.
    pub fn is_valid(&self, values: &[f64]) -> bool {
        let condition = |formula| self.evaluate(formula, values, 0.0) > 0.0;
        self.valid_if.as_ref().is_none_or(condition)
    }

    /// A formula in numbers, for a joint that rests at an angle.
    fn evaluate(&self, formula: &Formula, values: &[f64], angle: f64) -> f64 {
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        let of_joint = EFFECT_NAMES.map(|name| (name, if name == "q" { angle } else { 0.0 }));
        let names = self.parameters.iter().map(|p| p.name.as_str());
        for (name, value) in of_joint
            .into_iter()
            .chain(names.zip(values.iter().copied()))
        {
            let node = graph.constant(value);
            scope.bind(name, node);
        }
        let node = scope
            .lower(&mut graph, formula)
            .expect("formulas were checked when the file was read");
        graph.finish(&[node]).eval(&[])[0]
    }

    /// What the sensor reads, by an effect of the sensor with these values, where the joint rests at `angle`.
    pub fn reading(&self, values: &[f64], angle: f64) -> f64 {
        let Entry::Angle(formula) = &self.entry else {
            return angle;
        };
        let step = |read: f64| read + angle - self.evaluate(formula, values, read);
        // One step is exact for an offset; a scale that is off by a tenth gains a digit a step.
        (0..16).fold(angle, |read, _| step(read))
    }
}

impl Effect {
    /// Whether the effect is one of how a joint's angle is read, not of the rig: a rig does not change from log
    /// to log.
    pub fn is_of_sensor(&self) -> bool {
        matches!(self.entry, Entry::Angle(_)) && self.parameters.iter().all(|p| p.per_log)
    }
}

impl EffectParameter {
    /// Whether the parameter at zero leaves the rig as it is.
    pub fn is_switch(&self) -> bool {
        self.starts == [0.0]
    }
}

/// A physical effect that a model may lack: one file of `models/effects`.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    pub name: String,
    pub about: String,
    pub entry: Entry,
    pub parameters: Vec<EffectParameter>,
    /// What must be positive of the parameters, where not every combination makes sense.
    pub valid_if: Option<Formula>,
    /// Simpler effects that this one becomes for special values of its parameters.
    pub contains: Vec<String>,
    pub confused_with: Vec<String>,
    /// The motion that shows the effect.
    pub shown_by: String,
    /// Acts only where gravity's direction enters: on the first joint of a chain.
    pub first_joint_only: bool,
}

const EFFECT_KEYS: &[&str] = &[
    "name",
    "about",
    "force",
    "torque",
    "angle",
    "inertia",
    "command",
    "reading",
    "contains",
    "confused_with",
    "shown_by",
    "joints",
    "valid_if",
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
/// What a formula of an effect may mention besides its parameters.
pub const EFFECT_NAMES: [&str; 5] = ["q", "qd", "tau", "load", "t"];

impl Effect {
    /// Read one effect file.
    ///
    /// # Errors
    /// Unreadable file, unknown or missing key, formula error: with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::from_document(&Document::open(path)?)
    }

    /// The effect in `text`; `path` is for messages.
    ///
    /// # Errors
    /// As [`Effect::read`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, FileError> {
        Self::from_document(&Document {
            path: path.to_owned(),
            text: text.to_owned(),
        })
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
            first_joint_only: first_joint_only(&section)?,
        })
    }
}

fn first_joint_only(section: &Section<'_>) -> Result<bool, FileError> {
    match section.text_or_empty("joints")?.as_str() {
        "" | "all" => Ok(false),
        "first" => Ok(true),
        other => Err(section.error_at(
            "joints",
            format!("`joints` is \"all\" or \"first\", found {other:?}"),
        )),
    }
}

fn entry(
    document: &Document,
    section: &Section<'_>,
    parameters: &[EffectParameter],
) -> Result<Entry, FileError> {
    type Make = fn(Formula) -> Entry;
    let kinds: [(&str, Make); 5] = [
        ("force", Entry::Force),
        ("torque", Entry::Torque),
        ("angle", Entry::Angle),
        ("inertia", Entry::Inertia),
        ("reading", Entry::Reading),
    ];
    let mut found = command(section, parameters)?;
    for (key, make) in kinds {
        if let Some(formula) = section.formula(key)? {
            if found.is_some() {
                return Err(section.error_at(
                    key,
                    "an effect has one of force, torque, angle, inertia, command and reading",
                ));
            }
            check_names(document, &formula, &EFFECT_NAMES, parameters)?;
            found = Some(make(formula.value));
        }
    }
    found.ok_or_else(|| {
        section.error(
            "one of force, torque, angle, inertia, command and reading is missing in [effect]",
        )
    })
}

/// `command = "delay"` or `"lag"`, with the time as the only parameter.
fn command(
    section: &Section<'_>,
    parameters: &[EffectParameter],
) -> Result<Option<Entry>, FileError> {
    let filter = match section.text("command")?.map(|text| text.value).as_deref() {
        None => return Ok(None),
        Some("delay") => CommandFilter::Delay,
        Some("lag") => CommandFilter::Lag,
        Some(other) => {
            let message = format!("`command` is \"delay\" or \"lag\", found {other:?}");
            return Err(section.error_at("command", message));
        }
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
    let mut graph = Graph::new();
    let mut scope = Scope::new(SignForm::Exact);
    let parameters = parameters.iter().map(|p| p.name.as_str());
    for name in names.iter().copied().chain(parameters) {
        let node = graph.input(name);
        scope.bind(name, node);
    }
    match scope.lower(&mut graph, &formula.value) {
        Ok(_) => Ok(()),
        Err(error) => Err(document.formula_error(formula.at, &error)),
    }
}

fn parameter(name: String, section: &Section<'_>) -> Result<EffectParameter, FileError> {
    section.only(PARAMETER_KEYS)?;
    let typical = section.required_number("typical")?;
    if typical <= 0.0 {
        return Err(section.error_at("typical", "`typical` is a magnitude: a number above zero"));
    }
    let starts = match section.numbers("search")? {
        Some(values) if values.is_empty() => {
            return Err(section.error_at("search", "`search` is empty"));
        }
        Some(values) => values,
        None => vec![section.number("start")?.unwrap_or(0.0)],
    };
    let measure = match section.text_or_empty("relative_to")?.as_str() {
        "" => Measure::One,
        "speed" => Measure::Speed,
        "torque" => Measure::Torque,
        other => {
            let message = format!("`relative_to` is \"speed\" or \"torque\", found {other:?}");
            return Err(section.error_at("relative_to", message));
        }
    };
    Ok(EffectParameter {
        name,
        unit: section.required_text("unit")?.value,
        about: section.text_or_empty("about")?,
        typical,
        bounds: bounds(section)?,
        starts,
        measure,
        whole: section.flag("whole")?,
        per_log: per_log(section)?,
    })
}

fn per_log(section: &Section<'_>) -> Result<bool, FileError> {
    match section.text_or_empty("per")?.as_str() {
        "" => Ok(false),
        "log" => Ok(true),
        other => Err(section.error_at(
            "per",
            format!(
                "`per` is \"log\" for a parameter with a value of its own in each log, found {other:?}"
            ),
        )),
    }
}

/// The admissible range that `positive` and `bounds` declare.
pub(super) fn bounds(section: &Section<'_>) -> Result<[f64; 2], FileError> {
    let lowest = if section.flag("positive")? {
        0.0
    } else {
        f64::NEG_INFINITY
    };
    match section.numbers("bounds")?.as_deref() {
        None => Ok([lowest, f64::INFINITY]),
        Some(&[low, high]) if low < high => Ok([low.max(lowest), high]),
        Some(_) => Err(section.error_at(
            "bounds",
            "`bounds` is a list of two rising numbers, such as [0, 2]",
        )),
    }
}

//! The file of an effect.

use std::path::Path;
use std::str::FromStr;

use super::effect::{EFFECT_NAMES, Effect, EffectParameter, Entry, Hold, Measure};
use super::internal_state::InternalState;
use super::reader::{Document, FileError, Located, Section};
use super::sections;
use super::tables::{EffectFile, EffectParameterTable, EffectTable, InternalStateTable};
use super::values::Named;
use crate::data::is_measured;
use crate::expr::{Formula, parse};

const ONE_WAY: &str = "one of force, torque, angle, inertia, friction, command, reading, coupling, payload and transmission";

impl Effect {
    /// The effect in `text`; `path` is for messages.
    ///
    /// # Errors
    /// Unknown or missing key, formula error: with line, column and remedy.
    pub fn from_text(path: &Path, text: &str) -> Result<Self, FileError> {
        let document = Document::new(path, text);
        let EffectFile {
            effect: mut table,
            states: Named(states),
            parameters: Named(parameters),
            section,
        } = EffectFile::of(document.parse()?)?;
        section.read::<Section<'_>>("parameters")?;
        let parameters = parameters.into_iter().map(parameter);
        let parameters = parameters.collect::<Result<Vec<_>, _>>()?;
        let names_of_states: Vec<&str> = states.iter().map(|(name, _)| name.as_str()).collect();
        let entry = entry(&mut table, &parameters, &names_of_states)?;
        let mut states = internal_states(states, &entry, &parameters)?;
        let free_within = free_within(&mut table, &entry, &parameters)?;
        if let Entry::Transmission(_) = entry {
            states = InternalState::of_transmission(free_within).to_vec();
        }
        if let Some(condition) = &table.valid_if {
            (table.section).check_names("valid_if", &condition.value, names(&parameters))?;
        }
        if table.baseline == Some(0) {
            let message = "`baseline` must be a rank of at least 1; leave it out for an effect that few machines have";
            return Err(table.section.error_at("baseline", message));
        }
        Ok(Self {
            name: table.name,
            valid_if: table.valid_if.map(|condition| condition.value),
            about: table.about,
            entry,
            parameters,
            states,
            contains: table.contains,
            refines: table.refines,
            confused_with: table.confused_with,
            shown_by: table.shown_by.unwrap_or_default(),
            baseline: table.baseline,
            acts_on: table.joints.unwrap_or_default(),
            shows_in: table.shows_in.unwrap_or_default(),
            alike_on: table.alike_on.unwrap_or_default(),
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

/// The one way in which the effect enters the equations; its formula is taken from the table.
fn entry(
    table: &mut EffectTable<'_>,
    parameters: &[EffectParameter],
    states: &[&str],
) -> Result<Entry, FileError> {
    type Make = fn(Formula) -> Entry;
    let formulas: [(&str, Option<Located<Formula>>, Make); 9] = [
        ("force", table.force.take(), Entry::Force),
        ("torque", table.torque.take(), Entry::Torque),
        ("angle", table.angle.take(), Entry::Angle),
        ("inertia", table.inertia.take(), Entry::Inertia),
        ("friction", table.friction.take(), Entry::Friction),
        ("reading", table.reading.take(), Entry::Reading),
        ("coupling", table.coupling.take(), Entry::Coupling),
        ("payload", table.payload.take(), Entry::Payload),
        (
            "transmission",
            table.transmission.take(),
            Entry::Transmission,
        ),
    ];
    let section = &table.section;
    let filter = table.command.map(|kind| ("command", Entry::Command(kind)));
    let formulas = formulas
        .into_iter()
        .filter_map(|(key, formula, make)| Some((key, make(formula?.value))));
    let mut ways = filter.into_iter().chain(formulas);
    let Some((key, entry)) = ways.next() else {
        return Err(section.error(format!("{ONE_WAY} is missing in [effect]")));
    };
    if let Some((second, _)) = ways.next() {
        return Err(section.error_at(second, format!("an effect has {ONE_WAY}")));
    }
    if let Some(formula) = entry.formula() {
        let measured = formula.names().into_iter();
        let measured = measured.filter(|name| is_measured(name) && entry.may_be_measured());
        let known = entry.names().iter().chain(states).copied();
        let known = known.chain(names(parameters));
        section.check_names(key, formula, known.chain(measured))?;
    } else if !is_one_time(parameters) {
        let message =
            "a filter of the command has one parameter, with `unit = \"s\"` and `positive = true`";
        return Err(section.error_at(key, message));
    }
    let is_missing = |name: &&&str| !names(parameters).any(|own| own == **name);
    match entry.needed().iter().find(is_missing) {
        None => Ok(entry),
        Some(name) => Err(section.error_at(key, format!("`{key}` needs a parameter `{name}`"))),
    }
}

/// The range of a transmission's twist in which nothing passes.
fn free_within(
    table: &mut EffectTable<'_>,
    entry: &Entry,
    parameters: &[EffectParameter],
) -> Result<Option<[Formula; 2]>, FileError> {
    let Some(ends) = table.free_within.take() else {
        return Ok(None);
    };
    let section = &table.section;
    if !matches!(entry, Entry::Transmission(_)) {
        let message = "`free_within` is the play of a transmission, in which nothing passes: it goes with `transmission`";
        return Err(section.error_at("free_within", message));
    }
    for end in &ends {
        section.check_names("free_within", &end.value, names(parameters))?;
    }
    Ok(Some(ends.map(|end| end.value)))
}

/// The effect's own states, each with formulas in names that exist.
fn internal_states(
    tables: Vec<(String, InternalStateTable<'_>)>,
    entry: &Entry,
    parameters: &[EffectParameter],
) -> Result<Vec<InternalState>, FileError> {
    let mut known: Vec<String> = EFFECT_NAMES.map(str::to_owned).to_vec();
    known.extend(names(parameters).map(str::to_owned));
    for (name, table) in &tables {
        if tables.len() > 2 {
            return Err(table.section.error("an effect has at most two states"));
        }
        if !entry.may_have_states() {
            let message = "only an effect with force, torque, friction or reading has states";
            return Err(table.section.error(message));
        }
        if !parse(name).is_ok_and(|formula| formula.is_name(name)) || known.contains(name) {
            let message = format!("a state cannot have the name `{name}`; choose another");
            return Err(table.section.error(message));
        }
        known.push(name.clone());
    }
    let state = |(name, table): (String, InternalStateTable<'_>)| {
        let check = |key: &str, formula: &Formula| {
            let measured = formula.names().into_iter().filter(|name| is_measured(name));
            let names = known.iter().map(String::as_str).chain(measured);
            table.section.check_names(key, formula, names)
        };
        check("rate", &table.rate.value)?;
        let ends = table.within.iter().flatten();
        ends.clone()
            .try_for_each(|end| check("within", &end.value))?;
        if let Some(start) = &table.start {
            (table.section).check_names("start", &start.value, names(parameters))?;
        }
        Ok(InternalState {
            name,
            unit: table.unit,
            about: table.about.unwrap_or_default(),
            rate: Some(table.rate.value),
            start: table.start.map(|start| start.value),
            within: table.within.map(|ends| ends.map(|end| end.value)),
        })
    };
    tables.into_iter().map(state).collect()
}

fn names(parameters: &[EffectParameter]) -> impl Iterator<Item = &str> {
    parameters.iter().map(|parameter| parameter.name.as_str())
}

fn is_one_time(parameters: &[EffectParameter]) -> bool {
    matches!(parameters, [time] if time.unit == "s" && time.bounds[0] >= 0.0 && !time.whole)
}

fn parameter(
    (name, table): (String, EffectParameterTable<'_>),
) -> Result<EffectParameter, FileError> {
    if table.typical <= 0.0 {
        let message = "`typical` must be a magnitude: a number above zero";
        return Err(table.section.error_at("typical", message));
    }
    if table.search.as_ref().is_some_and(Vec::is_empty) {
        return Err(table.section.error_at("search", "`search` is empty"));
    }
    Ok(EffectParameter {
        name,
        bounds: sections::bounds(&table.section, table.positive, table.bounds)?,
        unit: table.unit,
        about: table.about.unwrap_or_default(),
        typical: table.typical,
        starts: table
            .search
            .unwrap_or_else(|| vec![table.start.unwrap_or(0.0)]),
        measure: table.relative_to.unwrap_or(Measure::One),
        whole: table.whole,
        per_log: table.per.is_some(),
        hold: match table.held_if_unknown {
            true => Hold::IfUnknown,
            false => Hold::Never,
        },
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

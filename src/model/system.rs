use std::path::Path;

use super::Parameter;
use super::effect::{Effect, Entry, Measure};
use super::reader::{Document, FileError, Located, Section};
use crate::data::Columns;
use crate::expr::{Formula, Graph, Node, Scope, SignForm};

/// How a model file states the motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Motion {
    /// qdd = ..., one formula a joint.
    Accelerations(Vec<Located<Formula>>),
    /// mass(q) qdd + bias(q, qd) = tau.
    MassAndBias {
        mass: Vec<Vec<Located<Formula>>>,
        bias: Vec<Located<Formula>>,
    },
}

/// The balance of energy and work: d(total)/dt = power along every motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Energy {
    pub total: Located<Formula>,
    pub power: Located<Formula>,
}

/// An effect that a model file already carries.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedEffect {
    pub effect: Effect,
    /// Counted from 0.
    pub joint: usize,
    /// One for each of the effect's parameters: value and 95 % interval.
    pub values: Vec<(f64, Option<[f64; 2]>)>,
    /// Held at the values given.
    pub fixed: bool,
}

/// A declared model: what a model file says, checked.
#[derive(Debug, Clone)]
pub struct System {
    pub name: String,
    pub about: String,
    pub joints: usize,
    /// For each joint whether it slides (m, N) rather than turns (rad, N m).
    pub prismatic: Vec<bool>,
    /// For each joint the speed (rad/s or m/s) over which dry friction reverses; where the file gives none,
    /// fits choose it by the speeds in the logs.
    pub sign_width: Option<Vec<f64>>,
    pub columns: Columns,
    pub parameters: Vec<Parameter>,
    pub effects: Vec<FittedEffect>,
    /// Widths of the hidden layers of the residual MLP.
    pub hidden: Vec<usize>,
    /// The text of the declared part of the file: everything before the first effect.
    pub declaration: String,
    pub(super) lets: Vec<(String, Located<Formula>)>,
    pub(super) motion: Motion,
    pub(super) energy: Option<Energy>,
}

const SYSTEM_KEYS: &[&str] = &["name", "about", "joints", "prismatic", "sign_width"];
const PARAMETER_KEYS: &[&str] = &[
    "value", "unit", "about", "positive", "bounds", "fixed", "ci95",
];
/// Enough for every serial arm; a limit catches slips such as `joints = 100`.
const MOST_JOINTS: usize = 12;

impl System {
    /// Read a model file. `library` is where its `[[effect]]` entries are looked up.
    ///
    /// # Errors
    /// Unreadable file, unknown or missing key, formula error, unknown effect: with line, column and remedy.
    pub fn read(path: &Path, library: &[Effect]) -> Result<Self, FileError> {
        Self::from_document(&Document::open(path)?, library)
    }

    /// The model in `text`; `path` is for messages.
    ///
    /// # Errors
    /// As [`System::read`].
    pub fn from_text(path: &Path, text: &str, library: &[Effect]) -> Result<Self, FileError> {
        let document = Document {
            path: path.to_owned(),
            text: text.to_owned(),
        };
        Self::from_document(&document, library)
    }

    fn from_document(document: &Document, library: &[Effect]) -> Result<Self, FileError> {
        let top = document.parse()?;
        top.only(&[
            "system",
            "columns",
            "parameters",
            "dynamics",
            "energy",
            "residual",
            "effect",
        ])?;
        let section = top.required_section("system")?;
        section.only(SYSTEM_KEYS)?;
        let joints = joints(&section)?;
        let dynamics = top.required_section("dynamics")?;
        let system = Self {
            name: section.required_text("name")?.value,
            about: section.text_or_empty("about")?,
            joints,
            prismatic: prismatic(&section, joints)?,
            sign_width: sign_width(&section, joints)?,
            columns: columns(top.section("columns")?, joints)?,
            parameters: parameters(top.section("parameters")?)?,
            effects: super::effects_in_file::read(&top, joints, library)?,
            hidden: hidden(top.section("residual")?, joints)?,
            declaration: declaration(&document.text),
            lets: lets(document, &dynamics)?,
            motion: motion(document, &dynamics, joints)?,
            energy: energy(top.section("energy")?)?,
        };
        system.check_names(&top)?;
        system.check_formulas(document)?;
        for (k, section) in top.sections("effect")?.iter().enumerate() {
            let (present, rest) = system.effects.split_at(k);
            let check = system.check_effect(&rest[0], present);
            check.map_err(|message| section.error(message))?;
        }
        Ok(system)
    }

    /// Parameters and intermediates must not take the names of states, torques or each other.
    fn check_names(&self, top: &Section<'_>) -> Result<(), FileError> {
        let mut taken: Vec<String> = self.input_names();
        taken.truncate(3 * self.joints + 1);
        let parameters = self.parameters.iter().map(|p| ("parameters", &p.name));
        let lets = self.lets.iter().map(|(name, _)| ("dynamics", name));
        for (section, name) in parameters.chain(lets) {
            if taken.contains(name) {
                let section = top.required_section(section)?;
                return Err(
                    section.error_at(name, format!("the name `{name}` is taken; choose another"))
                );
            }
            taken.push(name.clone());
        }
        Ok(())
    }

    /// Names that effects must not take: of parameters and of intermediates.
    pub(super) fn own_names(&self) -> impl Iterator<Item = &str> {
        let lets = self.lets.iter().map(|(name, _)| name.as_str());
        self.parameters.iter().map(|p| p.name.as_str()).chain(lets)
    }

    /// Lower every formula once, so that a wrong name is met here, with its place.
    fn check_formulas(&self, document: &Document) -> Result<(), FileError> {
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        for name in self.input_names() {
            let node = graph.input(&name);
            scope.bind(&name, node);
        }
        let mut lower = |scope: &Scope, formula: &Located<Formula>| {
            scope
                .lower(&mut graph, &formula.value)
                .map_err(|error| document.formula_error(formula.at, &error))
        };
        for (name, formula) in &self.lets {
            let node = lower(&scope, formula)?;
            scope.bind(name, node);
        }
        let energy = self
            .energy
            .iter()
            .flat_map(|energy| [&energy.total, &energy.power]);
        for formula in self.motion.formulas().chain(energy) {
            lower(&scope, formula)?;
        }
        Ok(())
    }

    /// The names that formulas may use before any `let`: states, torques, time, parameters.
    pub fn input_names(&self) -> Vec<String> {
        let numbered = |stem: &str| {
            (1..=self.joints)
                .map(move |j| format!("{stem}{j}"))
                .collect::<Vec<_>>()
        };
        let mut names = [numbered("q"), numbered("qd"), numbered("tau")].concat();
        names.push("t".into());
        names.extend(self.parameters.iter().map(|p| p.name.clone()));
        names
    }

    /// How dry friction is written in each joint: as the file says, else in the default width.
    pub fn sign(&self) -> Vec<SignForm> {
        let width = |width: &f64| SignForm::Smooth { width: *width };
        let given = self.sign_width.as_ref();
        given.map_or(vec![SignForm::DEFAULT; self.joints], |widths| {
            widths.iter().map(width).collect()
        })
    }

    /// Whether an effect can act on a joint (counted from 0) of this system.
    ///
    /// # Errors
    /// Why not.
    pub fn can_carry(&self, effect: &Effect, joint: usize) -> Result<(), String> {
        let name = &effect.name;
        if effect.first_joint_only && (joint > 0 || self.prismatic[joint]) {
            return Err(format!(
                "`{name}` acts on the first joint, where that turns"
            ));
        }
        match effect.entry {
            Entry::Inertia(_) if !self.has_mass_matrix() => Err(format!(
                "`{name}` needs a model that gives `mass` and `bias`; {} gives accelerations",
                self.name
            )),
            _ => Ok(()),
        }
    }

    /// Whether an effect with its values can join `present` ones.
    ///
    /// # Errors
    /// Why not: see [`System::can_carry`], a value outside of its bounds, or the same effect twice.
    pub fn check_effect(&self, new: &FittedEffect, present: &[FittedEffect]) -> Result<(), String> {
        let name = &new.effect.name;
        self.can_carry(&new.effect, new.joint)?;
        if present
            .iter()
            .any(|old| old.joint == new.joint && old.effect.name == *name)
        {
            return Err(format!("`{name}` acts on joint {} already", new.joint + 1));
        }
        for (parameter, (value, _)) in new.effect.parameters.iter().zip(&new.values) {
            let [low, high] = parameter.bounds;
            // Bounds that are multiples of what logs show cannot be checked before there are logs.
            if parameter.measure == Measure::One && !(low..=high).contains(value) {
                return Err(format!(
                    "`{name}`: {} = {value} lies outside of {low} to {high}",
                    parameter.name
                ));
            }
        }
        Ok(())
    }

    /// Whether the file gives mass matrix and bias, which effects of the inertia need.
    pub fn has_mass_matrix(&self) -> bool {
        matches!(self.motion, Motion::MassAndBias { .. })
    }

    /// Total energy and the power of the torques as a program of [`System::input_names`], where the file
    /// states them: `[total, power, d total/dq.., d total/dqd..]`.
    pub fn energy_program(&self) -> Option<crate::expr::Program> {
        let energy = self.energy.as_ref()?;
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        let inputs: Vec<Node> = self
            .input_names()
            .iter()
            .map(|name| graph.input(name))
            .collect();
        for (name, node) in self.input_names().iter().zip(&inputs) {
            scope.bind(name, *node);
        }
        let mut lower = |scope: &Scope, formula: &Located<Formula>| {
            scope
                .lower(&mut graph, &formula.value)
                .expect("formulas were checked when the file was read")
        };
        for (name, formula) in &self.lets {
            let node = lower(&scope, formula);
            scope.bind(name, node);
        }
        let (total, power) = (lower(&scope, &energy.total), lower(&scope, &energy.power));
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[total], &[one], &inputs[..2 * self.joints]);
        Some(graph.finish(&[&[total, power], slopes.as_slice()].concat()))
    }
}

impl Motion {
    fn formulas(&self) -> Box<dyn Iterator<Item = &Located<Formula>> + '_> {
        match self {
            Self::Accelerations(formulas) => Box::new(formulas.iter()),
            Self::MassAndBias { mass, bias } => Box::new(mass.iter().flatten().chain(bias)),
        }
    }
}

fn joints(section: &Section<'_>) -> Result<usize, FileError> {
    match section.whole("joints")? {
        Some(joints @ 1..=MOST_JOINTS) => Ok(joints),
        Some(joints) => {
            let message = format!("`joints` is from 1 to {MOST_JOINTS}, found {joints}");
            Err(section.error_at("joints", message))
        }
        None => Err(section.error("`joints` is missing in [system]; give their number")),
    }
}

/// `prismatic = [1]` lists the joints that slide.
fn prismatic(section: &Section<'_>, joints: usize) -> Result<Vec<bool>, FileError> {
    let listed = section.numbers("prismatic")?.unwrap_or_default();
    let numbers: Vec<f64> = (1..=joints).map(|j| j as f64).collect();
    if let Some(stranger) = listed.iter().find(|j| !numbers.contains(j)) {
        let message = format!("`prismatic` lists joints from 1 to {joints}, found {stranger}");
        return Err(section.error_at("prismatic", message));
    }
    Ok(numbers.iter().map(|j| listed.contains(j)).collect())
}

/// One width above zero a joint.
fn sign_width(section: &Section<'_>, joints: usize) -> Result<Option<Vec<f64>>, FileError> {
    let widths = section.numbers("sign_width")?;
    match &widths {
        Some(widths) if widths.len() != joints || widths.iter().any(|w| *w <= 0.0) => {
            let message =
                format!("`sign_width` is a list of {joints} speeds above zero, one a joint");
            Err(section.error_at("sign_width", message))
        }
        _ => Ok(widths),
    }
}

fn columns(section: Option<Section<'_>>, joints: usize) -> Result<Columns, FileError> {
    let mut columns = Columns::standard(joints);
    let Some(section) = section else {
        return Ok(columns);
    };
    section.only(&["time", "q", "qd", "tau"])?;
    if let Some(time) = section.text("time")? {
        columns.time = time.value;
    }
    for (key, names) in [
        ("q", &mut columns.q),
        ("qd", &mut columns.qd),
        ("tau", &mut columns.tau),
    ] {
        let Some(given) = section.texts(key)? else {
            continue;
        };
        if given.len() != joints {
            let message = format!(
                "`{key}` needs one column a joint: {joints}, found {}",
                given.len()
            );
            return Err(section.error_at(key, message));
        }
        *names = given.into_iter().map(|text| text.value).collect();
    }
    Ok(columns)
}

fn parameters(section: Option<Section<'_>>) -> Result<Vec<Parameter>, FileError> {
    let Some(section) = section else {
        return Ok(Vec::new());
    };
    section
        .named_sections()?
        .into_iter()
        .map(|(name, section)| parameter(name, &section))
        .collect()
}

fn parameter(name: String, section: &Section<'_>) -> Result<Parameter, FileError> {
    section.only(PARAMETER_KEYS)?;
    let value = section.required_number("value")?;
    let bounds = super::effect::bounds(section)?;
    if !(bounds[0]..=bounds[1]).contains(&value) {
        let message = format!(
            "`value` {value} lies outside of its bounds {} to {}",
            bounds[0], bounds[1]
        );
        return Err(section.error_at("value", message));
    }
    Ok(Parameter {
        name,
        value,
        unit: section.text_or_empty("unit")?,
        bounds,
        fixed: section.flag("fixed")?,
        ci95: interval(section, "ci95")?,
        scale: if value == 0.0 { 1.0 } else { value.abs() },
    })
}

/// A list of two numbers, where it is given.
pub(super) fn interval(section: &Section<'_>, key: &str) -> Result<Option<[f64; 2]>, FileError> {
    match section.numbers(key)? {
        None => Ok(None),
        Some(numbers) => match numbers[..] {
            [low, high] => Ok(Some([low, high])),
            _ => Err(section.error_at(key, format!("`{key}` is a list of two numbers"))),
        },
    }
}

/// The paper's sizes: three layers of 16 for one joint, four for more.
fn hidden(section: Option<Section<'_>>, joints: usize) -> Result<Vec<usize>, FileError> {
    let default = vec![16; if joints == 1 { 3 } else { 4 }];
    let Some(section) = section else {
        return Ok(default);
    };
    section.only(&["hidden"])?;
    let Some(numbers) = section.numbers("hidden")? else {
        return Ok(default);
    };
    let wide = |width: &f64| width.fract() == 0.0 && (1.0..=4096.0).contains(width);
    if !numbers.iter().all(wide) {
        return Err(section.error_at(
            "hidden",
            "`hidden` lists layer widths: whole numbers from 1 to 4096",
        ));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // just checked
    Ok(numbers.into_iter().map(|width| width as usize).collect())
}

fn lets(
    document: &Document,
    dynamics: &Section<'_>,
) -> Result<Vec<(String, Located<Formula>)>, FileError> {
    let Some(section) = dynamics.section("let")? else {
        return Ok(Vec::new());
    };
    section
        .named_texts()?
        .into_iter()
        .map(|(name, text)| Ok((name, document.formula(&text)?)))
        .collect()
}

fn motion(document: &Document, dynamics: &Section<'_>, joints: usize) -> Result<Motion, FileError> {
    let accelerations: Vec<String> = (1..=joints).map(|j| format!("qdd{j}")).collect();
    let mut known: Vec<&str> = vec!["let", "mass", "bias"];
    known.extend(accelerations.iter().map(String::as_str));
    dynamics.only(&known)?;
    if !dynamics.has("mass") && !dynamics.has("bias") {
        let formula = |key: &String| {
            let missing =
                || dynamics.error(format!("`{key}` is missing; give it, or `mass` and `bias`"));
            dynamics.formula(key)?.ok_or_else(missing)
        };
        return Ok(Motion::Accelerations(
            accelerations
                .iter()
                .map(formula)
                .collect::<Result<_, _>>()?,
        ));
    }
    if let Some(both) = accelerations.iter().find(|key| dynamics.has(key)) {
        return Err(dynamics.error_at(
            both,
            "give either accelerations or `mass` and `bias`, not both",
        ));
    }
    let mass = dynamics.matrix("mass")?.unwrap_or_default();
    let bias = dynamics.texts("bias")?.unwrap_or_default();
    if mass.len() != joints || mass.iter().any(|row| row.len() != joints) || bias.len() != joints {
        let message =
            format!("`mass` is {joints} rows of {joints} formulas and `bias` is {joints} formulas");
        return Err(dynamics.error_at("mass", message));
    }
    let row = |row: &Vec<Located<String>>| row.iter().map(|text| document.formula(text)).collect();
    Ok(Motion::MassAndBias {
        mass: mass.iter().map(row).collect::<Result<_, _>>()?,
        bias: bias
            .iter()
            .map(|text| document.formula(text))
            .collect::<Result<_, _>>()?,
    })
}

fn energy(section: Option<Section<'_>>) -> Result<Option<Energy>, FileError> {
    let Some(section) = section else {
        return Ok(None);
    };
    section.only(&["total", "power"])?;
    let both = section.formula("total")?.zip(section.formula("power")?);
    let (total, power) = both.ok_or_else(|| section.error("[energy] needs `total` and `power`"))?;
    Ok(Some(Energy { total, power }))
}

/// Everything before the first `[[effect]]`.
fn declaration(text: &str) -> String {
    let end = text
        .match_indices("[[effect]]")
        .map(|(at, _)| at)
        .find(|&at| {
            text[..at]
                .lines()
                .next_back()
                .is_none_or(|line| line.trim().is_empty())
                || text[..at].ends_with('\n')
        })
        .unwrap_or(text.len());
    text[..end].trim_end().to_owned() + "\n"
}

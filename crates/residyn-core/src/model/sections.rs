//! What the tables of a model file say, checked.

use std::collections::HashSet;

use toml_edit::{DocumentMut, TomlError};

use super::effect::Side;
use super::network::check_hidden;
use super::reader::{Document, FileError, Located, Section};
use super::system::Motion;
use super::tables::{ParameterTable, ResidualTable, SensorsTable, SystemTable};
use super::values::{Limits, Named, Per};
use super::{MlpSettings, Parameter};
use crate::data::Joint;
use crate::expr::Formula;
use crate::limits::JOINTS;

impl SystemTable<'_> {
    pub fn check_joints(&self) -> Result<(), FileError> {
        if (1..=JOINTS).contains(&self.joints) {
            return Ok(());
        }
        let message = format!("`joints` must be from 1 to {JOINTS}, found {}", self.joints);
        Err(self.section.error_at("joints", message))
    }

    /// One name per joint, all different; an empty list if not given.
    pub fn check_joint_names(&self) -> Result<(), FileError> {
        let (names, joints) = (&self.joint_names, self.joints);
        let distinct: HashSet<&str> = names.iter().map(|name| name.trim()).collect();
        let is_one_each = names.len() == joints && distinct.len() == joints;
        if names.is_empty() || is_one_each && !distinct.contains("") {
            return Ok(());
        }
        let message =
            format!("`joint_names` must be a list of {joints} different names, one per joint");
        Err(self.section.error_at("joint_names", message))
    }

    /// `prismatic = [1]` lists the joints that slide.
    pub fn prismatic(&self) -> Result<Vec<bool>, FileError> {
        let joints = 1..=self.joints;
        let mut listed = self.prismatic.iter();
        if let Some(stranger) = listed.find(|joint| !joints.contains(joint)) {
            let joints = self.joints;
            let message =
                format!("`prismatic` must list joints from 1 to {joints}, found {stranger}");
            return Err(self.section.error_at("prismatic", message));
        }
        Ok(joints
            .map(|joint| self.prismatic.contains(&joint))
            .collect())
    }

    /// One width per joint, above zero.
    pub fn check_smoothing_velocity(&self) -> Result<(), FileError> {
        let joints = self.joints;
        let is_one_each =
            |widths: &Vec<f64>| widths.len() == joints && widths.iter().all(|width| *width > 0.0);
        if self.smoothing_velocity.as_ref().is_none_or(is_one_each) {
            return Ok(());
        }
        let message = format!(
            "`smoothing_velocity` must be a list of {joints} speeds above zero, one per joint"
        );
        Err(self.section.error_at("smoothing_velocity", message))
    }
}

pub(super) fn parameters(
    Named(declared): Named<ParameterTable<'_>>,
) -> Result<Vec<Parameter>, FileError> {
    declared.into_iter().map(parameter).collect()
}

fn parameter((name, table): (String, ParameterTable<'_>)) -> Result<Parameter, FileError> {
    let [low, high] = bounds(&table.section, table.positive, table.bounds)?;
    let value = table.value;
    if !(low..=high).contains(&value) {
        let message = format!("`value` {value} is outside its bounds {low} to {high}");
        return Err(table.section.error_at("value", message));
    }
    let parameter = Parameter {
        name,
        value,
        unit: table.unit.unwrap_or_default(),
        bounds: [low, high],
        fixed: table.fixed,
        per_log: table.per.is_some(),
        per_group: matches!(table.per, Some(Per::Group)),
        ci95: table.ci95.map(|Limits(ends)| ends),
        scale: 1.0,
    };
    Ok(parameter.with_value(value))
}

/// The admissible range that `positive` and `bounds` declare.
pub(super) fn bounds(
    section: &Section<'_>,
    positive: bool,
    bounds: Option<Limits>,
) -> Result<[f64; 2], FileError> {
    let lowest = if positive { 0.0 } else { f64::NEG_INFINITY };
    match bounds {
        None => Ok([lowest, f64::INFINITY]),
        Some(Limits([low, high])) if low < high => Ok([low.max(lowest), high]),
        Some(_) => {
            let message = "`bounds` must be a list of two increasing numbers, such as [0, 2]";
            Err(section.error_at("bounds", message))
        }
    }
}

/// `joint = 2` of this many.
pub(super) fn joint(
    section: &Section<'_>,
    number: usize,
    joints: usize,
) -> Result<Joint, FileError> {
    let joint = Joint::numbered(number).filter(|joint| joint.is_of(joints));
    joint.ok_or_else(|| {
        let message = format!("`joint` must be a number from 1 to {joints}");
        section.error_at("joint", message)
    })
}

/// The side of its transmission on which the sensor of each joint is, if the file says.
pub(super) fn sides(
    table: Option<SensorsTable<'_>>,
    joints: usize,
) -> Result<Option<Vec<Side>>, FileError> {
    let Some(SensorsTable { angle, section }) = table else {
        return Ok(None);
    };
    if angle.len() != joints {
        let message = format!("`angle` must be a list of {joints} sides, one per joint");
        return Err(section.error_at("angle", message));
    }
    Ok(Some(angle))
}

/// Widths of the hidden layers of the residual network; the published ones if the file gives none.
pub(super) fn hidden(
    table: Option<ResidualTable<'_>>,
    joints: usize,
) -> Result<Vec<usize>, FileError> {
    let default = || MlpSettings::for_joints(joints).hidden;
    let Some(table) = table else {
        return Ok(default());
    };
    let hidden = table.hidden.unwrap_or_else(default);
    match check_hidden(&hidden) {
        Ok(()) => Ok(hidden),
        Err(message) => Err(table.section.error_at("hidden", message)),
    }
}

pub(super) fn lets(top: &Section<'_>) -> Result<Vec<(String, Located<Formula>)>, FileError> {
    match top.read::<Option<Section<'_>>>("dynamics")? {
        Some(dynamics) => dynamics.read("let").map(|Named(lets)| lets),
        None => Ok(Vec::new()),
    }
}

pub(super) fn motion(dynamics: &Section<'_>, joints: usize) -> Result<Motion, FileError> {
    let accelerations: Vec<String> = (1..=joints).map(|j| format!("qdd{j}")).collect();
    let mut known: Vec<&str> = vec!["let", "mass", "bias"];
    known.extend(accelerations.iter().map(String::as_str));
    dynamics.only(&known)?;
    if !dynamics.has("mass") && !dynamics.has("bias") {
        let formula = |key: &String| {
            let missing =
                || dynamics.error(format!("`{key}` is missing; give it, or `mass` and `bias`"));
            dynamics.read::<Option<_>>(key)?.ok_or_else(missing)
        };
        let formulas = accelerations.iter().map(formula);
        return formulas
            .collect::<Result<_, _>>()
            .map(Motion::Accelerations);
    }
    if let Some(both) = accelerations.iter().find(|key| dynamics.has(key)) {
        return Err(dynamics.error_at(
            both,
            "give either accelerations or `mass` and `bias`, not both",
        ));
    }
    let mass: Vec<Vec<Located<Formula>>> = dynamics.read("mass")?;
    let bias: Vec<Located<Formula>> = dynamics.read("bias")?;
    if mass.len() != joints || mass.iter().any(|row| row.len() != joints) || bias.len() != joints {
        let message = format!(
            "`mass` must be {joints} rows of {joints} formulas and `bias` {joints} formulas"
        );
        return Err(dynamics.error_at("mass", message));
    }
    Ok(Motion::MassAndBias { mass, bias })
}

/// The text of a file without its effects, wherever they stand.
pub(super) fn declaration(document: &Document) -> Result<String, FileError> {
    let mut parsed: DocumentMut = document.text.parse().map_err(|error: TomlError| {
        let at = error.span().map_or(0, |span| span.start);
        document.error(at, error.message())
    })?;
    let declared = match parsed.remove("effect") {
        Some(_) => parsed.to_string(),
        None => document.text.clone(),
    };
    Ok(declared.trim_end().to_owned() + "\n")
}

#[cfg(test)]
mod tests {
    use crate::model::{Library, Side};

    #[test]
    fn sensors_have_one_side_for_each_joint() {
        let library = Library::built_in();
        let read = |sides: &str| {
            let text = format!(
                "[system]\nname = \"arm\"\njoints = 2\n[parameters]\n[sensors]\nangle = {sides}\n\
                 [dynamics]\nqdd1 = \"tau1\"\nqdd2 = \"tau2\"\n"
            );
            library.model_from_text("arm.toml", &text)
        };
        let arm = read("[\"motor\", \"link\"]").unwrap();
        assert_eq!(arm.sides, Some(vec![Side::Motor, Side::Link]));
        for (wrong, says) in [
            ("[\"motor\"]", "a list of 2 sides"),
            ("[\"motor\", \"gear\"]", "\"link\" or \"motor\""),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains("line 6") && error.contains(says), "{error}");
        }
    }
}

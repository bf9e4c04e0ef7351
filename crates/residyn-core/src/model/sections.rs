//! The tables of a model file, read one by one.

use std::collections::HashSet;

use toml_edit::{DocumentMut, TomlError};

use super::network::check_hidden;
use super::reader::{Document, FileError, Located, Section};
use super::system::{Energy, Motion};
use super::{MlpSettings, Parameter};
use crate::expr::Formula;
use crate::limits::JOINTS;

pub(super) const SYSTEM_KEYS: &[&str] = &[
    "name",
    "about",
    "joints",
    "joint_names",
    "prismatic",
    "smoothing_velocity",
];
const PARAMETER_KEYS: &[&str] = &[
    "value", "unit", "about", "positive", "bounds", "fixed", "ci95",
];

pub(super) fn joints(section: &Section<'_>) -> Result<usize, FileError> {
    match section.whole("joints")? {
        Some(joints @ 1..=JOINTS) => Ok(joints),
        Some(joints) => {
            let message = format!("`joints` must be from 1 to {JOINTS}, found {joints}");
            Err(section.error_at("joints", message))
        }
        None => Err(section.error("`joints` is missing in [system]; give the number of joints")),
    }
}

/// One name per joint, all different; an empty list if not given.
pub(super) fn joint_names(section: &Section<'_>, joints: usize) -> Result<Vec<String>, FileError> {
    let Some(names) = section.texts("joint_names")? else {
        return Ok(Vec::new());
    };
    let names: Vec<String> = names.into_iter().map(|name| name.value).collect();
    let distinct: HashSet<&str> = names.iter().map(|name| name.trim()).collect();
    if names.len() != joints || distinct.len() != joints || distinct.contains("") {
        let message =
            format!("`joint_names` must be a list of {joints} different names, one per joint");
        return Err(section.error_at("joint_names", message));
    }
    Ok(names)
}

/// `prismatic = [1]` lists the joints that slide.
pub(super) fn prismatic(section: &Section<'_>, joints: usize) -> Result<Vec<bool>, FileError> {
    let listed = section.numbers("prismatic")?.unwrap_or_default();
    let numbers: Vec<f64> = (1..=joints).map(|j| j as f64).collect();
    if let Some(stranger) = listed.iter().find(|j| !numbers.contains(j)) {
        let message = format!("`prismatic` must list joints from 1 to {joints}, found {stranger}");
        return Err(section.error_at("prismatic", message));
    }
    Ok(numbers.iter().map(|j| listed.contains(j)).collect())
}

/// One width per joint, above zero.
pub(super) fn smoothing_velocity(
    section: &Section<'_>,
    joints: usize,
) -> Result<Option<Vec<f64>>, FileError> {
    let widths = section.numbers("smoothing_velocity")?;
    match &widths {
        Some(widths) if widths.len() != joints || widths.iter().any(|w| *w <= 0.0) => {
            let message = format!(
                "`smoothing_velocity` must be a list of {joints} speeds above zero, one per joint"
            );
            Err(section.error_at("smoothing_velocity", message))
        }
        _ => Ok(widths),
    }
}

pub(super) fn parameters(section: Option<Section<'_>>) -> Result<Vec<Parameter>, FileError> {
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
    let bounds = section.bounds()?;
    if !(bounds[0]..=bounds[1]).contains(&value) {
        let message = format!(
            "`value` {value} is outside its bounds {} to {}",
            bounds[0], bounds[1]
        );
        return Err(section.error_at("value", message));
    }
    let parameter = Parameter {
        name,
        value,
        unit: section.text_or_empty("unit")?,
        bounds,
        fixed: section.flag("fixed")?,
        per_log: false,
        ci95: interval(section, "ci95")?,
        scale: 1.0,
    };
    Ok(parameter.with_value(value))
}

/// A list of two numbers, if given.
pub(super) fn interval(section: &Section<'_>, key: &str) -> Result<Option<[f64; 2]>, FileError> {
    match section.limits(key)? {
        None => Ok(None),
        Some(numbers) => match numbers[..] {
            [low, high] => Ok(Some([low, high])),
            _ => Err(section.error_at(key, format!("`{key}` must be a list of two numbers"))),
        },
    }
}

/// Widths of the hidden layers of the residual network; the published ones if the file gives none.
pub(super) fn hidden(section: Option<Section<'_>>, joints: usize) -> Result<Vec<usize>, FileError> {
    let default = MlpSettings::for_joints(joints).hidden;
    let Some(section) = section else {
        return Ok(default);
    };
    section.only(&["hidden"])?;
    let Some(numbers) = section.numbers("hidden")? else {
        return Ok(default);
    };
    // A number that is not whole becomes 0, which is not a valid width.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let width = |number: f64| {
        if number.fract() == 0.0 {
            number as usize
        } else {
            0
        }
    };
    let hidden: Vec<usize> = numbers.into_iter().map(width).collect();
    check_hidden(&hidden).map_err(|message| section.error_at("hidden", message))?;
    Ok(hidden)
}

pub(super) fn lets(
    document: &Document,
    top: &Section<'_>,
) -> Result<Vec<(String, Located<Formula>)>, FileError> {
    let dynamics = top.section("dynamics")?;
    let section = dynamics
        .map(|dynamics| dynamics.section("let"))
        .transpose()?;
    let Some(section) = section.flatten() else {
        return Ok(Vec::new());
    };
    section
        .named_texts()?
        .into_iter()
        .map(|(name, text)| Ok((name, document.formula(&text)?)))
        .collect()
}

pub(super) fn motion(
    document: &Document,
    dynamics: &Section<'_>,
    joints: usize,
) -> Result<Motion, FileError> {
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
        let message = format!(
            "`mass` must be {joints} rows of {joints} formulas and `bias` {joints} formulas"
        );
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

pub(super) fn energy(section: Option<Section<'_>>) -> Result<Option<Energy>, FileError> {
    let Some(section) = section else {
        return Ok(None);
    };
    section.only(&["total", "power"])?;
    let both = section.formula("total")?.zip(section.formula("power")?);
    let (total, power) = both.ok_or_else(|| section.error("[energy] needs `total` and `power`"))?;
    Ok(Some(Energy { total, power }))
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

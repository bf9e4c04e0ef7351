//! The `[[effect]]` entries of a model file.

use super::effect::Effect;
use super::reader::{FileError, Section};
use super::sections::interval;
use super::system::FittedEffect;
use crate::expr::suggestion;

pub(super) fn read(
    top: &Section<'_>,
    joints: usize,
    library: &[Effect],
) -> Result<Vec<FittedEffect>, FileError> {
    let sections = top.sections("effect")?;
    sections
        .iter()
        .map(|section| fitted(section, joints, library))
        .collect()
}

fn fitted(
    section: &Section<'_>,
    joints: usize,
    library: &[Effect],
) -> Result<FittedEffect, FileError> {
    let name = section.required_text("name")?.value;
    let Some(effect) = library.iter().find(|effect| effect.name == name) else {
        let near = suggestion(&name, library.iter().map(|effect| effect.name.as_str()));
        let message = format!("unknown effect `{name}`{near}; `residyn list effects` shows all");
        return Err(section.error_at("name", message));
    };
    let joint = match section.whole("joint")? {
        Some(joint) if (1..=joints).contains(&joint) => joint - 1,
        _ => {
            return Err(
                section.error_at("joint", format!("`joint` is a number from 1 to {joints}"))
            );
        }
    };
    let mut known = vec!["name", "joint", "fixed"];
    known.extend(effect.parameters.iter().map(|p| p.name.as_str()));
    section.only(&known)?;
    let values = effect
        .parameters
        .iter()
        .map(|p| value(section, &p.name))
        .collect::<Result<_, _>>()?;
    Ok(FittedEffect {
        effect: effect.clone(),
        joint,
        values,
        fixed: section.flag("fixed")?,
    })
}

/// `F_c = 0.16` or `F_c = { value = 0.16, ci95 = [0.15, 0.17] }`.
fn value(section: &Section<'_>, key: &str) -> Result<(f64, Option<[f64; 2]>), FileError> {
    if !section.is_table(key) {
        return Ok((section.required_number(key)?, None));
    }
    let inner = section.required_section(key)?;
    inner.only(&["value", "ci95"])?;
    Ok((inner.required_number("value")?, interval(&inner, "ci95")?))
}

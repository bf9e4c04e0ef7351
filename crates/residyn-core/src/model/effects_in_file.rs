//! The `[[effect]]` entries of a model file.

use super::dynamics::PerLogValue;
use super::effect::{Effect, EffectParameter};
use super::fitted::{FittedEffect, Status};
use super::reader::{FileError, Section};
use super::sections::interval;
use crate::data::Joint;

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
    let effect = Effect::find(library, &name);
    let effect = effect.map_err(|unknown| section.error_at("name", unknown.to_string()))?;
    let (key, joint) = match effect.is_coupling() {
        true => ("joints", pair(section, joints)?),
        false => ("joint", one(section, joints)?),
    };
    let mut known = vec!["name", key, "fixed", "status"];
    known.extend(effect.parameters.iter().map(|p| p.name.as_str()));
    section.only(&known)?;
    let values = effect
        .parameters
        .iter()
        .map(|p| value(section, p))
        .collect::<Result<_, _>>()?;
    let own = effect.parameters.iter().enumerate();
    let own = own
        .map(|(k, p)| per_log_values(section, k, p))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(FittedEffect {
        effect: effect.clone(),
        joint,
        values,
        own: own.concat(),
        fixed: section.flag("fixed")?,
        status: status(section)?,
    })
}

/// `joint = 2`
fn one(section: &Section<'_>, joints: usize) -> Result<Joint, FileError> {
    let joint = section.whole("joint")?.and_then(Joint::numbered);
    joint.filter(|joint| joint.is_of(joints)).ok_or_else(|| {
        section.error_at(
            "joint",
            format!("`joint` must be a number from 1 to {joints}"),
        )
    })
}

/// The first of `joints = [5, 6]`, two joints in a row.
fn pair(section: &Section<'_>, joints: usize) -> Result<Joint, FileError> {
    let given = section.numbers("joints")?.unwrap_or_default();
    let is_it = |joint: &Joint| given == [*joint, joint.next()].map(|j| j.number() as f64);
    let mut pairs = Joint::all(joints.saturating_sub(1));
    pairs.find(is_it).ok_or_else(|| {
        let message = format!(
            "`joints` must be two consecutive joints, [1, 2] to [{}, {joints}]",
            joints - 1
        );
        section.error_at("joints", message)
    })
}

/// `status = "established"`, as closing the loop writes it.
fn status(section: &Section<'_>) -> Result<Option<Status>, FileError> {
    let Some(name) = section.text("status")? else {
        return Ok(None);
    };
    let unknown = || {
        let message = "`status` must be \"established\" or \"supported\"";
        section.error_at("status", message.to_owned())
    };
    Status::named(&name.value).map(Some).ok_or_else(unknown)
}

/// `F_c = 0.16` or `F_c = { value = 0.16, ci95 = [0.15, 0.17] }`.
fn value(
    section: &Section<'_>,
    parameter: &EffectParameter,
) -> Result<(f64, Option<[f64; 2]>), FileError> {
    let known: &[&str] = if parameter.per_log {
        &["value", "ci95", "logs"]
    } else {
        &["value", "ci95"]
    };
    number_or_table(section, &parameter.name, known)
}

fn number_or_table(
    section: &Section<'_>,
    key: &str,
    known: &[&str],
) -> Result<(f64, Option<[f64; 2]>), FileError> {
    if !section.is_table(key) {
        return Ok((section.required_number(key)?, None));
    }
    let inner = section.required_section(key)?;
    inner.only(known)?;
    Ok((inner.required_number("value")?, interval(&inner, "ci95")?))
}

/// `q_z = { value = 0, logs = { "run1.csv" = { value = 0.012, ci95 = [0.011, 0.013] } } }`: per-log values.
fn per_log_values(
    section: &Section<'_>,
    k: usize,
    parameter: &EffectParameter,
) -> Result<Vec<PerLogValue>, FileError> {
    if !section.is_table(&parameter.name) {
        return Ok(Vec::new());
    }
    let inner = section.required_section(&parameter.name)?;
    let Some(logs) = inner.section("logs")? else {
        return Ok(Vec::new());
    };
    let own = |log: &str| {
        let (value, ci95) = number_or_table(&logs, log, &["value", "ci95"])?;
        Ok(PerLogValue {
            log: log.to_owned(),
            parameter: k,
            value,
            ci95,
        })
    };
    logs.keys().map(own).collect()
}

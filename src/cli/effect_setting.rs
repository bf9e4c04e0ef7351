//! Effects on the command line.

use std::str::FromStr;

use anyhow::{Context, Result};

use residyn_core::data::Joint;
use residyn_core::model::Library;
use residyn_core::plant::Plant;

/// `NAME[@JOINT][.PARAMETER]=VALUE`
#[derive(Debug, Clone)]
pub(super) struct EffectSetting {
    name: String,
    joint: Joint,
    parameter: Option<String>,
    value: f64,
}

impl FromStr for EffectSetting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let usage = "write NAME=VALUE, NAME@JOINT=VALUE or NAME.PARAMETER=VALUE";
        let (target, value) = text.split_once('=').ok_or(usage)?;
        let value = match value.parse::<f64>() {
            Ok(number) if number.is_finite() => number,
            _ => return Err(format!("{value:?} is not a number; {usage}")),
        };
        let (target, parameter) = match target.split_once('.') {
            Some((target, parameter)) => (target, Some(parameter.to_owned())),
            None => (target, None),
        };
        let (name, joint) = match target.split_once('@') {
            Some((name, joint)) => {
                let joint = joint.parse().map_err(|error| format!("{error}; {usage}"))?;
                (name, joint)
            }
            None => (target, Joint::at(0)),
        };
        Ok(Self {
            name: name.to_owned(),
            joint,
            parameter,
            value,
        })
    }
}

impl EffectSetting {
    /// `coulomb_friction on joint 2`
    pub fn label(&self) -> String {
        format!("{} on joint {}", self.name, self.joint)
    }
}

/// Adds the effects, each with all settings for it on its joint.
pub(super) fn add_effects(
    plant: &mut Plant,
    library: &Library,
    settings: &[EffectSetting],
) -> Result<()> {
    type Group<'s> = (&'s str, Joint, Vec<(String, f64)>);
    let mut groups: Vec<Group<'_>> = Vec::new();
    for setting in settings {
        let effect = library.effect(&setting.name)?;
        let first = || effect.parameters.first().map(|first| first.name.clone());
        let parameter = setting.parameter.clone().or_else(first);
        let parameter = parameter.with_context(|| format!("{} has no parameter", setting.name))?;
        let value = (parameter, setting.value);
        match groups
            .iter_mut()
            .find(|(name, joint, _)| *name == setting.name && *joint == setting.joint)
        {
            Some((_, _, values)) => values.push(value),
            None => groups.push((&setting.name, setting.joint, vec![value])),
        }
    }
    for (name, joint, values) in groups {
        plant.add_effect(library, name, joint, &values)?;
    }
    Ok(())
}

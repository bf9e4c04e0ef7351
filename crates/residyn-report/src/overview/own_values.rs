//! The values that belong to single joints: of effects, and of the drives.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stem;
use crate::json::parameter;
use crate::schema::ParameterEntry;
use residyn_core::closeloop::{Finding, Outcome};
use residyn_core::data::Joint;
use residyn_core::model::{FittedEffect, Model, Parameter};

/// free values of the model file that belong to one joint
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(crate) struct OfJointEntry {
    pub joint: Joint,
    /// the effect that the file declares or, for a constant of the joint's drive, its name without the joint's number
    pub of: String,
    #[schemars(length(min = 1))]
    pub parameters: Vec<ParameterEntry>,
}

/// The values of an effect on a joint, or a constant of its drive.
pub(crate) struct OwnValues {
    pub of: String,
    /// Two, if it couples them.
    pub joints: Vec<Joint>,
    pub parameters: Vec<Parameter>,
    /// Whether like joints, some of them mirrored, would have the same values.
    pub is_comparable: bool,
    /// Effects that it contains or is confused with.
    pub(super) related: Vec<String>,
}

impl OwnValues {
    fn of_effect(fitted: &FittedEffect, parameters: Vec<Parameter>) -> Self {
        let effect = &fitted.effect;
        Self {
            of: effect.name.clone(),
            joints: fitted.joints(),
            parameters,
            is_comparable: effect.is_mirror_symmetric(),
            related: [effect.contains.as_slice(), &effect.confused_with].concat(),
        }
    }

    /// Whether the two act on one joint and each could take over a part of the other: the value of either depends on whether the
    /// other is there.
    pub fn trades_with(&self, other: &Self) -> bool {
        let is_related = self.related.contains(&other.of) || other.related.contains(&self.of);
        is_related && self.joints.iter().any(|joint| other.joints.contains(joint))
    }
}

/// Of the effects that were found.
pub(crate) fn found(outcome: &Outcome) -> Vec<OwnValues> {
    let own = |finding: &Finding| OwnValues::of_effect(&finding.effect, finding.parameters.clone());
    let found = &outcome.effects;
    let both = found.findings.iter().chain(&found.supported);
    both.map(own).collect()
}

/// Of the drives and of the effects that the model file declares, so far as they were fitted.
pub(crate) fn declared(outcome: &Outcome, model: &Model) -> Vec<OwnValues> {
    let drives = Joint::all(model.joints).flat_map(|joint| {
        let own = model.drive_parameters(joint).into_iter();
        own.map(move |parameter| OwnValues {
            of: stem(&parameter.name, "", joint),
            joints: vec![joint],
            parameters: vec![parameter.clone()],
            is_comparable: parameter.bounds[0] >= 0.0,
            related: Vec::new(),
        })
    });
    let all = model.all_parameters();
    let effects = outcome.models.before.model.effects.iter();
    let count = effects.filter(|effect| effect.shifted().is_none()).count();
    let effects = (0..count)
        .map(|k| OwnValues::of_effect(&model.effects[k], all[model.place_of(k)].to_vec()));
    let is_fitted = |own: &OwnValues| own.parameters.iter().any(|p| p.ci95.is_some());
    drives.chain(effects).filter(is_fitted).collect()
}

pub(crate) fn of_joints(declared: &[OwnValues]) -> Vec<OfJointEntry> {
    let entry = |own: &OwnValues| OfJointEntry {
        joint: own.joints[0],
        of: own.of.clone(),
        parameters: own.parameters.iter().map(parameter).collect(),
    };
    declared.iter().map(entry).collect()
}

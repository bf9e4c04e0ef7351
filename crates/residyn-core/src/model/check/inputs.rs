//! Torques and commands that move nothing.

use super::places::Places;
use super::{Finding, Kind, Severity};
use crate::data::{Joint, Quantity};
use crate::model::system::{Model, Motion};

pub(super) fn find(model: &Model, places: &Places) -> Vec<Finding> {
    let equations = &model.equations;
    let message = |at: Option<usize>, text: String| Finding {
        severity: Severity::Warning,
        kind: Kind::Input,
        line: at.and_then(|at| places.line(at)),
        text,
    };
    let mut findings = Vec::new();
    if let Motion::Accelerations(formulas) = &equations.motion {
        let used = model.reached(formulas.iter().flat_map(|formula| formula.value.names()));
        for joint in Joint::all(model.joints) {
            let tau = joint.name("tau");
            if !used.contains(tau.as_str()) {
                let text = format!(
                    "no acceleration uses `{tau}`: neither the torque of joint {joint} nor an effect that acts as one, such \
                     as friction, moves anything"
                );
                findings.push(message(Some(formulas[joint].at), text));
            }
        }
    }
    if let Some(drive) = &equations.drive {
        let formulas = drive.formulas();
        let used: Vec<&str> = formulas
            .iter()
            .flat_map(|formula| formula.value.names())
            .collect();
        for joint in Joint::all(model.joints) {
            let command = joint.name(Quantity::Command.key());
            if !used.contains(&command.as_str()) {
                let text =
                    format!("no formula of [drive] uses `{command}`: that command moves nothing");
                findings.push(message(Some(formulas[joint.index()].at), text));
            }
        }
    }
    findings
}

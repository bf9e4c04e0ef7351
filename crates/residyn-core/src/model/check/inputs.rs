//! Torques and commands that move nothing.

use super::{Finding, Kind};
use crate::data::{Joint, Quantity};
use crate::model::system::{Model, Motion};

pub(super) fn find(model: &Model) -> Vec<Finding> {
    let equations = &model.equations;
    let message = |at: usize, text: String| Finding::new(Kind::Input, model.line(at), text);
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
                findings.push(message(formulas[joint].at, text));
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
                findings.push(message(formulas[joint.index()].at, text));
            }
        }
    }
    findings
}

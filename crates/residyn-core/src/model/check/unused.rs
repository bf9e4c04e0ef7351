//! Parameters and intermediates that no equation and no effect uses: fits cannot find them, and changing them does nothing.

use super::{Finding, Kind};
use crate::expr::Formula;
use crate::model::drive::Drive;
use crate::model::effect::Effect;
use crate::model::system::Model;

pub(super) fn find(model: &Model) -> Vec<Finding> {
    let equations = &model.equations;
    let motion = equations.motion.formulas();
    let drive = equations.drive.iter().flat_map(Drive::formulas);
    let used = model.reached(
        motion
            .chain(drive)
            .flat_map(|formula| formula.value.names()),
    );
    let energy = equations.energy.iter();
    let energy = energy.flat_map(|energy| [&energy.total, &energy.power]);
    let in_energy = model.reached(energy.flat_map(|formula| formula.value.names()));
    let unused = |name: &str| {
        if used.contains(name) {
            None
        } else if in_energy.contains(name) {
            Some(format!(
                "only [energy] uses `{name}`: the motion does not depend on it"
            ))
        } else {
            Some(format!(
                "no equation uses `{name}`: put it into one, or remove it"
            ))
        }
    };
    let of_parameters = model.parameters.iter().filter_map(|parameter| {
        let line = model.line_of_parameter(&parameter.name);
        Some(finding(line, unused(&parameter.name)?))
    });
    // Intermediates of an energy need not occur in the equations of motion.
    let lets = equations.lets.iter().map(|(name, _)| name.as_str());
    let of_lets = lets
        .filter(|name| !in_energy.contains(name))
        .filter_map(|name| Some(finding(model.line_of_let(name), unused(name)?)));
    let of_effects = model.effects.iter().enumerate().flat_map(|(k, effect)| {
        let line = model.line_of_effect(k);
        let tell = move |text| finding(line, text);
        without_use(&effect.effect).into_iter().map(tell)
    });
    of_parameters.chain(of_lets).chain(of_effects).collect()
}

/// Parameters of an effect that its formula does not mention.
fn without_use(effect: &Effect) -> Vec<String> {
    if effect.is_filter() {
        return Vec::new();
    }
    let starts = effect
        .states
        .iter()
        .filter_map(|state| state.start.as_ref());
    let mut used = effect.mentions();
    used.extend(starts.flat_map(Formula::names));
    used.extend(effect.entry.needed());
    let unused = effect.names().filter(|name| !used.contains(name));
    unused
        .map(|name| {
            format!(
                "the formula of {} does not use its parameter `{name}`",
                effect.name
            )
        })
        .collect()
}

fn finding(line: Option<usize>, text: String) -> Finding {
    Finding::new(Kind::Unused, line, text)
}

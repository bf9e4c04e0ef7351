//! What to do next.

use super::Block;
use crate::overview::is_large;
use crate::schema::Report;

/// Of a rig of many joints, the first of its rivals are here, and each is with its joint.
const MOST_RIVALS: usize = 3;

pub(super) fn steps(report: &Report) -> Block {
    let serious = report.serious().next();
    let mend = serious
        .map(|_| "Fix the logs: their serious faults stand at the top of this report.".to_owned());
    let most = match is_large(report.joints) {
        true => MOST_RIVALS,
        false => report.alternatives.len(),
    };
    let rivals = report.alternatives.iter().take(most).map(|rival| {
        format!(
            "To distinguish the finding from **{}** on joint {}: {}.",
            rival.title, rival.place, rival.experiment
        )
    });
    let model = &report.files.model;
    let usual = [
        format!(
            "Use the model: `{model}` holds the declared equations with fitted values and the effects. `residyn export` writes it \
             as C, ONNX, FMU, MJCF and more."
        ),
        format!("Predict a log that is not among these: `residyn evaluate` takes `{model}`."),
    ];
    let steps = mend.into_iter().chain(rivals).chain(usual);
    Block::Steps(steps.collect())
}

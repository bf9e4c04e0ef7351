use serde::Serialize;

use super::evidence::p_value;
use super::folds::{folds, left_out_losses};
use super::study::{Fitted, Study};
use crate::model::{Effect, FittedEffect};

/// What is left when no effect helps any more.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Share of the declared model's residual variance above the sensor's noise that is still there.
    pub fraction: f64,
    /// Probability of so much structure in noise alone: the smallest over the probes, times their number.
    pub p_value: f64,
    /// The variable over which most of it lives: `q1`, `qd2`, `tau1`, `t`, or `none`.
    pub place: String,
}

/// Below this probability what is left is no accident.
pub const SIGNIFICANT: f64 = 0.01;
/// Left-out loss that a probe must save before what it saw is of any practical interest.
const NOTEWORTHY: f64 = 0.05;

impl Unexplained {
    pub fn is_significant(&self) -> bool {
        self.place != "none"
    }
}

/// Probe what is left with flexible shapes over each variable. They name nothing; what they save on left-out
/// stretches is what an unknown effect would.
pub fn unexplained(
    study: &Study<'_>,
    probes: &[Effect],
    before: &Fitted,
    after: &Fitted,
) -> Unexplained {
    let folds = folds(&study.shooting);
    let total: f64 = left_out_losses(&after.fit, &folds).iter().sum();
    let mut found: Vec<(f64, f64, String)> = Vec::new();
    for joint in 0..study.system.joints {
        for probe in probes {
            if probe.name == "torque" && study.top_torque[joint] == 0.0 {
                continue;
            }
            found.extend(ask(study, after, probe, joint).map(|(p, model)| {
                let losses: f64 = left_out_losses(&model.fit, &folds).iter().sum();
                (
                    p,
                    1.0 - losses / total.max(f64::MIN_POSITIVE),
                    variable(&probe.name, joint),
                )
            }));
        }
    }
    #[allow(clippy::cast_precision_loss)] // few probes
    let asked = found.len() as f64;
    let least = found.iter().map(|f| f.0).fold(1.0, f64::min);
    let noteworthy = |f: &&(f64, f64, String)| f.0 * asked < SIGNIFICANT && f.1 > NOTEWORTHY;
    let most = found
        .iter()
        .filter(noteworthy)
        .max_by(|a, b| a.1.total_cmp(&b.1));
    Unexplained {
        fraction: fraction(before.fit.scale, after.fit.scale),
        p_value: (least * asked).min(1.0),
        place: most.map_or_else(|| "none".to_owned(), |most| most.2.clone()),
    }
}

fn ask(study: &Study<'_>, model: &Fitted, probe: &Effect, joint: usize) -> Option<(f64, Fitted)> {
    let mut effects = model.effects.clone();
    effects.push(FittedEffect::absent(probe, joint));
    let scale = Some(model.fit.scale);
    let fitted = study
        .refit(&effects, &model.declared, model.fit.locals.clone(), scale)
        .ok()?;
    let p = p_value(study, &fitted, fitted.effects.len() - 1)?;
    Some((p, fitted))
}

fn variable(probe: &str, joint: usize) -> String {
    let joint = joint + 1;
    match probe {
        "angle" => format!("q{joint}"),
        "speed" => format!("qd{joint}"),
        "torque" => format!("tau{joint}"),
        other => other.replace("time", "t"),
    }
}

/// Residual variance above noise after, as a share of that before; scales are in units of the noise.
fn fraction(before: f64, after: f64) -> f64 {
    let above = |scale: f64| (scale * scale - 1.0).max(0.0);
    if above(before) == 0.0 {
        0.0
    } else {
        (above(after) / above(before)).min(1.0)
    }
}

//! The errors that are compared, joint by joint and of all joints together.

use std::ops::Range;

use crate::document::{force_unit, judges_by_torques, position_unit};
use crate::schema::{ModelError, Report};
use crate::wording::{listed, small};
use residyn_core::data::Joint;

/// Errors on the test logs, in `unit`.
pub(crate) struct JointErrors {
    /// What they are errors of, for the head of a column.
    pub about: String,
    pub unit: String,
    /// Of the fitted declared model, and of the model with effects: one per joint.
    pub before: Vec<f64>,
    pub after: Vec<f64>,
}

/// Positions are off by thousandths of their units.
const MILLI: f64 = 1e3;

impl JointErrors {
    pub fn of(report: &Report) -> Self {
        let torque = report.torque.as_ref().filter(|_| judges_by_torques(report));
        if let Some(torque) = torque {
            return Self {
                about: "torque error".to_owned(),
                unit: force_unit(report).to_owned(),
                before: torque.before.rms.clone(),
                after: torque.after.rms.clone(),
            };
        }
        let (middle, horizon_s) = report.error.middle();
        let milli = |errors: &[f64]| errors.iter().map(|error| MILLI * error).collect();
        Self {
            about: format!("error {horizon_s} s ahead"),
            unit: thousandths(position_unit(report)),
            before: milli(&report.error.before.position_rmse[middle]),
            after: milli(&report.error.after.position_rmse[middle]),
        }
    }

    pub fn pair(&self, joint: Joint) -> [f64; 2] {
        [self.before[joint], self.after[joint]]
    }
}

/// `mrad`, `mrad or mm`
fn thousandths(unit: &str) -> String {
    match unit {
        "rad or m" => "mrad or mm".to_owned(),
        unit => format!("m{unit}"),
    }
}

/// The errors of all joints in a sentence, at these horizons.
pub(crate) fn sentence(report: &Report, horizons: Range<usize>) -> String {
    match &report.torque {
        Some(torque) if judges_by_torques(report) => format!(
            "Error of the torques on the test logs, as a share of them: {} as written, {} fitted without effects, **{} with \
             effects**{}.",
            torque.declared.share(),
            torque.before.share(),
            torque.after.share(),
            removed(torque.reduction_ci95)
        ),
        _ => of_motion(report, horizons),
    }
}

fn of_motion(report: &Report, horizons: Range<usize>) -> String {
    let error = &report.error;
    let ahead: Vec<String> = (error.horizons_s[horizons.clone()].iter())
        .map(f64::to_string)
        .collect();
    let unit = thousandths(position_unit(report));
    let of = |model: &ModelError| {
        let errors = horizons.clone().map(|h| small(MILLI * model.of_a_joint(h)));
        format!("{} {unit}", listed(&errors.collect::<Vec<_>>()))
    };
    format!(
        "Position errors on the test logs {} s ahead, root mean square over the joints: {} as written, {} fitted without \
         effects, **{} with effects**{}.",
        listed(&ahead),
        of(&error.declared),
        of(&error.before),
        of(&error.after),
        removed(error.reduction_ci95)
    )
}

fn removed(reduction_ci95: Option<[f64; 2]>) -> String {
    let known = reduction_ci95.filter(|ends| *ends != [0.0, 0.0]);
    known.map_or_else(String::new, |[low, high]| {
        format!(", which remove {:.0} to {:.0} %", 100.0 * low, 100.0 * high)
    })
}

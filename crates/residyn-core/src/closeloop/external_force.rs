//! External forces that no column records: a person pushes, a cable pulls, a limb touches. The fitted model then
//! follows the log only with an additional torque far beyond what it needs elsewhere.

use super::diagnostics::ForceSample;
use super::problem::Problem;
use super::settings::NoteSettings;
use crate::data::statistics::{SIGMA_PER_MAD, median};
use crate::data::{Audit, Finding, Interval, Joint, Quantity, Severity};
use crate::model::Model;

/// One external force on one joint.
#[derive(Debug)]
struct ExternalForce {
    log: usize,
    joint: Joint,
    span: Interval,
    /// Largest additional force, N m or N.
    force: f64,
    /// Its ratio to what the model needs elsewhere.
    times: f64,
}

/// Report in the audits of the problem's logs where an external force acted, judged by the residual forces of a fitted
/// model; returns what that means for the answer, as a sentence's part, if one acted. Where the states of a model's effects
/// were when a log began is not known: what they need there until they have settled is no push.
pub(super) fn report_external_forces(
    problem: &Problem<'_>,
    model: &Model,
    forces: &[ForceSample],
    audits: &mut [Audit],
) -> Option<String> {
    let mut found = Vec::new();
    let settings = &problem.settings.notes;
    let block_s = problem.settings.diagnostics.block_s;
    let has_states = (model.effects.iter()).any(|effect| !effect.effect.states.is_empty());
    for joint in Joint::all(problem.declared.joints) {
        let unit = problem.declared.columns.unit(Quantity::Torque, joint);
        let least = settings.push_torque * problem.top_torque[joint];
        let mut pushes = pushes(forces, joint, (block_s, least), settings);
        pushes.retain(|push| !has_states || !push.begins_a_log(forces));
        for push in pushes {
            let log = problem.logs[push.log].name();
            found.push(format!("from {} in {log}", push.span()));
            audits[push.log].add(push.finding(&log, unit));
        }
    }
    let first = found.first()?;
    Some(match found.len() {
        1 => format!("something may have pushed the rig {first}: leave that out first"),
        n => format!(
            "something may have pushed the rig {n} times, once {first}: leave these times out first"
        ),
    })
}

/// The external forces of at least `least` on a joint, in blocks of `block_s`.
fn pushes(
    samples: &[ForceSample],
    joint: Joint,
    (block_s, least): (f64, f64),
    settings: &NoteSettings,
) -> Vec<ExternalForce> {
    let force = |sample: &ForceSample| sample.force[joint];
    let sizes: Vec<f64> = samples.iter().map(|sample| force(sample).abs()).collect();
    let deviation = SIGMA_PER_MAD * median(&sizes);
    let is_far =
        |sample: &ForceSample| force(sample).abs() > settings.push_edge_deviations * deviation;
    let goes_on = |a: &ForceSample, b: &ForceSample| {
        let adjacent = a.log == b.log && b.time_s - a.time_s < 1.5 * block_s;
        adjacent && is_far(a) && is_far(b)
    };
    let push = |run: &[ForceSample]| {
        let sizes = run.iter().map(|sample| force(sample).abs());
        let largest = sizes.fold(0.0, f64::max);
        let is_push = run.len() >= settings.external_force_blocks
            && largest > least.max(settings.push_deviations * deviation);
        is_push.then(|| ExternalForce {
            log: run[0].log,
            joint,
            span: Interval {
                start_s: run[0].time_s - 0.5 * block_s,
                end_s: run[run.len() - 1].time_s + 0.5 * block_s,
            },
            force: largest,
            times: largest / deviation,
        })
    };
    samples.chunk_by(goes_on).filter_map(push).collect()
}

impl ExternalForce {
    fn begins_a_log(&self, samples: &[ForceSample]) -> bool {
        let mut samples = samples.iter();
        let first = samples.find(|sample| sample.log == self.log);
        first.is_some_and(|first| self.span.start_s <= first.time_s)
    }

    /// When it acted, to a hundredth of a second.
    fn span(&self) -> Interval {
        let rounded = |t: f64| (100.0 * t).round() / 100.0;
        Interval {
            start_s: rounded(self.span.start_s),
            end_s: rounded(self.span.end_s),
        }
    }

    fn finding(&self, log: &str, unit: &str) -> Finding {
        let span = self.span();
        let text = format!(
            "from {span} the model follows joint {} only with an additional force of up to {:.3} {unit}, {:.0} times \
             what it needs elsewhere: did something push or touch the rig? If so, leave this interval out",
            self.joint, self.force, self.times
        );
        let finding = Finding::new(Severity::Warning, text).of(self.joint);
        finding.within(log, &[span])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces of one joint in blocks of 0.15 s.
    fn samples(force: impl Fn(usize) -> f64) -> Vec<ForceSample> {
        let sample = |k: usize| ForceSample {
            log: 0,
            time_s: 0.15 * k as f64,
            q: vec![0.0],
            qd: vec![0.0],
            tau: vec![0.0],
            force: vec![force(k)],
        };
        (0..100).map(sample).collect()
    }

    #[test]
    fn a_force_that_lasts_is_a_push_and_a_single_knock_is_none() {
        let usual = |k: usize| 0.01 * (k as f64).sin();
        let found = |force: &dyn Fn(usize) -> f64, least: f64| {
            let settings = NoteSettings::default();
            pushes(&samples(force), Joint::at(0), (0.15, least), &settings)
        };
        assert!(found(&usual, 0.0).is_empty());
        let pushed = |k: usize| usual(k) + if (40..44).contains(&k) { 2.0 } else { 0.0 };
        let one = found(&pushed, 0.1);
        assert_eq!(one.len(), 1, "{one:?}");
        assert!(
            (one[0].span.start_s - 5.925).abs() < 1e-9 && (one[0].span.end_s - 6.525).abs() < 1e-9
        );
        assert!(found(&pushed, 3.0).is_empty());
        assert!(!one[0].begins_a_log(&samples(pushed)));
        let released = |k: usize| usual(k) + if k < 4 { 2.0 } else { 0.0 };
        assert!(found(&released, 0.1)[0].begins_a_log(&samples(released)));
        assert!(found(&|k| usual(k) + if k == 40 { 2.0 } else { 0.0 }, 0.1).is_empty());
    }
}

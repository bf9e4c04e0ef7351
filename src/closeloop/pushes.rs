//! Forces that no column holds: a person pushes, a cable pulls, a limb touches. The fitted model follows the log there
//! only with a further torque that is far beyond what it needs elsewhere.

use super::fitted::Fitted;
use super::remainder::{ForceSample, ResidualForce};
use super::study::Study;
use crate::data::statistics::{SIGMA_PER_MAD, median};
use crate::data::{Audit, Finding, Interval, Joint, Severity};

/// A residual force counts as a push beyond this many standard deviations of the others.
const PUSH: f64 = 8.0;

/// A push goes on next to its strongest stretches as long as the force stays beyond this many standard deviations.
const ITS_EDGE: f64 = 4.0;

/// One push on one joint.
struct Push {
    log: usize,
    joint: Joint,
    span: Interval,
    /// Largest further force, N m or N.
    force: f64,
    /// The same over what the model needs elsewhere.
    times: f64,
}

/// Add to the audits of the study's logs where something pushed, as far as the model tells.
pub(super) fn tell_pushes(study: &Study<'_>, fitted: &Fitted, audits: &mut [Audit]) {
    // Logs over which the model diverges tell of no push.
    let Ok(residual) = ResidualForce::of(study, fitted) else {
        return;
    };
    let half_s = 0.5 * study.settings.remainder.stretch_s;
    for joint in Joint::all(study.declared.joints) {
        for push in pushes(&residual.samples, joint, half_s) {
            audits[push.log].add(push.finding(&study.logs[push.log].name()));
        }
    }
}

fn pushes(samples: &[ForceSample], joint: Joint, half_s: f64) -> Vec<Push> {
    let sizes: Vec<f64> = samples
        .iter()
        .map(|sample| sample.force[joint].abs())
        .collect();
    let deviation = SIGMA_PER_MAD * median(&sizes);
    if deviation == 0.0 {
        return Vec::new();
    }
    let beyond = |k: &usize, times: f64| sizes[*k] > times * deviation;
    let mut found = Vec::new();
    let mut k = 0;
    while k < samples.len() {
        if !beyond(&k, ITS_EDGE) {
            k += 1;
            continue;
        }
        // Neighbours in the list are neighbours in time within a log, but for gaps.
        let adjacent = |a: usize, b: usize| {
            samples[a].log == samples[b].log && samples[b].time_s - samples[a].time_s < 3.0 * half_s
        };
        let mut last = k;
        while last + 1 < samples.len() && adjacent(last, last + 1) && beyond(&(last + 1), ITS_EDGE)
        {
            last += 1;
        }
        let force = sizes[k..=last].iter().copied().fold(0.0, f64::max);
        if force > PUSH * deviation {
            found.push(Push {
                log: samples[k].log,
                joint,
                span: Interval {
                    start_s: samples[k].time_s - half_s,
                    end_s: samples[last].time_s + half_s,
                },
                force,
                times: force / deviation,
            });
        }
        k = last + 1;
    }
    found
}

impl Push {
    fn finding(&self, log: &str) -> Finding {
        let rounded = |t: f64| (100.0 * t).round() / 100.0;
        let span = Interval {
            start_s: rounded(self.span.start_s),
            end_s: rounded(self.span.end_s),
        };
        let text = format!(
            "from {span} the model follows joint {} only with a further force of up to {:.3} N m (N), {:.0} times what it \
             needs elsewhere: did something push or touch the rig? If so, leave it out",
            self.joint, self.force, self.times
        );
        Finding {
            joint: Some(self.joint),
            ..Finding::new(Severity::Warning, text).within(log, &[span])
        }
    }
}

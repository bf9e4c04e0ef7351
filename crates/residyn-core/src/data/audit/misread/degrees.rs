//! Angles and velocities both in degrees, recognised by gravity, which varies with the sine of the angle.

use std::f64::consts::TAU;

use super::{Change, Misread, Reading, To};
use crate::data::audit::JointAudit;
use crate::data::audit::motion::Motion;
use crate::data::audit::regression::Regression;
use crate::data::audit::response::response;
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// In degrees, a regression has to leave at most this share of the accelerations' variance that it leaves in radians,
const MUCH_BETTER: f64 = 1.0 / 3.0;

/// and to explain this much more of their variance: the last percent is a matter of friction, not of gravity.
const MUCH_MORE: f64 = 0.1;

/// No spring is bent by more than a turn to either side \[rad\]. Within that, gravity on so few degrees is a straight line,
/// as a spring is: nothing tells one from the other.
const BEYOND_SPRINGS: f64 = 2.0 * TAU;

/// rad
const DEGREE: f64 = TAU / 360.0;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    // A motion of fewer degrees than a turn has radians is too small to distinguish the two.
    let is_far = |joint: &&JointAudit| joint.moves() && !joint.slides() && joint.q.range() > TAU;
    let mut far = reading.joints.iter().filter(is_far).peekable();
    if far.peek().is_none() {
        return vec![];
    }
    let in_degrees = reading.motions.iter().map(|motion| motion.scaled(DEGREE));
    let in_degrees: Vec<Motion> = in_degrees.collect();
    let fast = reading.joints.iter();
    let fast: Vec<f64> = fast.map(|joint| DEGREE * joint.fast_rad_s).collect();
    let judged = far.filter_map(|audit| {
        let in_degrees = response(&Regression::of(&in_degrees, &fast, audit.joint)?)?;
        Some(Judged {
            audit,
            radians: 1.0 - audit.response?.explained,
            degrees: 1.0 - in_degrees.explained,
        })
    });
    let judged: Vec<Judged<'_>> = judged.collect();
    // One program writes all joints: if one is in degrees, so is every other joint that looks no worse in degrees.
    if !judged.iter().any(Judged::is_beyond_doubt) {
        return vec![];
    }
    let no_worse = judged.iter().filter(|joint| joint.degrees <= joint.radians);
    no_worse.map(Judged::misread).collect()
}

/// A joint, and the shares of its acceleration's variance that regressions leave in either unit.
struct Judged<'a> {
    audit: &'a JointAudit,
    radians: f64,
    degrees: f64,
}

impl Judged<'_> {
    fn is_beyond_doubt(&self) -> bool {
        let Self {
            audit,
            radians,
            degrees,
        } = *self;
        let is_better = degrees < MUCH_BETTER * radians && degrees < radians - MUCH_MORE;
        is_better && audit.q.range() > BEYOND_SPRINGS
    }

    fn misread(&self) -> Misread {
        let JointAudit { joint, q, qd, .. } = self.audit;
        let change = |quantity, unit| Change::of(*joint, quantity, To::Unit(unit));
        let text = format!(
            "{0} covers {1} rad and reaches {2} rad/s, and torque, gravity and friction explain {3} % of its \
             acceleration; with {0} in degrees they explain {4} %: {0} and {5} look like deg and deg/s",
            q.name,
            short(q.range()),
            short(self.audit.fast_rad_s),
            short(100.0 * (1.0 - self.radians)),
            short(100.0 * (1.0 - self.degrees)),
            qd.name
        );
        Misread {
            joint: Some(*joint),
            text,
            changes: vec![
                change(Quantity::Angle, "deg"),
                change(Quantity::Velocity, "deg/s"),
            ],
        }
    }
}

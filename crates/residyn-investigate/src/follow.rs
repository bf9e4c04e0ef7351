use residyn_control::control::Policy;
use residyn_excite::{Design, Limits};
use residyn_plants::Guard;

use super::runaway::{Lookout, Runaway};
use super::tracking::{Reference, Tracking};
use super::within::guard;

/// Share of the greatest speed and acceleration on the way to where a motion begins.
const APPROACH: f64 = 0.5;

/// Follows a designed motion: what drives the model along it, and feedback around its reference, both within the limits also where
/// the rig is not where its model would be. A rig that is not where the motion begins is brought there first, and one that runs away is
/// left to its safe command.
pub struct Follow<'d> {
    design: &'d Design,
    tracking: Tracking,
    limits: &'d Limits,
    begun: Option<Begun>,
    lookout: Lookout,
}

/// A motion since the rig was first seen.
struct Begun {
    from: Vec<f64>,
    at_s: f64,
    approach_s: f64,
    guard: Guard,
}

impl<'d> Follow<'d> {
    /// Along a design that was made for these limits.
    pub fn new(design: &'d Design, tracking: Tracking, limits: &'d Limits) -> Self {
        Self {
            design,
            tracking,
            limits,
            begun: None,
            lookout: Lookout::default(),
        }
    }

    /// The joint that ran away, after which the plant had its safe command.
    pub fn runaway(&self) -> Option<Runaway> {
        self.lookout.seen()
    }

    fn begin(&self, q: &[f64], at_s: f64) -> Begun {
        Begun {
            from: q.to_vec(),
            at_s,
            approach_s: self.approach_s(q),
            guard: guard(self.limits, self.design.driven_by, q),
        }
    }

    /// How long the way from `q` to the start takes, s. A cubic from rest to rest over a time T has 1.5 times its mean speed in the
    /// middle, and accelerates by 6 ways per T^2 at its ends.
    pub fn approach_s(&self, q: &[f64]) -> f64 {
        let ways = self.design.q.iter().zip(q).zip(&self.limits.joints);
        let times = ways.map(|((reference, q), joint)| {
            let way = (reference[0] - q).abs() / APPROACH;
            (1.5 * way / joint.speed).max((6.0 * way / joint.acceleration).sqrt())
        });
        times.fold(0.0, f64::max)
    }

    /// At a row of the motion.
    fn at(&self, row: usize) -> Reference {
        let of = |channel: &[Vec<f64>]| channel.iter().map(|joint| joint[row]).collect();
        Reference {
            q: of(&self.design.q),
            qd: of(&self.design.qd),
            qdd: of(&self.design.qdd),
            driven_by: of(&self.design.command),
        }
    }

    /// So long after the rig was first seen.
    fn reference(&self, begun: &Begun, since_s: f64) -> Option<Reference> {
        if since_s < begun.approach_s {
            return self.on_the_way(begun, since_s / begun.approach_s);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let row = ((since_s - begun.approach_s) / self.design.step_s).round() as usize;
        Some(self.at(row.min(self.design.time.len() - 1)))
    }

    /// After a share of the way to where the motion begins.
    fn on_the_way(&self, begun: &Begun, share: f64) -> Option<Reference> {
        let start = self.at(0);
        let rate = begun.approach_s.recip();
        let along = |at: f64, factor: f64| -> Vec<f64> {
            let ways = start.q.iter().zip(&begun.from);
            ways.map(|(to, from)| at * from + factor * (to - from))
                .collect()
        };
        let mut way = Reference {
            q: along(1.0, share * share * (3.0 - 2.0 * share)),
            qd: along(0.0, rate * 6.0 * share * (1.0 - share)),
            qdd: along(0.0, rate * rate * 6.0 * (1.0 - 2.0 * share)),
            driven_by: Vec::new(),
        };
        way.driven_by = self.tracking.on_the_way(&way, &start)?;
        Some(way)
    }
}

impl Policy for Follow<'_> {
    fn torque(&mut self, measured: &[f64], time_s: f64) -> Option<Vec<f64>> {
        let (q, qd) = measured.split_at(self.design.q.len());
        if self.lookout.see(qd, self.limits).is_some() {
            return None;
        }
        let mut begun = self.begun.take().unwrap_or_else(|| self.begin(q, time_s));
        let reference = self.reference(&begun, time_s - begun.at_s);
        let asked = reference.and_then(|to| self.tracking.command(&to, q, qd));
        let admitted = asked.map(|asked| begun.guard.admit(&asked, q, qd));
        self.begun = Some(begun);
        admitted
    }

    fn held(&mut self, torques: &[Vec<f64>]) {
        if let (Some(begun), Some(last)) = (&mut self.begun, torques.last()) {
            begun.guard.applied(last.clone());
        }
    }
}

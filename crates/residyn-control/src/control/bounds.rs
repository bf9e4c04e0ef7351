use std::fmt::Write as _;

use crate::plan::Objective;

/// Limits of a plant's state, one entry for each joint or none at all; `None` for a joint without such a limit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bounds {
    /// Least and greatest position in rad (or m).
    pub angle: Vec<Option<[f64; 2]>>,
    /// Greatest speed in rad/s (or m/s).
    pub speed: Vec<Option<f64>>,
    /// How far ahead the plant brakes for the limits of its angles, in s: a joint that passes one within this time at the speed
    /// that it has counts as beyond it, for there the plant no longer does what is planned.
    pub brake_s: f64,
}

impl Bounds {
    /// How far a state is beyond the limits, 0 within: the sum over joints of the angle beyond, as a share of its range, and of
    /// the speed beyond, as a share of the limit. `None` without limits.
    pub fn excess(&self, joints: usize) -> Option<Objective> {
        let angles = (1..).zip(&self.angle);
        let angles = angles.filter_map(|(joint, range)| Some(self.angle_excess(joint, (*range)?)));
        let speeds = (1..).zip(&self.speed);
        let speeds = speeds.filter_map(|(joint, most)| Some(speed_excess(joint, (*most)?)));
        let terms = angles.chain(speeds);
        let sum = terms.reduce(|mut sum, term| {
            let _ = write!(sum, " + {term}");
            sum
        })?;
        Some(Objective::new(&sum, joints).expect("a formula of the joints' states"))
    }

    fn angle_excess(&self, joint: usize, [low, high]: [f64; 2]) -> String {
        let (now, ahead, width) = (
            format!("q{joint}"),
            format!("(q{joint} + {} * qd{joint})", self.brake_s),
            high - low,
        );
        format!(
            "(max(max({now}, {ahead}) - ({high}), 0) + max(({low}) - min({now}, {ahead}), 0)) / {width}"
        )
    }
}

fn speed_excess(joint: usize, most: f64) -> String {
    format!("max(abs(qd{joint}) - {most}, 0) / {most}")
}

#[cfg(test)]
mod tests {
    use super::Bounds;
    use residyn_core::limits::JOINTS;

    #[test]
    fn an_excess_counts_the_braking_zone_and_is_a_share_of_each_limit() {
        let bounds = Bounds {
            angle: vec![Some([-1.0, 3.0]), None],
            speed: vec![None, Some(5.0)],
            brake_s: 0.1,
        };
        let excess = bounds.excess(2).unwrap();
        for (state, found) in [
            // Within, at rest and moving away.
            ([3.0, 9.0, 0.0, 5.0], 0.0),
            ([2.9, 0.0, -9.0, -5.0], 0.0),
            // Beyond, and about to be.
            ([4.0, 0.0, 0.0, 0.0], 0.25),
            ([4.0, 0.0, -9.0, 0.0], 0.25),
            ([2.0, 0.0, 20.0, 0.0], 0.25),
            ([-0.5, 0.0, -25.0, 0.0], 0.5),
            // Too fast, and both.
            ([0.0, 0.0, 0.0, -6.0], 0.2),
            ([4.0, 0.0, 0.0, 10.0], 1.25),
        ] {
            let value = excess.value(&state, &[0.0, 0.0], 0.0);
            assert!((value - found).abs() < 1e-12, "{state:?} {value}");
        }
        let many = Bounds {
            angle: vec![Some([-1.0, 1.0]); JOINTS],
            speed: vec![Some(1e-9); JOINTS],
            brake_s: 1e-9,
        };
        assert!(many.excess(JOINTS).is_some());
        let none = Bounds {
            angle: vec![None, None],
            ..Bounds::default()
        };
        assert!(none.excess(2).is_none());
    }
}

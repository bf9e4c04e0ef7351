//! Whether a joint moves in one direction only. A force that has one value a direction looks like a constant one there.

use crate::data::Log;

/// A joint moves both ways if each direction has at least this share of its travel.
const EITHER_WAY: f64 = 0.05;
/// Travel counts in steps of this share of the range: noise travels both ways.
const STEP: f64 = 0.02;

/// Whether a joint moves in one direction only in all of these logs together.
pub(super) fn moves_one_way(logs: &[Log], joint: usize) -> bool {
    let travels = logs.iter().map(|log| travel(&log.q[joint]));
    let [up, down] = travels.fold([0.0; 2], |[up, down], [more, less]| {
        [up + more, down + less]
    });
    up.min(down) < EITHER_WAY * (up + down)
}

/// How far a position moves up and down.
fn travel(positions: &[f64]) -> [f64; 2] {
    let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
    let high = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut at = positions.first().copied().unwrap_or_default();
    let mut travel = [0.0; 2];
    for &position in positions {
        let moved = position - at;
        if moved.abs() > STEP * (high - low) {
            travel[usize::from(moved < 0.0)] += moved.abs();
            at = position;
        }
    }
    travel
}

#[cfg(test)]
mod tests {
    use super::moves_one_way;
    use crate::data::Log;

    fn log(position: impl Fn(f64) -> f64) -> Log {
        let mut log = Log::empty(1);
        log.time = (0..1000).map(|row| 0.01 * f64::from(row)).collect();
        log.q = vec![log.time.iter().map(|t| position(*t)).collect()];
        log
    }

    #[test]
    fn noise_and_ripples_are_no_motion_the_other_way() {
        let noise = |t: f64| 1e-3 * (977.0 * t).sin();
        let spin = |t: f64| 2.0 * t + noise(t);
        assert!(moves_one_way(&[log(spin)], 0));
        assert!(!moves_one_way(&[log(spin), log(|t| -spin(t))], 0));
        // A decaying swing, every period of which ends lower than it began.
        assert!(!moves_one_way(
            &[log(|t| (-0.3 * t).exp() * t.cos() + noise(t))],
            0
        ));
        assert!(!moves_one_way(
            &[log(|t| 2.0 * t + 3.0 * (2.0 * t).sin())],
            0
        ));
    }
}

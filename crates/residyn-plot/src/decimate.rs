//! Thins curves: fewer points, the same picture.

/// Thins a curve to at most `limit` points (at least two) and keeps its spikes.
///
/// The points are cut into runs of equal number; each run keeps its lowest and its highest point, in their order.
/// The first and the last point always stay. `limit` below four keeps just these two.
pub(crate) fn decimate(points: &[(f64, f64)], limit: usize) -> Vec<(f64, f64)> {
    let [first, inner @ .., last] = points else {
        return points.to_vec();
    };
    if points.len() <= limit {
        return points.to_vec();
    }
    let mut kept = vec![*first];
    let runs = limit.saturating_sub(2) / 2;
    for run in 0..runs {
        let bounds = run * inner.len() / runs..(run + 1) * inner.len() / runs;
        kept.extend(extremes(&inner[bounds]));
    }
    kept.push(*last);
    kept
}

/// The places between which straight lines are at most `off` away from every curve over `x`, including the ends.
pub fn bends(x: &[f64], curves: &[Vec<f64>], off: f64) -> Vec<usize> {
    let last = x.len() - 1;
    let inner = bends_between(x, curves, off, 0, last);
    [vec![0], inner, vec![last]].concat()
}

/// The inner places (Ramer 1972; Douglas and Peucker 1973).
fn bends_between(
    x: &[f64],
    curves: &[Vec<f64>],
    off: f64,
    first: usize,
    last: usize,
) -> Vec<usize> {
    let away = |k: usize| {
        let share = (x[k] - x[first]) / (x[last] - x[first]);
        let line = |curve: &Vec<f64>| curve[first] + share * (curve[last] - curve[first]);
        let of_each = curves.iter().map(|curve| (curve[k] - line(curve)).abs());
        of_each.fold(0.0, f64::max)
    };
    let farthest = (first + 1..last).max_by(|a, b| away(*a).total_cmp(&away(*b)));
    match farthest.filter(|k| away(*k) > off) {
        Some(k) => {
            let [before, after] =
                [[first, k], [k, last]].map(|[a, b]| bends_between(x, curves, off, a, b));
            [before, vec![k], after].concat()
        }
        None => Vec::new(),
    }
}

fn extremes(run: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    let by_height = |a: &usize, b: &usize| run[*a].1.total_cmp(&run[*b].1);
    let lowest = (0..run.len()).min_by(by_height);
    let highest = (0..run.len()).max_by(by_height);
    let mut kept: Vec<usize> = lowest.into_iter().chain(highest).collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|index| run[index])
}

/// The pieces of a curve between the points that are not finite.
pub(crate) fn drawable_pieces(points: &[(f64, f64)]) -> impl Iterator<Item = &[(f64, f64)]> {
    let is_broken = |(x, y): &(f64, f64)| !x.is_finite() || !y.is_finite();
    points.split(is_broken).filter(|piece| !piece.is_empty())
}

#[cfg(test)]
mod tests {
    use super::{bends, decimate};

    fn sine_with_spike() -> Vec<(f64, f64)> {
        let mut points: Vec<_> = (0..100_000)
            .map(|i| f64::from(i) * 1e-3)
            .map(|t| (t, t.sin()))
            .collect();
        points[54_321].1 = 9.0;
        points[54_400].1 = -7.0;
        points
    }

    #[test]
    fn spikes_and_ends_survive() {
        let points = sine_with_spike();
        let kept = decimate(&points, 4000);
        assert!(kept.len() <= 4000 && kept.len() > 3900);
        assert!(kept.contains(&points[54_321]) && kept.contains(&points[54_400]));
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
    }

    #[test]
    fn order_in_time_stays() {
        let kept = decimate(&sine_with_spike(), 777);
        assert!(kept.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn short_curves_are_left_alone() {
        for length in 0..6 {
            let points: Vec<_> = (0..length).map(|i| (f64::from(i), 1.0)).collect();
            assert_eq!(decimate(&points, 6), points);
        }
    }

    #[test]
    fn a_jump_and_two_straight_lines_are_four_points() {
        let x: Vec<f64> = (-50..=50).map(f64::from).collect();
        let dry: Vec<f64> = x.iter().map(|x| x - 20.0 * x.signum()).collect();
        assert_eq!(bends(&x, &[dry], 0.1), [0, 49, 50, 100]);
        let flat = vec![1.0; x.len()];
        assert_eq!(bends(&x, &[flat], 0.1), [0, 100]);
    }

    #[test]
    fn small_limits_keep_the_ends() {
        let points = sine_with_spike();
        for limit in 0..4 {
            let kept = decimate(&points, limit);
            assert_eq!(kept, [points[0], points[99_999]]);
        }
    }
}

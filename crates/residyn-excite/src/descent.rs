//! Minima of smooth functions of many variables: the method of Nocedal (Updating quasi-Newton matrices with limited storage,
//! 1980).

use std::collections::VecDeque;

/// Steps that the method remembers.
const MEMORY: usize = 12;
/// The decrease that a step must reach, as a share of the predicted one (Armijo).
const DECREASE: f64 = 1e-4;
/// Halvings after which no step is worth taking.
const HALVINGS: usize = 25;
/// A relative decrease below this, over [`PATIENCE`] steps, ends the descent.
const SETTLED: f64 = 1e-5;
const PATIENCE: usize = 6;

/// A cost and its gradient; `None` where there is none.
pub type Value = Option<(f64, Vec<f64>)>;

/// Go downhill from `x` for at most this many steps; returns where that ends, and the cost there. `None` if there is no
/// cost at the start.
pub fn descend(
    mut value: impl FnMut(&[f64]) -> Value,
    x: Vec<f64>,
    steps: usize,
) -> Option<(Vec<f64>, f64)> {
    let (mut cost, mut gradient) = value(&x)?;
    let mut x = x;
    let mut pairs: VecDeque<(Vec<f64>, Vec<f64>)> = VecDeque::new();
    let mut past = VecDeque::from([cost]);
    for _ in 0..steps {
        let mut direction = direction(&gradient, &pairs);
        let mut slope = dot(&direction, &gradient);
        if !(slope < 0.0) {
            pairs.clear();
            direction = gradient.iter().map(|g| -g).collect();
            slope = dot(&direction, &gradient);
        }
        // Without memory the first step is a tenth of a unit long.
        let first = match pairs.is_empty() {
            true => 0.1 / dot(&direction, &direction).sqrt().max(f64::MIN_POSITIVE),
            false => 1.0,
        };
        let taken = (0..HALVINGS).find_map(|halvings| {
            let share = first * 0.5_f64.powi(halvings as i32);
            let next: Vec<f64> = x
                .iter()
                .zip(&direction)
                .map(|(x, d)| x + share * d)
                .collect();
            let (lower, slopes) = value(&next)?;
            (lower <= cost + DECREASE * share * slope).then_some((next, lower, slopes))
        });
        let Some((next, lower, slopes)) = taken else {
            if pairs.is_empty() {
                break;
            }
            pairs.clear();
            continue;
        };
        let moved: Vec<f64> = next.iter().zip(&x).map(|(a, b)| a - b).collect();
        let turned: Vec<f64> = slopes.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        if dot(&moved, &turned) > 1e-10 * dot(&turned, &turned) {
            pairs.push_back((moved, turned));
            if pairs.len() > MEMORY {
                pairs.pop_front();
            }
        }
        (x, cost, gradient) = (next, lower, slopes);
        past.push_back(cost);
        if past.len() > PATIENCE {
            let before = past.pop_front().unwrap_or(cost);
            if before - cost < SETTLED * (1.0 + cost.abs()) {
                break;
            }
        }
    }
    Some((x, cost))
}

/// The quasi-Newton direction, by the two loops of the method.
fn direction(gradient: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>)>) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut shares = Vec::with_capacity(pairs.len());
    for (moved, turned) in pairs.iter().rev() {
        let share = dot(moved, &direction) / dot(moved, turned);
        add(&mut direction, turned, -share);
        shares.push(share);
    }
    if let Some((moved, turned)) = pairs.back() {
        let size = dot(moved, turned) / dot(turned, turned);
        direction.iter_mut().for_each(|d| *d *= size);
    }
    for ((moved, turned), share) in pairs.iter().zip(shares.iter().rev()) {
        let back = dot(turned, &direction) / dot(moved, turned);
        add(&mut direction, moved, share - back);
    }
    direction
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(sum: &mut [f64], part: &[f64], share: f64) {
    sum.iter_mut()
        .zip(part)
        .for_each(|(sum, part)| *sum += share * part);
}

#[cfg(test)]
mod tests {
    use super::descend;

    /// The valley of Rosenbrock 1960.
    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let value = |x: &[f64]| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            Some((
                a * a + 100.0 * b * b,
                vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b],
            ))
        };
        let (x, cost) = descend(value, vec![-1.2, 1.0], 200).unwrap();
        assert!(cost < 1e-8 && (x[0] - 1.0).abs() < 1e-3, "{x:?} {cost}");
    }

    #[test]
    fn there_is_no_descent_from_where_nothing_is_defined() {
        assert!(descend(|_| None, vec![0.0], 5).is_none());
    }
}

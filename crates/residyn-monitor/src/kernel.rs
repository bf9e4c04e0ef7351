//! The test function with which motion and torques are weighed.
//!
//! The residual is taken in its weak form: the equations hold at every instant, so they hold for the means over any
//! smooth window K, in which derivatives move from the noisy angles to K: the mean of qdd is the integral of K'' q. Motion
//! and torque go through the same window, so that no lag or loss is on one side alone.

/// K(s) is (1 - s^2)^5 within a half width: K'' still ends smoothly, and sums over ten rows are as good as integrals.
const POWER: i32 = 5;
/// A first-order lag is taken as this many delays, the quantiles of its impulse response.
const LAG_PARTS: u32 = 32;

/// Weights of rows at even steps on either side of a centre.
#[derive(Debug, Clone)]
pub(crate) struct Kernel {
    /// Rows on either side.
    pub half: usize,
    half_width_s: f64,
    step_s: f64,
    pub value: Vec<f64>,
    /// 1/s
    pub slope: Vec<f64>,
    /// 1/s^2
    pub curvature: Vec<f64>,
}

/// Weights of a channel whose rows act later than they are written: from `past` rows before the centre on.
#[derive(Debug, Clone)]
pub(crate) struct Delayed {
    pub past: usize,
    pub weights: Vec<f64>,
}

impl Kernel {
    pub fn new(half_width_s: f64, step_s: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and small
        let half = (half_width_s / step_s).round().max(4.0) as usize;
        let half_width_s = (half as f64 + 0.5) * step_s;
        let offsets: Vec<f64> = (0..=2 * half)
            .map(|row| (row as f64 - half as f64) * step_s)
            .collect();
        let scaled = |of: fn(f64) -> f64| -> Vec<f64> {
            offsets.iter().map(|o| of(o / half_width_s)).collect()
        };
        let value = normalised(scaled(window), &offsets, 0);
        let slope = normalised(scaled(|s| -window_slope(s)), &offsets, 1);
        // The sum has to vanish to the last digit: angles may be far from zero.
        let curved = scaled(window_curvature);
        let sum: f64 = curved.iter().sum();
        let curved = curved.iter().zip(&value);
        let curved = curved.map(|(curved, value)| curved - sum * value).collect();
        Self {
            half,
            half_width_s,
            step_s,
            curvature: normalised(curved, &offsets, 2),
            value,
            slope,
        }
    }

    /// The same window for rows that act `delay_s` after their time, through a lag of `lag_s`.
    pub fn delayed(&self, delay_s: f64, lag_s: f64) -> Delayed {
        let parts: Vec<f64> = match lag_s > 0.0 {
            true => (0..LAG_PARTS)
                .map(|part| delay_s + lag_s * quantile(part))
                .collect(),
            false => vec![delay_s],
        };
        let latest = parts.iter().copied().fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and small
        let past = self.half + (latest / self.step_s).ceil() as usize;
        let weight = |row: usize| -> f64 {
            let offset = (row as f64 - past as f64) * self.step_s;
            let at = parts.iter().map(|part| (offset + part) / self.half_width_s);
            at.map(window).sum()
        };
        // A torque that acts before its row is centred one row later.
        let weights: Vec<f64> = (0..=past + self.half + 1).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Delayed {
            past,
            weights: weights.iter().map(|weight| weight / sum).collect(),
        }
    }

    /// Standard deviation of the slope per standard deviation of white noise on the rows, 1/s.
    pub fn slope_noise(&self) -> f64 {
        self.slope
            .iter()
            .map(|weight| weight * weight)
            .sum::<f64>()
            .sqrt()
    }
}

/// Quantile of an exponential distribution of mean 1, in the middle of one of equal parts.
fn quantile(part: u32) -> f64 {
    -(1.0 - (f64::from(part) + 0.5) / f64::from(LAG_PARTS)).ln()
}

fn window(s: f64) -> f64 {
    match s.abs() < 1.0 {
        true => (1.0 - s * s).powi(POWER),
        false => 0.0,
    }
}

fn window_slope(s: f64) -> f64 {
    let p = f64::from(POWER);
    -2.0 * p * s * (1.0 - s * s).powi(POWER - 1)
}

fn window_curvature(s: f64) -> f64 {
    let p = f64::from(POWER);
    let inner = 1.0 - s * s;
    -2.0 * p * inner.powi(POWER - 1) + 4.0 * p * (p - 1.0) * s * s * inner.powi(POWER - 2)
}

/// Weights that give 1 for the `degree`-th derivative of `offset^degree / degree!`.
fn normalised(weights: Vec<f64>, offsets: &[f64], degree: i32) -> Vec<f64> {
    let factorial = f64::from((1..=degree).product::<i32>());
    let both = weights.iter().zip(offsets);
    let of_power: f64 = both.map(|(w, o)| w * o.powi(degree) / factorial).sum();
    weights.iter().map(|weight| weight / of_power).collect()
}

#[cfg(test)]
mod tests {
    use super::Kernel;

    fn applied(weights: &[f64], of: impl Fn(f64) -> f64, step_s: f64) -> f64 {
        let half = weights.len() / 2;
        let at = |row: usize| (row as f64 - half as f64) * step_s;
        weights
            .iter()
            .enumerate()
            .map(|(row, w)| w * of(at(row)))
            .sum()
    }

    #[test]
    fn derivatives_of_the_smoothed_wave_are_those_of_the_wave_times_one_factor() {
        let kernel = Kernel::new(0.08, 0.01);
        let omega = 8.0;
        let kept = applied(&kernel.value, |t| (omega * t).cos(), 0.01);
        let slope = applied(&kernel.slope, |t| (omega * t).sin(), 0.01) / omega;
        let curvature = applied(&kernel.curvature, |t| (omega * t).cos(), 0.01) / -omega.powi(2);
        assert!(kept > 0.95 && kept < 1.0, "{kept}");
        assert!((slope / kept - 1.0).abs() < 2e-3, "{slope} {kept}");
        assert!((curvature / kept - 1.0).abs() < 2e-3, "{curvature} {kept}");
    }

    #[test]
    fn a_constant_has_no_derivatives() {
        let kernel = Kernel::new(0.08, 0.005);
        for weights in [&kernel.slope, &kernel.curvature] {
            assert!(applied(weights, |_| 1e6, 0.005).abs() < 1e-3);
        }
    }

    #[test]
    fn a_delayed_channel_is_read_where_it_was_written() {
        let kernel = Kernel::new(0.08, 0.01);
        for (delay_s, lag_s) in [(0.03, 0.0), (0.0, 0.05), (0.005, 0.0)] {
            let delayed = kernel.delayed(delay_s, lag_s);
            let at = |row: usize| (row as f64 - delayed.past as f64) * 0.01;
            let weights = delayed.weights.iter().enumerate();
            let mean: f64 = weights.map(|(row, w)| w * at(row)).sum();
            assert!(
                (mean + delay_s + lag_s).abs() < 0.002,
                "{mean} {delay_s} {lag_s}"
            );
        }
    }
}

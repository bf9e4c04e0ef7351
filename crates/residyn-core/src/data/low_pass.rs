use std::f64::consts::PI;

/// Butterworth low-pass filter of order 4, run forwards and backwards over a channel: it has no phase shift.
///
/// Two second-order sections, by the bilinear transform with a prewarped cutoff. The ends are extended by point
/// reflection about the first and the last value, and the filter starts as if the value there had always been the same.
#[derive(Debug, Clone, Copy)]
pub struct LowPass {
    sections: [Section; 2],
}

/// y = b0 (x + 2 x' + x'') - a1 y' - a2 y''
#[derive(Debug, Clone, Copy)]
struct Section {
    b0: f64,
    a1: f64,
    a2: f64,
}

/// Number of values added beyond either end.
const BEYOND: usize = 15;

impl LowPass {
    /// A filter whose cutoff is this share of the sampling rate, below a half.
    pub fn new(cutoff: f64) -> Self {
        let k = (PI * cutoff).tan();
        // The poles of order 4 lie at pi/8 and 3 pi/8 from the real axis.
        let section = |angle: f64| {
            let damping = 2.0 * angle.cos() * k;
            let all = 1.0 + damping + k * k;
            Section {
                b0: k * k / all,
                a1: 2.0 * (k * k - 1.0) / all,
                a2: (1.0 - damping + k * k) / all,
            }
        };
        Self {
            sections: [section(PI / 8.0), section(3.0 * PI / 8.0)],
        }
    }

    /// The channel after both passes; of equal length.
    pub fn apply(&self, channel: &[f64]) -> Vec<f64> {
        let beyond = BEYOND.min(channel.len().saturating_sub(1));
        let (Some(first), Some(last)) = (channel.first(), channel.last()) else {
            return Vec::new();
        };
        let before = channel[1..=beyond].iter().rev().map(|x| 2.0 * first - x);
        let after = channel.iter().rev().skip(1).take(beyond);
        let after = after.map(|x| 2.0 * last - x);
        let mut all: Vec<f64> = before.chain(channel.iter().copied()).chain(after).collect();
        for _ in 0..2 {
            for section in &self.sections {
                section.run(&mut all);
            }
            all.reverse();
        }
        all[beyond..beyond + channel.len()].to_vec()
    }
}

impl Section {
    /// In place, from the steady state at the first value.
    fn run(&self, channel: &mut [f64]) {
        let Self { b0, a1, a2 } = *self;
        let first = channel.first().copied().unwrap_or(0.0);
        let (mut z1, mut z2) = (first * (1.0 - b0), first * (b0 - a2));
        for x in channel {
            let y = b0 * *x + z1;
            (z1, z2) = (2.0 * b0 * *x - a1 * y + z2, b0 * *x - a2 * y);
            *x = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::LowPass;

    #[test]
    fn a_sine_keeps_its_phase_and_loses_what_the_order_says() {
        let (cutoff, frequency) = (0.05, 0.05);
        let sine: Vec<f64> = (0..2000)
            .map(|k| (TAU * frequency * f64::from(k)).sin())
            .collect();
        let passed = LowPass::new(cutoff).apply(&sine);
        // Each of two passes halves the power at the cutoff.
        for k in 500..1500 {
            assert!((passed[k] - 0.5 * sine[k]).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn straight_lines_pass_unchanged() {
        let line: Vec<f64> = (0..100).map(|k| 3.0 + 0.1 * f64::from(k)).collect();
        let passed = LowPass::new(0.1).apply(&line);
        // The transient of the start has died away.
        for (passed, x) in passed.iter().zip(&line).take(70).skip(30) {
            assert!((passed - x).abs() < 1e-3);
        }
    }
}

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
/// Channels that are filtered side by side: each value of one waits for the value before it.
const ABREAST: usize = 8;

/// Values of channels side by side.
type Abreast<const W: usize> = [f64; W];

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
        self.abreast::<1>(&[channel]).swap_remove(0)
    }

    /// The same for channels of equal length.
    pub fn apply_to_all(&self, channels: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let channels: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
        let several = channels.chunks(ABREAST);
        several
            .flat_map(|some| self.abreast::<ABREAST>(some))
            .collect()
    }

    /// The same for at most `W` channels, and at least one.
    fn abreast<const W: usize>(&self, channels: &[&[f64]]) -> Vec<Vec<f64>> {
        let length = channels[0].len();
        let Some(last) = length.checked_sub(1) else {
            return vec![Vec::new(); channels.len()];
        };
        let at = |row: usize| -> Abreast<W> {
            std::array::from_fn(|lane| channels[lane.min(channels.len() - 1)][row])
        };
        let reflected = |about: usize, row: usize| -> Abreast<W> {
            let (about, at) = (at(about), at(row));
            std::array::from_fn(|lane| 2.0 * about[lane] - at[lane])
        };
        let beyond = BEYOND.min(last);
        let before = (1..=beyond).rev().map(|row| reflected(0, row));
        let after = (1..=beyond).map(|row| reflected(last, last - row));
        let inside = (0..length).map(at);
        let mut rows: Vec<Abreast<W>> = before.chain(inside).chain(after).collect();
        self.pass(rows.iter_mut());
        self.pass(rows.iter_mut().rev());
        let of_lane = |lane: usize| {
            rows[beyond..=beyond + last]
                .iter()
                .map(|row| row[lane])
                .collect()
        };
        (0..channels.len()).map(of_lane).collect()
    }

    /// One pass, in place, from the steady state at the first value.
    fn pass<'r, const W: usize>(&self, mut rows: impl Iterator<Item = &'r mut Abreast<W>>) {
        let Some(first) = rows.next() else { return };
        let mut states = self.sections.map(|section| {
            let mut state = section.steady(first);
            section.step(&mut state, first);
            state
        });
        for row in rows {
            for (section, state) in self.sections.iter().zip(&mut states) {
                section.step(state, row);
            }
        }
    }
}

/// What a section keeps of earlier values.
type State<const W: usize> = [Abreast<W>; 2];

impl Section {
    /// The state after the same values for ever.
    fn steady<const W: usize>(&self, values: &Abreast<W>) -> State<W> {
        [
            values.map(|value| value * (1.0 - self.b0)),
            values.map(|value| value * (self.b0 - self.a2)),
        ]
    }

    /// Replace values by those that the section gives.
    #[inline(always)]
    fn step<const W: usize>(&self, [z1, z2]: &mut State<W>, values: &mut Abreast<W>) {
        for lane in 0..W {
            let (x, y) = (values[lane], self.b0 * values[lane] + z1[lane]);
            z1[lane] = 2.0 * self.b0 * x - self.a1 * y + z2[lane];
            z2[lane] = self.b0 * x - self.a2 * y;
            values[lane] = y;
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

    #[test]
    fn channels_side_by_side_pass_as_each_does_alone() {
        let channel = |k: usize| -> Vec<f64> {
            (0..60)
                .map(|row| ((k + 1) as f64 * row as f64).sin())
                .collect()
        };
        let channels: Vec<Vec<f64>> = (0..11).map(channel).collect();
        let filter = LowPass::new(0.1);
        let alone: Vec<Vec<f64>> = channels
            .iter()
            .map(|channel| filter.apply(channel))
            .collect();
        assert_eq!(filter.apply_to_all(&channels), alone);
        assert_eq!(
            filter.apply_to_all(&vec![Vec::new(); 2]),
            vec![Vec::<f64>::new(); 2]
        );
    }
}

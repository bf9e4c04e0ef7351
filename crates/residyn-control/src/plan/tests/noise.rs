use std::f64::consts::TAU;

use statrs::distribution::{ContinuousCDF, Normal};

use super::rng;
use crate::plan::gaussian::Gaussian;
use crate::plan::noise::Noise;
use residyn_core::lanes::Arch;
use residyn_core::sim::batch::{Rows, W};

#[test]
fn random_numbers_follow_the_standard_normal_distribution() {
    let (mut rng, mut rows) = (rng(7), vec![Rows::splat(0.0); 3]);
    let mut gaussian = Gaussian::new(rows.len());
    let mut all = Vec::new();
    for _ in 0..2000 {
        gaussian.fill(Arch::new(), &mut rng, &mut rows);
        all.extend(rows.iter().flat_map(|row| row.0.map(f64::from)));
    }
    let count = all.len() as f64;
    let moment = |k: i32| all.iter().map(|x| x.powi(k)).sum::<f64>() / count;
    // Five standard errors of each moment of 192 000 numbers.
    for (k, (wanted, variance)) in [(0.0, 1.0), (1.0, 2.0), (0.0, 15.0), (3.0, 96.0)]
        .into_iter()
        .enumerate()
    {
        let found = moment(k as i32 + 1);
        let error = 5.0 * f64::sqrt(variance / count);
        assert!((found - wanted).abs() < error, "moment {}: {found}", k + 1);
    }
    all.sort_by(f64::total_cmp);
    let normal = Normal::standard();
    let distance = (all.iter().enumerate())
        .map(|(k, x)| (normal.cdf(*x) - k as f64 / count).abs())
        .fold(0.0, f64::max);
    // Kolmogorov and Smirnov's statistic at one in a thousand.
    assert!(distance < 1.95 / count.sqrt(), "{distance}");
    // Neighbours, in lanes and in rows, are uncorrelated.
    let product = rows
        .windows(2)
        .flat_map(|pair| (0..W).map(move |l| pair[0][l] * pair[1][l]));
    assert!(product.sum::<f32>().abs() < 5.0 * (2.0 * W as f32).sqrt());
}

#[test]
fn coloured_numbers_have_their_spectrum() {
    const STEPS: usize = 15;
    const EXPONENT: f64 = 2.0;
    let (mut rng, mut rows) = (rng(10), vec![Rows::splat(0.0); 2 * STEPS]);
    let mut noise = Noise::coloured(STEPS, 2, EXPONENT);
    let blocks = 500;
    let count = (blocks * W) as f64;
    let (mut power, mut variance, mut shared) = ([0.0; 8], [0.0; STEPS], 0.0);
    for _ in 0..blocks {
        noise.fill(Arch::new(), &mut rng, &mut rows);
        for lane in 0..W {
            let of = |input: usize| -> Vec<f64> {
                let own = rows.iter().skip(input).step_by(2);
                own.map(|row| f64::from(row[lane])).collect()
            };
            let (sequence, other) = (of(0), of(1));
            for (frequency, power) in power.iter_mut().enumerate() {
                let wave = |shift: f64| {
                    let angle = |step: usize| TAU * (frequency * step) as f64 / STEPS as f64;
                    let terms = sequence.iter().enumerate();
                    terms
                        .map(|(t, x)| x * (angle(t) - shift).cos())
                        .sum::<f64>()
                };
                *power += (wave(0.0).powi(2) + wave(TAU / 4.0).powi(2)) / count;
            }
            for (sum, x) in variance.iter_mut().zip(&sequence) {
                *sum += x * x / count;
            }
            shared += sequence[3] * other[3] / count;
        }
    }
    for (frequency, found) in power.iter().enumerate().skip(1) {
        let ratio = found / power[1] * (frequency as f64).powf(EXPONENT);
        // Five standard errors of a ratio of two exponential means.
        assert!(
            (ratio - 1.0).abs() < 5.0 * (2.0 / count).sqrt(),
            "{frequency}: {ratio}"
        );
    }
    // The constant wave is as strong as each of the two slowest.
    let ratio = power[0] / power[1];
    assert!((ratio - 1.0).abs() < 5.0 * (3.0 / count).sqrt(), "{ratio}");
    for found in variance {
        assert!((found - 1.0).abs() < 5.0 * (2.0 / count).sqrt(), "{found}");
    }
    assert!(shared.abs() < 5.0 / count.sqrt(), "{shared}");
}

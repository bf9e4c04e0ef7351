mod additive;
mod basis;

use nalgebra::DVector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::additive::Additive;
use self::basis::Basis;
use super::force::ForceSample;
use crate::closeloop::settings::CurveSettings;
use crate::data::Joint;
use crate::identify::{BLOCK_S, blocks_of_times};

/// The residual force of a joint as a smooth curve over one variable, without the contributions of the other variables.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    pub joint: Joint,
    /// `q1`, `qd1`, `tau1` or `t`.
    pub variable: String,
    /// The unit of the variable.
    pub unit: String,
    #[schemars(length(min = 2))]
    pub x: Vec<f64>,
    /// In N m (or N).
    #[schemars(length(min = 2))]
    pub force: Vec<f64>,
    /// Limits of the pointwise 95 % confidence band.
    #[schemars(length(min = 2))]
    pub low: Vec<f64>,
    #[schemars(length(min = 2))]
    pub high: Vec<f64>,
}

/// A variable that a force may depend on: its name, its units on a turning joint and on a sliding joint, and its value.
type Variable = (
    &'static str,
    [&'static str; 2],
    fn(&ForceSample, Joint) -> f64,
);

const VARIABLES: [Variable; 4] = [
    ("q", ["rad", "m"], |sample, joint| sample.q[joint]),
    ("qd", ["rad/s", "m/s"], |sample, joint| sample.qd[joint]),
    ("tau", ["N m", "N"], |sample, joint| sample.tau[joint]),
    ("t", ["s", "s"], |sample, _| sample.time_s),
];

/// One curve for each joint and each variable that takes more than one value; no curves if the logs are too short to
/// give a confidence band. The curves of a joint are fitted together, so that no curve takes on the shape of another.
pub(super) fn curves(
    samples: &[ForceSample],
    prismatic: &[bool],
    settings: &CurveSettings,
) -> Vec<Curve> {
    let blocks = blocks_of_times(samples.iter().map(|s| (s.log, s.time_s)), BLOCK_S);
    let are_few = |last: &usize| last + 1 < settings.fewest_blocks;
    if blocks.last().is_none_or(are_few) {
        return Vec::new();
    }
    Joint::all(prismatic.len())
        .flat_map(|joint| of_joint(samples, &blocks, joint, prismatic[joint], settings))
        .collect()
}

fn of_joint(
    samples: &[ForceSample],
    blocks: &[usize],
    joint: Joint,
    prismatic: bool,
    settings: &CurveSettings,
) -> Vec<Curve> {
    let over = |variable: &'static Variable| {
        let values = samples.iter().map(|sample| variable.2(sample, joint));
        Some((variable, Basis::over(values.collect(), settings.quantiles)?))
    };
    let bases: Vec<(&Variable, Basis)> = VARIABLES.iter().filter_map(over).collect();
    let forces = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.force[joint]));
    let shapes: Vec<&Basis> = bases.iter().map(|(_, basis)| basis).collect();
    let Some(fit) = Additive::fit(&shapes, &forces, blocks, settings) else {
        return Vec::new();
    };
    let curve = |(k, ((name, units, _), basis)): (usize, &(&Variable, Basis))| {
        let numbered = match *name {
            "t" => "t".to_owned(),
            stem => joint.name(stem),
        };
        let mut curve = Curve {
            joint,
            variable: numbered,
            unit: units[usize::from(prismatic)].to_owned(),
            x: Vec::new(),
            force: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
        };
        for x in basis.points(settings.points) {
            let (force, half) = fit.at(k, basis, x);
            curve.x.push(x);
            curve.force.push(force);
            curve.low.push(force - half);
            curve.high.push(force + half);
        }
        curve
    };
    bases.iter().enumerate().map(curve).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// The noise of neighbouring blocks is correlated.
    fn samples(force: fn(f64, f64) -> f64, noise: f64, rng: &mut impl Rng) -> Vec<ForceSample> {
        let mut carried = 0.0;
        (0..400)
            .map(|i| {
                let t = 0.15 * f64::from(i);
                let fresh: f64 = StandardNormal.sample(rng);
                carried = 0.5 * carried + fresh;
                let (q, qd) = (
                    rng.random_range(-1.5..1.5),
                    (2.0 * t).sin() * rng.random_range(0.0..6.0),
                );
                ForceSample {
                    log: i as usize / 100,
                    time_s: t,
                    q: vec![q],
                    qd: vec![qd],
                    tau: vec![0.0],
                    force: vec![force(q, qd) + noise * carried],
                }
            })
            .collect()
    }

    #[test]
    fn a_constant_variable_has_no_curve() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let found = curves(
            &samples(|q, _| q, 0.1, &mut rng),
            &[false],
            &CurveSettings::default(),
        );
        let names: Vec<&str> = found.iter().map(|c| c.variable.as_str()).collect();
        assert_eq!(names, ["q1", "qd1", "t"]);
        let points = CurveSettings::default().points;
        assert!(found.iter().all(|c| c.x.len() == points));
    }

    #[test]
    fn bands_cover_the_force_and_each_curve_shows_its_own_variable() {
        let force = |_: f64, qd: f64| -0.002 * qd.powi(3) + 0.05 * (1.3 * qd).sin();
        let (mut held, mut all, mut off) = (0, 0, 0.0_f64);
        for seed in 0..30 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let samples = samples(force, 0.05, &mut rng);
            let mean = samples.iter().map(|s| force(0.0, s.qd[0])).sum::<f64>() / 400.0;
            for curve in curves(&samples, &[false], &CurveSettings::default()) {
                for (i, &x) in curve.x.iter().enumerate() {
                    let truth = if curve.variable == "qd1" {
                        force(0.0, x)
                    } else {
                        mean
                    };
                    let holds = curve.low[i] <= truth && truth <= curve.high[i];
                    (held, all) = (held + usize::from(holds), all + 1);
                    if curve.variable == "q1" {
                        off = off.max((curve.force[i] - mean).abs());
                    }
                }
            }
        }
        let share = held as f64 / all as f64;
        println!("{share} {off}");
        assert!((0.85..0.995).contains(&share), "{share}");
        // The force itself is up to 0.45 N m.
        assert!(off < 0.1, "{off}");
    }
}

//! The search for a motion as a function of its coefficients: the cost of what it leaves unknown, and the limits.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use residyn_core::decomposition::least_squares;
use residyn_core::model::Model;

use crate::balance::{Along, Balance, Weights};
use crate::bounds::{Bounds, Use};
use crate::clearance::Clearance;
use crate::criterion::Criterion;
use crate::descent::Value;
use crate::error::ExciteError;
use crate::fourier::{Grid, Motion, Series};
use crate::limits::Limits;
use crate::parameters::{Base, Parameters};

/// Rows of the search in one period of the highest frequency.
const ROWS_A_PERIOD: usize = 8;
/// Rows between two of the trajectory on which limits are checked.
const FINER: usize = 4;
/// Random states by which the sums that any motion shows are found.
const STATES: usize = 400;
/// Starts that are tried where the rig cannot rest in the middle.
const TRIED: usize = 500;
/// Evidence that counts as none.
pub const NO_EVIDENCE: f64 = 1e-6;
/// Singular values below this share of the largest one are rounding.
const ROUNDING: f64 = 1e-10;
/// Overlap of spheres that counts like the excess of a limit by all of it, m.
const DEEP_M: f64 = 0.1;
/// Halvings of the interval in which the largest admissible size of a motion is sought.
const HALVINGS: usize = 14;

/// Motions of one rig within limits, and what they tell.
pub struct Problem {
    pub series: Series,
    pub balance: Balance,
    pub parameters: Parameters,
    /// What any motion can show.
    pub base: Base,
    pub bounds: Bounds,
    pub clearance: Clearance,
    /// 1 / noise^2 of each joint's torque.
    weights: Vec<f64>,
    criterion: Criterion,
    grid: Grid,
    /// Rows of the trajectory over rows of the search.
    rows_of_one: f64,
    fine: Grid,
    /// The share of a limit that samples may use, so that the motion between them keeps it.
    between: f64,
    /// Whether each joint's start is given.
    is_start_given: Vec<bool>,
    /// Angles at which the rig can rest, towards which motions are made smaller.
    rest: Vec<f64>,
    ranges: Vec<[f64; 2]>,
}

/// What a motion tells.
pub struct Told {
    /// On all columns, in units of their magnitudes.
    pub information: DMatrix<f64>,
    /// For each alternative in the balance, the squared difference over the noise that no parameter explains.
    pub evidence: Vec<f64>,
}

impl Problem {
    /// Motions of `duration_s` with at most `harmonics` harmonics.
    ///
    /// # Errors
    /// A model without a free parameter that shows, or one that needs logs.
    pub fn new(
        model: &Model,
        alternatives: &[Model],
        limits: &Limits,
        duration_s: f64,
        (harmonics, criterion): (Series, Criterion),
        rng: &mut impl Rng,
    ) -> Result<Self, ExciteError> {
        let series = harmonics;
        let parameters = Parameters::of(model);
        if parameters.active.is_empty() {
            return Err(ExciteError::NothingFree);
        }
        let balance = Balance::new(model, &parameters.active, alternatives)?;
        let rows = limits.rows(duration_s).ok_or(ExciteError::Duration {
            duration_s,
            step_s: limits.step_s,
        })?;
        let top = series.harmonics.last().copied().unwrap_or(1);
        let searched = ROWS_A_PERIOD * top + 1;
        let fine = series.even_grid(FINER * (rows - 1) + 1);
        let fine_step_s = limits.step_s / FINER as f64;
        let mut problem = Self {
            grid: series.even_grid(searched),
            rows_of_one: rows as f64 / searched as f64,
            fine,
            // |p| <= max |p(t_k)| / cos(w h / 2) for a trigonometric polynomial of highest frequency w (Ehlich and Zeller
            // 1964); torques have products of two, with up to twice that frequency.
            between: (series.highest() * fine_step_s).min(1.0).cos(),
            weights: torque_noise(model, limits)
                .iter()
                .map(|noise| noise.powi(-2))
                .collect(),
            bounds: Bounds::of(limits),
            clearance: Clearance::of(model, limits),
            is_start_given: limits
                .joints
                .iter()
                .map(|joint| joint.start.is_some())
                .collect(),
            rest: (limits.joints.iter())
                .map(|joint| {
                    joint
                        .start
                        .unwrap_or((joint.angle[0] + joint.angle[1]) / 2.0)
                })
                .collect(),
            ranges: limits.joints.iter().map(|joint| joint.angle).collect(),
            base: Base {
                columns: Vec::new(),
                sums: Vec::new(),
            },
            series,
            balance,
            parameters,
            criterion,
        };
        problem.base = problem.base_of_states(limits, rng)?;
        match problem.base.columns.is_empty() {
            true => return Err(ExciteError::NothingShown),
            false => problem.rest = problem.start(rng)?,
        }
        Ok(problem)
    }

    /// What random states within the limits show.
    fn base_of_states(&self, limits: &Limits, rng: &mut impl Rng) -> Result<Base, ExciteError> {
        let mut motion: Motion = Default::default();
        for _ in 0..STATES {
            for joint in &limits.joints {
                let jerk = joint.acceleration.powi(2) / joint.speed;
                motion[0].push(rng.random_range(joint.angle[0]..joint.angle[1]));
                for (all, most) in
                    motion[1..]
                        .iter_mut()
                        .zip([joint.speed, joint.acceleration, jerk])
                {
                    all.push(rng.random_range(-most..most));
                }
            }
        }
        let mut along = self.balance.along(&vec![0.0; STATES], &motion);
        let entries = self.balance.entries.len();
        let mut is_driven = entries == 0;
        for slopes in along.slopes.chunks_exact_mut(entries.max(1)) {
            match slopes.iter().all(|slope| slope.is_finite()) {
                true => is_driven = true,
                // No command holds the model there, as beyond a motor's saturation: the state shows nothing.
                false => slopes.fill(0.0),
            }
        }
        if !is_driven {
            return Err(ExciteError::NotFinite);
        }
        let all: Vec<usize> = (0..self.parameters.active.len()).collect();
        let regressor = self.regressor(&along, &all);
        Ok(self.parameters.independent(&regressor))
    }

    fn joints(&self) -> usize {
        self.balance.joints
    }

    /// The slopes of these columns in units of their magnitudes, over the noise: one row for each row and joint.
    fn regressor(&self, along: &Along, columns: &[usize]) -> DMatrix<f64> {
        let n = self.joints();
        let place: Vec<Option<usize>> = (0..self.parameters.active.len())
            .map(|column| columns.iter().position(|own| *own == column))
            .collect();
        let entries = &self.balance.entries;
        let rows = along.drive.command.len() / n;
        let mut regressor = DMatrix::zeros(rows * n, columns.len());
        for (row, slopes) in along.slopes.chunks_exact(entries.len().max(1)).enumerate() {
            for ((joint, column), slope) in entries.iter().zip(slopes) {
                if let Some(at) = place[*column] {
                    let unit = self.parameters.sizes[*column] * self.weights[*joint].sqrt();
                    regressor[(row * n + joint, at)] = slope * unit;
                }
            }
        }
        regressor
    }

    /// The difference under one alternative, over the noise.
    fn difference(&self, along: &Along, alternative: usize) -> DVector<f64> {
        let (n, count) = (self.joints(), self.balance.alternatives);
        let rows = along.drive.command.len() / n;
        DVector::from_fn(rows * n, |k, _| {
            let (row, joint) = (k / n, k % n);
            along.differences[(row * count + alternative) * n + joint] * self.weights[joint].sqrt()
        })
    }

    /// What the motion with these coefficients tells, on the rows of the search.
    pub fn told(&self, coefficients: &[f64]) -> Told {
        let motion = self.series.motion(&self.grid, coefficients);
        let along = self.balance.along(&self.grid.times, &motion);
        self.told_along(&along, self.rows_of_one)
    }

    /// What rows of a motion tell, each of which stands for `rows_of_one` rows of a log.
    pub fn told_along(&self, along: &Along, rows_of_one: f64) -> Told {
        let all: Vec<usize> = (0..self.parameters.active.len()).collect();
        let regressor = self.regressor(along, &all);
        let own = regressor.select_columns(&self.base.columns);
        let information = own.tr_mul(&own);
        let evidence = (0..self.balance.alternatives).map(|k| {
            let difference = self.difference(along, k);
            rows_of_one
                * unexplained(&own, &information, &difference)
                    .map_or(f64::NAN, |rest| rest.norm_squared())
        });
        Told {
            evidence: evidence.collect(),
            information: regressor.tr_mul(&regressor) * rows_of_one,
        }
    }

    /// The information of rows, of which these count, on all columns in units of their magnitudes.
    pub fn information(&self, along: &Along, counts: &[bool]) -> DMatrix<f64> {
        let regressor = self.counted(along, counts);
        regressor.tr_mul(&regressor)
    }

    /// The regressor of all columns without the rows that do not count (`[row * joints + joint]`).
    fn counted(&self, along: &Along, counts: &[bool]) -> DMatrix<f64> {
        let all: Vec<usize> = (0..self.parameters.active.len()).collect();
        let mut regressor = self.regressor(along, &all);
        for (row, counts) in counts.iter().enumerate() {
            if !counts {
                regressor.row_mut(row).fill(0.0);
            }
        }
        regressor
    }

    /// What the best fit of the base leaves of a difference of torques, N m (or N); zero where rows do not count.
    pub fn left_by_fit(&self, along: &Along, difference: &[f64], counts: &[bool]) -> Vec<f64> {
        let n = self.joints();
        let regressor = self.counted(along, counts);
        let own = regressor.select_columns(&self.base.columns);
        let scaled = DVector::from_fn(difference.len(), |k, _| match counts[k] {
            true => difference[k] * self.weights[k % n].sqrt(),
            false => 0.0,
        });
        let explained = least_squares(own.clone(), &scaled, ROUNDING);
        let left = explained.map_or(scaled.clone(), |explained| scaled - own * explained);
        let unscaled = left
            .iter()
            .enumerate()
            .map(|(k, value)| value / self.weights[k % n].sqrt());
        unscaled.collect()
    }

    /// Take each joint's torque to have this noise, N m (or N).
    pub fn weigh_by(&mut self, noise: &[f64]) {
        self.weights = noise.iter().map(|noise| noise.powi(-2)).collect();
    }

    /// The information of a motion that is run through this many times more slowly, as far as the duration reaches.
    pub fn information_slowed(&self, coefficients: &[f64], slower: f64) -> DMatrix<f64> {
        let rows = self.grid.times.len();
        let step_s = self.series.duration_s / (rows - 1) as f64 / slower;
        let slowed = self
            .series
            .grid((0..rows).map(|row| row as f64 * step_s).collect());
        let mut motion = self.series.motion(&slowed, coefficients);
        for (power, channel) in motion.iter_mut().enumerate() {
            channel
                .iter_mut()
                .for_each(|value| *value /= slower.powi(power as i32));
        }
        let along = self.balance.along(&slowed.times, &motion);
        self.information(&along, &vec![true; along.drive.torque.len()]) * self.rows_of_one
    }

    /// The evidence for a difference of torques (`[row * joints + joint]`, N m or N) that is given along these rows.
    pub fn evidence_of(&self, along: &Along, difference: &[f64], rows_of_one: f64) -> f64 {
        let n = self.joints();
        let own = self.regressor(along, &self.base.columns);
        let information = own.tr_mul(&own);
        let scaled = DVector::from_fn(difference.len(), |k, _| {
            difference[k] * self.weights[k % n].sqrt()
        });
        let rest = unexplained(&own, &information, &scaled);
        rows_of_one * rest.map_or(f64::NAN, |rest| rest.norm_squared())
    }

    /// The cost of a motion and its gradient: the criterion, minus the logarithm of the least evidence (smoothed: of the
    /// harmonic sum), plus `strictness` times the squared excess of limits.
    pub fn value(&self, coefficients: &[f64], strictness: f64) -> Value {
        let motion = self.series.motion(&self.grid, coefficients);
        let along = self.balance.along(&self.grid.times, &motion);
        let (excess, mut by_motion, by_drive) = self.bounds.excess(&motion, &along.drive);
        let (cost, by_regressor, by_difference) = self.cost(&along)?;
        let overlap = self.overlap(&motion, &mut by_motion);
        let cost = cost + strictness * (excess + overlap);
        if !cost.is_finite() {
            return None;
        }
        let scaled =
            |part: &Vec<f64>| -> Vec<f64> { part.iter().map(|slope| strictness * slope).collect() };
        let mut drive = by_drive;
        drive
            .parts_mut()
            .into_iter()
            .for_each(|part| *part = scaled(part));
        let by_motion = by_motion.each_ref().map(scaled);
        let weights = Weights {
            drive,
            slopes: self.entry_weights(&by_regressor),
            differences: by_difference,
        };
        let mut through = self.balance.pull_back(&self.grid.times, &motion, &weights);
        for (all, direct) in through.iter_mut().zip(&by_motion) {
            all.iter_mut()
                .zip(direct)
                .for_each(|(all, direct)| *all += direct);
        }
        let mut gradient = self.series.pull_back(&self.grid, &through);
        for (slope, is_given) in gradient.iter_mut().zip(&self.is_start_given) {
            if *is_given {
                *slope = 0.0;
            }
        }
        gradient
            .iter()
            .all(|slope| slope.is_finite())
            .then_some((cost, gradient))
    }

    /// The cost of what rows leave unknown, and its derivatives with respect to the regressor of the base and to the
    /// differences under the alternatives (as in [`Along`]).
    fn cost(&self, along: &Along) -> Option<(f64, DMatrix<f64>, Vec<f64>)> {
        let regressor = self.regressor(along, &self.base.columns);
        let information = regressor.tr_mul(&regressor) * self.rows_of_one;
        let (mut cost, by_information) = (self.criterion)(&information)?;
        let mut by_regressor = &regressor * by_information * (2.0 * self.rows_of_one);
        let (n, count) = (self.joints(), self.balance.alternatives);
        let mut by_difference = vec![0.0; along.differences.len()];
        if count == 0 {
            return Some((cost, by_regressor, by_difference));
        }
        let factor = information.cholesky()?;
        let mut rests = Vec::new();
        for alternative in 0..count {
            let difference = self.difference(along, alternative);
            let explained = factor.solve(&(regressor.tr_mul(&difference) * self.rows_of_one));
            let rest = &difference - &regressor * &explained;
            let evidence = self.rows_of_one * rest.norm_squared() + NO_EVIDENCE;
            rests.push((evidence, rest, explained));
        }
        let sum: f64 = rests.iter().map(|(evidence, ..)| evidence.recip()).sum();
        cost += sum.ln();
        for (alternative, (evidence, rest, explained)) in rests.iter().enumerate() {
            let by_evidence = -evidence.powi(-2) / sum;
            let share = 2.0 * self.rows_of_one * by_evidence;
            by_regressor -= rest * explained.transpose() * share;
            for (k, rest) in rest.iter().enumerate() {
                let (row, joint) = (k / n, k % n);
                by_difference[(row * count + alternative) * n + joint] =
                    share * rest * self.weights[joint].sqrt();
            }
        }
        Some((cost, by_regressor, by_difference))
    }

    /// Weights of the slopes from the derivatives with respect to the regressor of the base.
    fn entry_weights(&self, by_regressor: &DMatrix<f64>) -> Vec<f64> {
        let n = self.joints();
        let place: Vec<Option<usize>> = (0..self.parameters.active.len())
            .map(|column| self.base.columns.iter().position(|own| *own == column))
            .collect();
        let rows = by_regressor.nrows() / n;
        let weight = |row: usize, (joint, column): &(usize, usize)| {
            let unit = self.parameters.sizes[*column] * self.weights[*joint].sqrt();
            place[*column].map_or(0.0, |at| by_regressor[(row * n + joint, at)] * unit)
        };
        (0..rows)
            .flat_map(|row| {
                self.balance
                    .entries
                    .iter()
                    .map(move |entry| weight(row, entry))
            })
            .collect()
    }

    /// The mean square of the overlap of spheres, whose gradient is added.
    fn overlap(&self, motion: &Motion, by_motion: &mut Motion) -> f64 {
        if !self.clearance.is_needed() {
            return 0.0;
        }
        let n = self.joints();
        let rows = motion[0].len() / n;
        let cost = |q: &[f64]| -> f64 {
            let overlaps = self
                .clearance
                .distances(q)
                .into_iter()
                .map(|d| (-d / DEEP_M).max(0.0));
            overlaps.map(|overlap| overlap.powi(2)).sum::<f64>() / rows as f64
        };
        let mut sum = 0.0;
        for (q, slopes) in motion[0]
            .chunks_exact(n)
            .zip(by_motion[0].chunks_exact_mut(n))
        {
            let here = cost(q);
            sum += here;
            if here > 0.0 {
                let mut shifted = q.to_vec();
                for joint in 0..n {
                    const STEP: f64 = 1e-6;
                    shifted[joint] = q[joint] + STEP;
                    slopes[joint] += (cost(&shifted) - here) / STEP;
                    shifted[joint] = q[joint];
                }
            }
        }
        sum
    }

    /// How much of the limits the motion uses, checked finer than its rows.
    pub fn uses(&self, coefficients: &[f64]) -> Vec<Use> {
        self.uses_on(&self.fine, coefficients)
    }

    fn uses_on(&self, grid: &Grid, coefficients: &[f64]) -> Vec<Use> {
        let motion = self.series.motion(grid, coefficients);
        let drive = self.balance.drive(&grid.times, &motion);
        self.bounds.uses(&motion, &drive)
    }

    /// Whether a motion keeps all limits on a grid, and between its samples.
    fn is_within(&self, grid: &Grid, coefficients: &[f64]) -> bool {
        let motion = self.series.motion(grid, coefficients);
        let drive = self.balance.drive(&grid.times, &motion);
        let uses = self.bounds.uses(&motion, &drive);
        uses.iter().all(|one| one.share <= self.between) && self.is_clear(&motion)
    }

    /// Whether the spheres keep off at each row, by more than they move from row to row.
    fn is_clear(&self, motion: &Motion) -> bool {
        if !self.clearance.is_needed() {
            return true;
        }
        let rows: Vec<Vec<f64>> = (motion[0].chunks_exact(self.joints()))
            .map(|q| self.clearance.distances(q))
            .collect();
        let pairs = rows
            .windows(2)
            .flat_map(|pair| pair[0].iter().zip(&pair[1]));
        let mut all =
            pairs.map(|(before, after)| before.min(*after) > (before - after).abs() / 2.0);
        all.all(|is_clear| is_clear)
    }

    /// The least distance between spheres, or between them and boxes, along a motion, m.
    pub fn least_distance(&self, coefficients: &[f64]) -> Option<f64> {
        let motion = self.series.motion(&self.fine, coefficients);
        let rows = motion[0].chunks_exact(self.joints());
        rows.flat_map(|q| self.clearance.distances(q))
            .reduce(f64::min)
    }

    /// The same motion, made so much smaller, towards rest, that it keeps all limits.
    pub fn within(&self, coefficients: &[f64]) -> Vec<f64> {
        self.within_on(&self.fine, coefficients)
    }

    fn within_on(&self, grid: &Grid, coefficients: &[f64]) -> Vec<f64> {
        let rest = self.rest.iter().copied().chain(std::iter::repeat(0.0));
        let parts: Vec<(f64, f64)> = rest.zip(coefficients.iter().copied()).collect();
        let sized = |share: f64| -> Vec<f64> {
            let of = |(rest, full): &(f64, f64)| rest + share * (full - rest);
            parts.iter().map(of).collect()
        };
        if self.is_within(grid, coefficients) {
            return coefficients.to_vec();
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            match self.is_within(grid, &sized(middle)) {
                true => low = middle,
                false => high = middle,
            }
        }
        sized(low)
    }

    /// A random motion that reaches a limit, on the rows of the search: phases and amplitudes differ between joints.
    pub fn random(&self, rng: &mut impl Rng) -> Vec<f64> {
        let all: Vec<usize> = (0..self.joints()).collect();
        self.random_of(&all, rng)
    }

    /// The same with these joints in motion alone.
    pub fn random_of(&self, joints: &[usize], rng: &mut impl Rng) -> Vec<f64> {
        let mut coefficients = self.rest.clone();
        let functions = self.series.functions() as f64;
        let more = self.series.coefficients() - coefficients.len();
        coefficients.extend((0..more).map(|_| {
            let normal: f64 = StandardNormal.sample(rng);
            LARGE * normal / functions.sqrt()
        }));
        let own = coefficients[self.joints()..].chunks_exact_mut(self.series.functions());
        for (joint, own) in own.enumerate() {
            if !joints.contains(&joint) {
                own.fill(0.0);
            }
        }
        self.within_on(&self.grid, &coefficients)
    }

    /// Where a motion can begin: the given start, or the middle, or any other angles.
    fn start(&self, rng: &mut impl Rng) -> Result<Vec<f64>, ExciteError> {
        let fault = |start: &[f64]| -> Option<String> {
            let mut coefficients = start.to_vec();
            coefficients.resize(self.series.coefficients(), 0.0);
            let grid = self.series.grid(vec![0.0, self.series.duration_s]);
            let motion = self.series.motion(&grid, &coefficients);
            let drive = self.balance.drive(&grid.times, &motion);
            if drive
                .parts()
                .into_iter()
                .flatten()
                .any(|value| !value.is_finite())
            {
                return Some("what it would take is not a finite number".to_owned());
            }
            let mut uses = self.bounds.uses(&motion, &drive).into_iter();
            let broken = uses.find(|one| !(one.share <= self.between));
            let broken = broken.map(|one| {
                let Use {
                    joint,
                    quantity,
                    share,
                } = one;
                format!(
                    "joint {joint} would take {:.0} % of its {quantity}",
                    100.0 * share
                )
            });
            let touch = || "spheres touch there".to_owned();
            broken.or_else(|| (!self.is_clear(&motion)).then(touch))
        };
        let Some(first) = fault(&self.rest) else {
            return Ok(self.rest.clone());
        };
        for _ in 0..TRIED {
            let other: Vec<f64> = (0..self.joints())
                .map(|joint| match self.is_start_given[joint] {
                    true => self.rest[joint],
                    false => rng.random_range(self.ranges[joint][0]..self.ranges[joint][1]),
                })
                .collect();
            if fault(&other).is_none() {
                return Ok(other);
            }
        }
        Err(ExciteError::Rest(first))
    }
}

/// Amplitudes of random motions before they are made smaller: beyond every limit.
const LARGE: f64 = 3.0;

/// What is left of a difference when the parameters explain as much of it as they can.
fn unexplained(
    regressor: &DMatrix<f64>,
    information: &DMatrix<f64>,
    difference: &DVector<f64>,
) -> Option<DVector<f64>> {
    let factor = information.clone().cholesky()?;
    let explained = factor.solve(&regressor.tr_mul(difference));
    Some(difference - regressor * explained)
}

/// The noise of each joint's torque, N m (or N): its own and, where a drive's law says the torque, that of the angle that
/// the law reads.
pub fn torque_noise(model: &Model, limits: &Limits) -> Vec<f64> {
    let stiffness = stiffness(model, limits);
    let joints = limits.joints.iter().zip(stiffness);
    joints
        .map(|(joint, stiffness)| joint.torque_noise.hypot(stiffness * joint.encoder_noise))
        .collect()
}

/// By how much the torque of each joint's drive changes with its angle, N m/rad (or N/m), in the middle of its range.
fn stiffness(model: &Model, limits: &Limits) -> Vec<f64> {
    let n = model.joints;
    let Some(law) = model.drive_program() else {
        return vec![0.0; n];
    };
    let middle: Vec<f64> = (limits.joints.iter())
        .map(|joint| (joint.angle[0] + joint.angle[1]) / 2.0)
        .collect();
    let values: Vec<f64> = model
        .parameters
        .iter()
        .map(|parameter| parameter.value)
        .collect();
    let torque = |joint: usize, by: f64| {
        let mut q = middle.clone();
        q[joint] += by;
        law.eval(&[&q[..], &vec![0.0; n], &middle, &[0.0], &values].concat())[joint]
    };
    const STEP: f64 = 1e-6;
    (0..n)
        .map(|joint| (torque(joint, STEP) - torque(joint, -STEP)).abs() / (2.0 * STEP))
        .collect()
}

use residyn_core::data::TorqueColumn;
use residyn_core::data::statistics::median;
use residyn_core::model::{CommandFilter, Dynamics, Model};

use super::averages::Averages;
use super::baseline::Baseline;
use super::block::{Block, Columns, Sums, Usual};
use super::equations::{Equations, compile};
use super::grid::{Grid, Irregular, Row, Sample};
use super::history::History;
use super::hypothesis::Hypothesis;
use super::judgement::{Judge, Thresholds, Verdict};
use super::kernel::Kernel;
use super::rows::{Expected, Seen};
use super::{Alarm, DetectionLimit, Estimate, Kind, MonitorError, Named, Rows, Settings, Summary};

/// Rows from which step and noise are taken before anything else.
const FIRST_ROWS: usize = 256;
/// Half the width of the window over which motion and torques are smoothed before the equations are evaluated, s, and in
/// steps of slower logs: what it takes from forces that are not linear in the motion grows with its square.
const LIGHT_S: f64 = 0.04;
const LIGHT_STEPS: f64 = 5.0;
/// Half the width of the window over which residuals are averaged then, in that of the first.
const WIDE: f64 = 3.0;
/// A joint with dry friction rests below this many standard deviations of its velocity's noise, or widths of the reversal.
const RESTING_DEVIATIONS: f64 = 3.0;
const RESTING_WIDTHS: f64 = 2.0;
/// Blocks that an alarm waits for what explains it, at least and at most: as long as the change was there before it was seen.
const WAIT_BLOCKS: [usize; 2] = [8, 30];
/// Blocks after an alarm from which the new state is learnt before the watch goes on.
const SETTLING_BLOCKS: usize = 60;
/// What was told is told again when it has grown by this share.
const GROWN: f64 = 0.5;
/// Something unexplained on one joint is told again after this time, s.
const AGAIN_S: f64 = 600.0;

/// A watch on one machine. Memory and time per row stay the same however long it runs.
///
/// The first [`Settings::healthy_s`] are taken as the machine when it is well; from then on, alarms say what has changed.
pub struct Monitor {
    settings: Settings,
    expected: Expected,
    seen: Seen,
    first_rows: Vec<Row>,
    compiled: Watched,
    equations: Equations,
    hypotheses: Vec<Hypothesis>,
    columns: Columns,
    labels: Vec<String>,
    grid: Option<Grid>,
    samples: Vec<Sample>,
    usual: Usual,
    averages: Averages,
    healthy: Vec<Block>,
    watch: Option<Watch>,
}

/// What the smoothing needs to know of the model.
struct Watched {
    dynamics: Dynamics,
    torque: TorqueColumn,
    widths: Vec<f64>,
    dry: Vec<bool>,
}

/// The state after the healthy stretch.
struct Watch {
    baseline: Baseline,
    thresholds: Thresholds,
    history: History,
    /// All blocks since then, as one: how much the motion shows.
    total: Option<Sums>,
    pending: Option<Pending>,
    settling: Option<Settling>,
    /// Of each hypothesis, what has changed since the healthy stretch.
    changed: Vec<Option<Change>>,
    /// When something unexplained was last told, for each joint, s.
    unexplained: Vec<Option<f64>>,
    alarms: Vec<Alarm>,
    followed: usize,
    disturbances: usize,
}

/// An alarm that waits for its explanation.
struct Pending {
    blocks_left: usize,
}

/// The stretch after an alarm, from which the new state is learnt.
struct Settling {
    verdict: Verdict,
    window: Option<Sums>,
}

/// What has changed since the healthy stretch.
#[derive(Debug, Clone)]
struct Change {
    value: f64,
    half_width: f64,
    since_s: f64,
    told: f64,
}

impl Monitor {
    /// A watch on the machine that a fitted model describes. Intervals of its parameters say how well they are known.
    ///
    /// # Errors
    /// Settings out of their range; effects with states of their own; a model in which nothing is free.
    pub fn new(model: &Model, settings: Settings) -> Result<Self, MonitorError> {
        settings.check()?;
        let (equations, hypotheses) = compile(model, &settings)?;
        let columns = Columns::new(hypotheses.len(), &equations.columns_of);
        let joints = residyn_core::data::Joint::all(model.joints);
        Ok(Self {
            settings,
            expected: Expected {
                joints: model.joints,
                driven_by: model.driven_by(),
                measured: model.measured_names().map(str::to_owned).collect(),
            },
            seen: Seen {
                rows: 0,
                time: f64::NEG_INFINITY,
            },
            first_rows: Vec::new(),
            compiled: Watched {
                dynamics: model.dynamics(),
                torque: model.columns.torque.unwrap_or(TorqueColumn::Held),
                widths: model.smoothing_velocities(),
                dry: model.dry_joints(),
            },
            labels: joints.map(|joint| model.joint_label(joint)).collect(),
            equations,
            hypotheses,
            columns,
            grid: None,
            samples: Vec::new(),
            usual: Usual::default(),
            averages: Averages {
                of_joint: Vec::new(),
            },
            healthy: Vec::new(),
            watch: None,
        })
    }

    /// Takes the next rows, and returns the alarms that they raise.
    ///
    /// # Errors
    /// A row that is not in order, a number that is not finite, columns that the model does not have: no row of the batch is
    /// taken then. A healthy stretch in which nothing moves.
    pub fn update(&mut self, rows: &Rows) -> Result<Vec<Alarm>, MonitorError> {
        rows.check(&self.expected, &self.seen)?;
        let mut alarms = Vec::new();
        for at in 0..rows.time.len() {
            let of = |columns: &[Vec<f64>]| columns.iter().map(|column| column[at]).collect();
            let row = Row {
                time: rows.time[at],
                q: of(&rows.q),
                driven: of(&rows.driven),
                measured: of(&rows.measured),
            };
            self.seen = Seen {
                rows: self.seen.rows + 1,
                time: row.time,
            };
            self.take(row, &mut alarms)?;
        }
        Ok(alarms)
    }

    fn take(&mut self, row: Row, alarms: &mut Vec<Alarm>) -> Result<(), MonitorError> {
        if let Some(grid) = &mut self.grid {
            grid.push(row, &mut self.samples);
            return self.complete(alarms);
        }
        self.first_rows.push(row);
        if self.first_rows.len() == FIRST_ROWS {
            let rows = std::mem::take(&mut self.first_rows);
            self.grid = Some(self.begin(&rows));
            for row in rows {
                self.take(row, alarms)?;
            }
        }
        Ok(())
    }

    /// Step, noise and smoothing from the first rows.
    fn begin(&mut self, rows: &[Row]) -> Grid {
        let steps: Vec<f64> = rows
            .windows(2)
            .map(|pair| pair[1].time - pair[0].time)
            .collect();
        let step_s = median(&steps);
        let usual = WIDE * (LIGHT_STEPS * step_s).max(LIGHT_S);
        let wide_s = self.settings.smoothing_s.unwrap_or(usual);
        let kernel = Kernel::new(wide_s / WIDE, step_s);
        let Watched {
            dynamics,
            torque,
            widths,
            dry,
        } = &self.compiled;
        let angle = |joint: usize| rows.iter().map(move |row| row.q[joint]);
        let resting = |joint: usize| {
            let angles: Vec<f64> = angle(joint).collect();
            let speed_noise = kernel.slope_noise() * noise(&angles);
            let floor = (RESTING_DEVIATIONS * speed_noise).max(RESTING_WIDTHS * widths[joint]);
            if dry[joint] { floor } else { 0.0 }
        };
        let joints = 0..self.expected.joints;
        self.usual = Usual {
            origins: joints
                .clone()
                .map(|joint| angle(joint).sum::<f64>() / rows.len() as f64)
                .collect(),
            resting: joints.clone().map(resting).collect(),
        };
        let acts_after = match torque {
            TorqueColumn::Held => 0.5,
            TorqueColumn::Sampled => 0.0,
            TorqueColumn::Mean => -0.5,
        } * step_s;
        let values = dynamics.values();
        let delayed = joints.map(|joint| {
            let own = |kind: CommandFilter| -> f64 {
                let filters = dynamics.filters.iter();
                let own =
                    filters.filter(|filter| filter.joint.index() == joint && filter.kind == kind);
                own.map(|filter| values[filter.parameter]).sum()
            };
            let delay_s = acts_after + own(CommandFilter::Delay);
            kernel.delayed(delay_s, own(CommandFilter::Lag))
        });
        let delayed = delayed.collect();
        let grid = Grid::new(kernel, delayed, *torque, step_s, widths.clone());
        let widths = self.columns.of_joint.iter().map(|own| 1 + own.len());
        self.averages = Averages::new(wide_s, grid.sample_step_s(), widths);
        grid
    }

    /// The blocks that the newest samples complete.
    fn complete(&mut self, alarms: &mut Vec<Alarm>) -> Result<(), MonitorError> {
        let Some(grid) = &self.grid else {
            return Ok(());
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and small
        let wanted = (self.settings.block_s / grid.sample_step_s())
            .round()
            .max(2.0) as usize;
        while self.samples.len() >= wanted {
            let rest = self.samples.split_off(wanted);
            let samples = std::mem::replace(&mut self.samples, rest);
            let block = Block::of(
                &samples,
                &mut self.equations,
                &self.columns,
                (&self.usual, &mut self.averages),
            );
            if !block.is_finite() {
                return Err(MonitorError::Healthy {
                    time: block.end_s,
                    fault: "the model's forces are not finite there; check the values of its parameters".to_owned(),
                });
            }
            match &mut self.watch {
                Some(_) => alarms.extend(self.watch_block(&block)),
                None => self.learn(block)?,
            }
        }
        Ok(())
    }

    /// One more healthy block.
    fn learn(&mut self, block: Block) -> Result<(), MonitorError> {
        let time = block.end_s;
        self.healthy.push(block);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // checked to be at least 20
        let wanted = (self.settings.healthy_s / self.settings.block_s) as usize;
        if self.healthy.len() < wanted {
            return Ok(());
        }
        let blocks = std::mem::take(&mut self.healthy);
        let baseline = Baseline::of(&blocks, &self.columns, &self.hypotheses);
        let baseline = baseline.ok_or_else(|| MonitorError::Healthy {
            time,
            fault: "no joint moves in the healthy stretch; begin with the motion that the machine makes at work"
                .to_owned(),
        })?;
        if let Some(grid) = &mut self.grid {
            grid.is_healthy = false;
        }
        self.watch = Some(Watch {
            thresholds: Thresholds::new(&baseline, &self.hypotheses, &self.settings),
            history: History::default(),
            total: None,
            pending: None,
            settling: None,
            changed: vec![None; self.hypotheses.len()],
            unexplained: vec![None; self.expected.joints],
            alarms: Vec::new(),
            followed: 0,
            disturbances: 0,
            baseline,
        });
        Ok(())
    }

    fn watch_block(&mut self, block: &Block) -> Option<Alarm> {
        let (hypotheses, columns) = (&self.hypotheses, &self.columns);
        let watch = self.watch.as_mut()?;
        let sums = watch.baseline.beyond(block, columns);
        match &mut watch.total {
            Some(total) => total.add(&sums),
            none => *none = Some(sums.clone()),
        }
        if watch.settling.is_some() {
            watch.settle(sums, columns);
            return None;
        }
        watch.history.push(sums);
        let judge = Judge {
            baseline: &watch.baseline,
            thresholds: &watch.thresholds,
            hypotheses,
            columns,
        };
        let is_pending = watch.pending.is_some();
        let evidence = judge.strongest(&watch.history, is_pending)?;
        if !is_pending {
            if evidence.ratio >= 1.0 {
                let [least, most] = WAIT_BLOCKS;
                let blocks_left = evidence.window.blocks.clamp(least, most);
                watch.pending = Some(Pending { blocks_left });
            }
            return None;
        }
        let pending = watch.pending.as_mut()?;
        pending.blocks_left = pending.blocks_left.saturating_sub(1);
        let changed = |h: usize| watch.changed[h].as_ref().map_or(0.0, |change| change.value);
        if pending.blocks_left > 0 {
            return None;
        }
        watch.pending = None;
        if evidence.ratio < 1.0 {
            // It is over: a push, a touch.
            watch.disturbances += 1;
            return None;
        }
        let is_admissible = |h: usize, change: f64| {
            let [low, high] = hypotheses[h].bounds;
            let whole = changed(h) + change;
            let value = hypotheses[h].value + whole;
            let is_within = hypotheses[h].kind != Kind::Parameter || value >= low && value <= high;
            is_within && whole.abs() <= hypotheses[h].plausible()
        };
        let verdict = judge.verdict(&evidence, is_admissible);
        let time_s = block.end_s;
        let changes: Vec<(usize, [f64; 2])> = match &verdict {
            Verdict::Named(of) => of
                .iter()
                .map(|h| (*h, judge.change(&evidence.window, *h)))
                .collect(),
            Verdict::Unexplained(_) => Vec::new(),
        };
        let alarm = watch.told(&verdict, &changes, &evidence.window, time_s);
        let alarm = alarm.map(|(since_s, is_further)| Alarm {
            time_s,
            since_s,
            is_further,
            causes: causes(&verdict, &changes, hypotheses, &self.labels, &watch.changed),
        });
        watch
            .baseline
            .absorb(&columns.free_with(&verdict), &evidence.window);
        watch.history.clear();
        watch.settling = Some(Settling {
            verdict,
            window: None,
        });
        watch.alarms.extend(alarm.clone());
        alarm
    }

    /// What was seen so far, and how small a change would have been seen.
    pub fn summary(&self) -> Summary {
        let irregular = self
            .grid
            .as_ref()
            .map_or_else(Irregular::default, |grid| grid.irregular);
        let watch = self.watch.as_ref();
        let total = watch.and_then(|watch| watch.total.as_ref());
        let watched_s = total.map_or(0.0, |total| total.blocks as f64 * self.settings.block_s);
        Summary {
            rows: self.seen.rows,
            watched_s,
            is_calibrated: watch.is_some(),
            gaps: irregular.gaps,
            jumps: irregular.jumps,
            repeated_rows: irregular.repeated,
            alarms: watch.map_or_else(Vec::new, |watch| watch.alarms.clone()),
            followed: watch.map_or(0, |watch| watch.followed),
            disturbances: watch.map_or(0, |watch| watch.disturbances),
            limits: watch.map_or_else(Vec::new, |watch| self.limits(watch)),
        }
    }

    fn limits(&self, watch: &Watch) -> Vec<DetectionLimit> {
        let judge = Judge {
            baseline: &watch.baseline,
            thresholds: &watch.thresholds,
            hypotheses: &self.hypotheses,
            columns: &self.columns,
        };
        let hour = watch.total.as_ref().map(|total| {
            let hours = total.blocks as f64 * self.settings.block_s / 3600.0;
            Sums {
                information: &total.information / hours,
                ..total.clone()
            }
        });
        let of = |(h, own): (usize, &Hypothesis)| {
            let limit = hour.as_ref().and_then(|hour| judge.limit(hour, h));
            let change = watch.changed[h].as_ref();
            DetectionLimit {
                kind: own.kind,
                joint: own.joint,
                name: own.name.clone(),
                within_an_hour: limit.map(|limit| limit / own.unit_of_estimates()),
                is_relative: own.is_relative(),
                unit: own.unit.clone(),
                changed: change.map(|change| own.estimate(change.value, change.half_width)),
            }
        };
        self.hypotheses.iter().enumerate().map(of).collect()
    }
}

impl Watch {
    /// One more block of the stretch after an alarm. At its end the new state is the baseline, and what was named is known
    /// better.
    fn settle(&mut self, block: Sums, columns: &Columns) {
        let Some(settling) = &mut self.settling else {
            return;
        };
        let window = match &mut settling.window {
            Some(window) => {
                window.add(&block);
                &*window
            }
            none => &*none.insert(block),
        };
        if window.blocks < SETTLING_BLOCKS {
            return;
        }
        if let Verdict::Named(of) = &settling.verdict
            && let Some(change) = of.first().and_then(|h| self.changed[*h].as_mut())
        {
            let information = window.information[(of[0], of[0])];
            change.value += if information > 0.0 {
                window.score[of[0]] / information
            } else {
                0.0
            };
        }
        self.baseline
            .absorb(&columns.free_with(&settling.verdict), window);
        self.settling = None;
    }

    /// Keeps what has changed. If it is to be told: since when, and whether it was told before.
    fn told(
        &mut self,
        verdict: &Verdict,
        changes: &[(usize, [f64; 2])],
        window: &Sums,
        time_s: f64,
    ) -> Option<(f64, bool)> {
        let found = match (verdict, changes) {
            (Verdict::Unexplained(joint), _) => {
                let last = &mut self.unexplained[*joint];
                let is_again = last.is_some_and(|last| time_s - last < AGAIN_S);
                let is_further = last.is_some();
                if !is_again {
                    *last = Some(time_s);
                }
                (!is_again).then_some((window.start_s, is_further))
            }
            (_, [(h, [value, half_width]), ..]) => {
                let before = self.changed[*h].clone();
                let value = value + before.as_ref().map_or(0.0, |before| before.value);
                let told = before.as_ref().map_or(0.0, |before| before.told);
                let is_told = before.is_none() || (value - told).abs() >= GROWN * told.abs();
                let since_s = before
                    .as_ref()
                    .map_or(window.start_s, |before| before.since_s);
                self.changed[*h] = Some(Change {
                    value,
                    half_width: *half_width,
                    since_s,
                    told: if is_told { value } else { told },
                });
                is_told.then_some((since_s, before.is_some()))
            }
            _ => None,
        };
        self.followed += usize::from(found.is_none());
        found
    }
}

/// The causes of an alarm, in words.
fn causes(
    verdict: &Verdict,
    changes: &[(usize, [f64; 2])],
    hypotheses: &[Hypothesis],
    labels: &[String],
    changed: &[Option<Change>],
) -> Vec<Named> {
    if let Verdict::Unexplained(joint) = verdict {
        return vec![Named {
            kind: Kind::Unexplained,
            joint: residyn_core::data::Joint::at(*joint),
            name: "unexplained".to_owned(),
            estimate: None,
            what: String::new(),
            label: labels[*joint].clone(),
        }];
    }
    let named = |(at, (h, [value, half_width])): (usize, &(usize, [f64; 2]))| {
        let own = &hypotheses[*h];
        let whole = changed[*h].as_ref().map_or(0.0, |change| change.value);
        // The best one's has this change in it already.
        let value = if at == 0 { whole } else { value + whole };
        Named {
            kind: own.kind,
            joint: own.joint,
            name: own.name.clone(),
            estimate: Some(own.estimate(value, *half_width)),
            what: own.what.clone(),
            label: labels[own.joint].clone(),
        }
    };
    changes.iter().enumerate().map(named).collect()
}

impl Hypothesis {
    /// A change of one, as estimates give it.
    fn unit_of_estimates(&self) -> f64 {
        if self.is_relative() {
            self.value.abs()
        } else {
            1.0
        }
    }

    fn estimate(&self, value: f64, half_width: f64) -> Estimate {
        let one = self.unit_of_estimates();
        Estimate {
            value: value / one,
            ci95: [(value - half_width) / one, (value + half_width) / one],
            is_relative: self.is_relative(),
            unit: self.unit.clone(),
        }
    }
}

/// Standard deviation of white noise on angles, by third differences, which no motion reaches at these steps: their median,
/// times what a normal distribution has in its place.
fn noise(angles: &[f64]) -> f64 {
    let third = angles
        .windows(4)
        .map(|four| (four[3] - 3.0 * (four[2] - four[1]) - four[0]).abs());
    let third: Vec<f64> = third.collect();
    median(&third) / 0.6745 / 20.0_f64.sqrt()
}

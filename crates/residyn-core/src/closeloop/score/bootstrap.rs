use rand::Rng;

use crate::closeloop::settings::ScoreSettings;
use crate::data::statistics::bootstrap;
use crate::identify::{BLOCK_S, blocks_of_times, count};
use crate::sim::metric::OpenLoop;

/// 95 % interval of the relative reduction of the position error (all joints together) from `before` to `after`, by
/// resampling whole trajectories or, if there are fewer than five, blocks of two seconds. `None` for fewer than three
/// trajectories or blocks.
pub fn reduction_interval(
    before: &OpenLoop,
    after: &OpenLoop,
    settings: &ScoreSettings,
    rng: &mut impl Rng,
) -> Option<[f64; 2]> {
    let blocks = blocks(before, after, settings.whole_logs_from);
    interval(&blocks, settings, rng)
}

/// The same, from each block's squared errors before and after.
pub fn interval(
    blocks: &[(f64, f64)],
    settings: &ScoreSettings,
    rng: &mut impl Rng,
) -> Option<[f64; 2]> {
    if blocks.len() < settings.fewest_blocks {
        return None;
    }
    let reduction = |drawn: &[usize]| {
        let drawn = drawn.iter().map(|&k| blocks[k]);
        let (b, a) = drawn.fold((0.0, 0.0), |sum, block| (sum.0 + block.0, sum.1 + block.1));
        1.0 - (a / b.max(f64::MIN_POSITIVE)).sqrt()
    };
    Some(bootstrap(blocks.len(), rng, reduction))
}

/// Squared errors before and after, summed over each block.
fn blocks(before: &OpenLoop, after: &OpenLoop, whole_logs: usize) -> Vec<(f64, f64)> {
    let logs: Vec<usize> = before.windows.iter().map(|w| w.log).collect();
    let logs = count(&logs);
    let starts = before.windows.iter().map(|w| {
        let start_s = if logs >= whole_logs { 0.0 } else { w.start_s };
        (w.log, start_s)
    });
    let members = blocks_of_times(starts, BLOCK_S);
    let mut blocks = vec![(0.0, 0.0); count(&members)];
    for ((b, a), member) in before.windows.iter().zip(&after.windows).zip(members) {
        blocks[member].0 += b.position.iter().sum::<f64>();
        blocks[member].1 += a.position.iter().sum::<f64>();
    }
    blocks
}

use rand::{Rng, RngExt};

use crate::evaluate::{OpenLoop, WindowError};

const RESAMPLES: usize = 2000;
/// Windows of a log nearer than this are kept together.
const BLOCK_S: f64 = 2.0;

/// 95 % interval of the relative reduction of the position error (all joints together) from `before` to
/// `after`, by resampling whole trajectories or, where there are fewer than five, stretches of two seconds.
/// `None` for fewer than three of them.
pub fn reduction_interval(
    before: &OpenLoop,
    after: &OpenLoop,
    rng: &mut impl Rng,
) -> Option<[f64; 2]> {
    let blocks = blocks(before, after);
    if blocks.len() < 3 {
        return None;
    }
    let mut reductions: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..blocks.len()).map(|_| blocks[rng.random_range(0..blocks.len())]);
            let (b, a) = drawn.fold((0.0, 0.0), |sum, block| (sum.0 + block.0, sum.1 + block.1));
            1.0 - (a / b.max(f64::MIN_POSITIVE)).sqrt()
        })
        .collect();
    reductions.sort_by(f64::total_cmp);
    Some([
        reductions[RESAMPLES / 40],
        reductions[RESAMPLES - 1 - RESAMPLES / 40],
    ])
}

/// Squared errors before and after, summed over each block.
fn blocks(before: &OpenLoop, after: &OpenLoop) -> Vec<(f64, f64)> {
    let whole_logs = before
        .windows
        .iter()
        .map(|w| w.log)
        .max()
        .map_or(0, |last| last + 1)
        >= 5;
    let mut blocks: Vec<(f64, f64)> = Vec::new();
    let mut current: Option<(usize, f64)> = None;
    for (b, a) in before.windows.iter().zip(&after.windows) {
        let continues = current.is_some_and(|(log, since)| {
            log == b.log && (whole_logs || b.start_s - since < BLOCK_S)
        });
        if !continues {
            current = Some((b.log, b.start_s));
            blocks.push((0.0, 0.0));
        }
        let block = blocks.last_mut().expect("a block was begun");
        block.0 += squares(b);
        block.1 += squares(a);
    }
    blocks
}

fn squares(window: &WindowError) -> f64 {
    window.position.iter().sum()
}

//! The latest blocks as sums over stretches that are longer the older they are: constant memory, and a window can begin
//! at any of the ends.

use std::collections::VecDeque;

use super::block::Sums;

/// Stretches of one length that are kept: windows differ by a quarter of their length at most.
const EACH: usize = 4;
/// The longest stretches have two to this power blocks.
const LEVELS: usize = 12;

#[derive(Debug, Default)]
pub(crate) struct History {
    /// `[level]`: stretches of two to the level blocks, the newest first.
    levels: Vec<VecDeque<Sums>>,
    blocks: usize,
}

impl History {
    pub fn push(&mut self, block: Sums) {
        self.blocks += 1;
        let mut new = Some(block);
        for level in 0..LEVELS {
            let Some(sums) = new.take() else { return };
            if self.levels.len() == level {
                self.levels.push(VecDeque::new());
            }
            let own = &mut self.levels[level];
            own.push_front(sums);
            if own.len() > EACH + 1 {
                let older = own.pop_back();
                let mut newer = own.pop_back();
                if let (Some(newer), Some(older)) = (&mut newer, &older) {
                    newer.add(older);
                }
                new = newer;
            }
        }
    }

    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Windows that end now. Those whose first stretch is long come only when such a stretch has passed since they last
    /// did, unless `all` are asked for.
    pub fn windows(&self, all: bool, mut see: impl FnMut(&Sums)) {
        let mut sum: Option<Sums> = None;
        for (level, own) in self.levels.iter().enumerate() {
            let is_due = all || self.blocks.is_multiple_of(1 << level);
            if !is_due {
                return;
            }
            for stretch in own {
                let sum = match &mut sum {
                    Some(sum) => {
                        sum.add(stretch);
                        &*sum
                    }
                    none => &*none.insert(stretch.clone()),
                };
                see(sum);
            }
        }
    }

    /// Windows that are tested in an hour, at most.
    pub fn windows_per_hour(block_s: f64) -> f64 {
        let of_level =
            |level: usize| (EACH + 1) as f64 / 2_f64.powi(i32::try_from(level).unwrap_or(0));
        3600.0 / block_s * (0..LEVELS).map(of_level).sum::<f64>()
    }
}

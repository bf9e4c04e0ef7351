//! The path of commands to the drives: when each was issued, and when a drive's delay lets it arrive.

use super::drive::Approach;
use super::machine::Machine;
use super::mechanics::Pair;

/// Instants closer than this \[s\] are the same instant: they differ by rounding.
const INSTANT_S: f64 = 1e-12;

/// Commands of a rig, and those that have reached its drives.
#[derive(Default)]
pub struct Wires {
    /// Each command with the time at which it was issued \[s\], in order.
    issued: Vec<(f64, Pair)>,
    given: [Approach; 2],
}

impl Wires {
    /// A command for every joint, from `time` s on.
    pub fn issue(&mut self, time: f64, command: Pair) {
        self.issued.push((time, command));
    }

    /// The command of joint `j` that has arrived at `time` s; zero before the first.
    fn arrived(&self, j: usize, delay: f64, time: f64) -> f64 {
        let there = |(issued, _): &(f64, Pair)| issued + delay <= time + INSTANT_S;
        let count = self.issued.partition_point(there);
        count.checked_sub(1).map_or(0.0, |k| self.issued[k].1[j])
    }

    /// `from`, `to`, and the instants between them when a command arrives at a drive \[s\].
    pub fn cuts(&self, machine: &Machine, from: f64, to: f64) -> Vec<f64> {
        let mut cuts = vec![from, to];
        for drive in &machine.drives[..machine.joints()] {
            let arrivals = self.issued.iter().map(|(issued, _)| issued + drive.delay);
            let within = |at: &f64| *at > from + INSTANT_S && *at < to - INSTANT_S;
            let late = arrivals.rev().take_while(|at| *at > from);
            cuts.extend(late.filter(within));
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|next, last| *next - *last <= INSTANT_S);
        cuts
    }

    /// The input to each joint's drive from `time` s on, until the next command arrives.
    pub fn given(&mut self, machine: &Machine, time: f64) -> [Approach; 2] {
        for j in 0..machine.joints() {
            let drive = &machine.drives[j];
            self.given[j] = Approach {
                since: time,
                from: self.given[j].at(time, drive.lag),
                target: self.arrived(j, drive.delay, time),
            };
        }
        self.given
    }
}

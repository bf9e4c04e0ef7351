//! Gains of position loops that the user knows: numbers of the drives' firmware.

use anyhow::{Result, bail};
use clap::Args;

use residyn_core::model::tree::Tree;

#[derive(Debug, Args)]
pub(super) struct Gains {
    /// Stiffness of the loops that hold the joints at the commanded positions, in N m/rad (N/m for joints that slide):
    /// one number, or one for each joint in the order of the model. Fits hold it, and test whether the rig's differs
    #[arg(long, value_name = "KP", value_delimiter = ',', requires = "kd", value_parser = gain)]
    pub kp: Vec<f64>,
    /// Damping of these loops, in N m s/rad (N s/m), likewise
    #[arg(long, value_name = "KD", value_delimiter = ',', requires = "kp", value_parser = gain)]
    pub kd: Vec<f64>,
}

fn gain(text: &str) -> Result<f64, String> {
    let gain = text.trim().parse().ok();
    let gain = gain.filter(|gain: &f64| *gain >= 0.0 && gain.is_finite());
    gain.ok_or_else(|| "a gain is a number that is not below zero".to_owned())
}

impl Gains {
    pub fn are_given(&self) -> bool {
        !self.kp.is_empty()
    }

    /// The tree with loops of these gains, if they are given.
    pub fn on(&self, tree: Tree) -> Result<Tree> {
        if !self.are_given() {
            return Ok(tree);
        }
        let names: Vec<&str> = tree
            .leaders()
            .map(|(_, joint)| joint.name.as_str())
            .collect();
        for (flag, gains) in [("--kp", &self.kp), ("--kd", &self.kd)] {
            if ![1, names.len()].contains(&gains.len()) {
                bail!(
                    "{flag}: {} gains for {} joints; give one for all, or one for each: {}",
                    gains.len(),
                    names.len(),
                    names.join(", ")
                );
            }
        }
        Ok(tree.with_gains(&self.kp, &self.kd))
    }
}

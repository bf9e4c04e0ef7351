//! A number drawn at random from a range.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Numbers from `from` to `to`: evenly spread on a logarithmic scale if both are positive, else on a linear one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Size {
    #[serde(default = "one")]
    pub from: f64,
    #[serde(default = "one")]
    pub to: f64,
    /// Multiples of this: of a scale of the joint, or of another number of the same effect that precedes this one
    /// alphabetically.
    #[serde(default)]
    pub of: Option<String>,
    /// Of either sign.
    #[serde(default)]
    pub signed: bool,
    /// Whole numbers only.
    #[serde(default)]
    pub whole: bool,
}

fn one() -> f64 {
    1.0
}

impl Size {
    /// A number.
    ///
    /// # Errors
    /// `of` names none of the `scales`.
    pub fn draw(&self, scales: &BTreeMap<String, f64>, rng: &mut impl Rng) -> Result<f64, String> {
        let place = rng.random::<f64>();
        let number = if self.from > 0.0 && self.to > 0.0 {
            self.from * (self.to / self.from).powf(place)
        } else {
            self.from + (self.to - self.from) * place
        };
        let number = if self.whole { number.round() } else { number };
        let negative = self.signed && rng.random();
        let scale = match &self.of {
            Some(name) => scales
                .get(name)
                .ok_or_else(|| format!("no scale `{name}`"))?,
            None => &1.0,
        };
        Ok(if negative { -number } else { number } * scale)
    }

    /// A number that is not a multiple of a scale.
    pub fn plain(&self, rng: &mut impl Rng) -> Result<f64, String> {
        self.draw(&BTreeMap::new(), rng)
    }

    /// A count.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
    pub fn count(&self, rng: &mut impl Rng) -> Result<usize, String> {
        Ok(self.plain(rng)?.round() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::Size;
    use residyn_core::rng;

    #[test]
    fn numbers_keep_to_their_range_scale_and_sign() {
        let rng = &mut rng(1);
        let size: Size =
            toml::from_str("from = 0.5\nto = 8.0\nof = 'torque'\nsigned = true").unwrap();
        let scales = [("torque".to_owned(), 2.0)].into();
        let drawn: Vec<f64> = (0..4000)
            .map(|_| size.draw(&scales, rng).unwrap())
            .collect();
        assert!(drawn.iter().all(|x| (1.0..=16.0).contains(&x.abs())));
        // Half of the numbers lie below the geometric mean of the ends, and half below zero.
        let share = |hit: &dyn Fn(f64) -> bool| {
            drawn.iter().filter(|x| hit(**x)).count() as f64 / drawn.len() as f64
        };
        assert!((share(&|x| x.abs() < 4.0) - 0.5).abs() < 0.03);
        assert!((share(&|x| x < 0.0) - 0.5).abs() < 0.03);
        let message = size.draw(&[].into(), rng).unwrap_err();
        assert_eq!(message, "no scale `torque`");
        let whole: Size = toml::from_str("from = -3\nto = 3\nwhole = true").unwrap();
        assert!((0..100).all(|_| whole.plain(rng).unwrap().fract() == 0.0));
    }
}

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A share of a run's pieces of work, so that several machines do a run together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Counted from 1.
    number: usize,
    /// Number of shards.
    of: usize,
}

impl Shard {
    /// The whole run.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// All shards of the run that this is one of, in order.
    pub fn all(self) -> impl Iterator<Item = Self> {
        (1..=self.of).map(move |number| Self { number, ..self })
    }

    /// Its share of the pieces of work: every n-th piece for n shards, since neighbours take about equally long.
    pub fn share<T>(self, pieces: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
        let mine = pieces.into_iter().skip(self.number - 1);
        mine.step_by(self.of)
    }
}

/// Why a text does not name a shard.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ShardError {
    #[error("give two whole numbers as K/N, such as 3/8")]
    Form,
    #[error("K is {number} and N is {of}; shards are counted from 1/N to N/N")]
    Number { number: usize, of: usize },
}

impl FromStr for Shard {
    type Err = ShardError;

    /// From K/N.
    fn from_str(text: &str) -> Result<Self, ShardError> {
        let numbers = text
            .split_once('/')
            .and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let (number, of) = numbers.ok_or(ShardError::Form)?;
        if (1..=of).contains(&number) {
            Ok(Self { number, of })
        } else {
            Err(ShardError::Number { number, of })
        }
    }
}

impl Display for Shard {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::Shard;

    #[test]
    fn shards_have_every_piece_once() {
        for of in 1..=8 {
            let first: Shard = format!("1/{of}").parse().unwrap();
            let mut shared: Vec<usize> = first.all().flat_map(|shard| shard.share(0..7)).collect();
            shared.sort_unstable();
            assert_eq!(shared, [0, 1, 2, 3, 4, 5, 6], "{of}");
        }
        let second: Shard = "2/3".parse().unwrap();
        assert_eq!(second.share(0..7).collect::<Vec<_>>(), [1, 4]);
        assert_eq!(second.to_string(), "2/3");
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for (text, part) in [
            ("0/8", "K is 0 and N is 8; shards are counted from 1/N"),
            ("9/8", "K is 9 and N is 8"),
            ("1/0", "K is 1 and N is 0"),
            ("3", "as K/N"),
            ("-1/8", "as K/N"),
            ("1/8/2", "as K/N"),
        ] {
            let message = text.parse::<Shard>().unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}

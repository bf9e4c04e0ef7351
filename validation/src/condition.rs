//! How a rig is driven, and how its logs are taken.

use serde::{Deserialize, Deserializer, Serialize};

use super::sensors::Flaws;
use residyn_core::limits::{LOG_ROWS, RUNS, SIMULATED_S, check_readings};

/// How a rig is driven; every list has one number per joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Driving {
    /// Open loop: root mean square of the torque \[N m\], and its band \[Hz\].
    pub torque: Vec<f64>,
    pub torque_hz: [f64; 2],
    /// Closed loop: root mean square of the reference \[rad\], and its band \[Hz\].
    pub reference: Vec<f64>,
    pub reference_hz: [f64; 2],
    /// Gains of the controller \[N m/rad\], \[N m s/rad\].
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
    /// Largest torque that it commands \[N m\].
    pub limit: Vec<f64>,
}

/// What drives a rig while a log is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loop {
    /// A torque of many frequencies.
    Open,
    /// A controller that follows a reference of many frequencies.
    Closed,
    /// A torque whose frequency rises.
    Chirp,
    /// A torque that jumps and stays.
    Steps,
    /// Released from up to twice the reference's size, under half the open-loop torque.
    Release,
    /// A bench that moves the rig along a path of many frequencies, whatever torque that takes; the torque is measured.
    Imposed,
}

/// How logs are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// How the logs are driven, in turn.
    #[serde(rename = "loop", deserialize_with = "one_or_more")]
    pub drive: Vec<Loop>,
    pub rate_hz: f64,
    /// Standard deviation of white noise on positions \[rad\].
    pub noise: f64,
    /// Step of the encoder \[rad\]; zero for a fine one.
    #[serde(default)]
    pub quantum: f64,
    pub logs: usize,
    pub seconds: f64,
    #[serde(default)]
    pub flaws: Flaws,
}

impl Condition {
    /// Whether logs can be taken under this condition.
    ///
    /// # Errors
    /// Why not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let sound = self.rate_hz > 0.0
            && self.noise >= 0.0
            && self.quantum >= 0.0
            && !self.drive.is_empty()
            && self.logs >= 2
            && self.seconds * self.rate_hz >= 10.0;
        let needs = "needs a `loop`, `rate_hz` above zero, `noise` and `quantum` not negative, at least two logs and ten rows";
        if !sound {
            return Err(needs.to_owned());
        }
        check_rows(self.rate_hz, &[self.seconds])?;
        if self.logs > RUNS {
            return Err(format!("at most {RUNS} `logs`, found {}", self.logs));
        }
        check_readings("noise and quantum", [self.noise, self.quantum])?;
        self.flaws.check()
    }
}

/// Whether logs of these lengths can be taken at this rate.
///
/// # Errors
/// Logs that are longer than the limit.
pub(super) fn check_rows(rate_hz: f64, seconds: &[f64]) -> Result<(), String> {
    let fits = |seconds: &f64| *seconds <= SIMULATED_S && seconds * rate_hz <= LOG_ROWS as f64;
    match seconds.iter().find(|seconds| !fits(seconds)) {
        None => Ok(()),
        Some(seconds) => Err(format!(
            "a log is at most {SIMULATED_S:e} s long and has at most {LOG_ROWS} rows; {rate_hz:?} Hz for {seconds:?} s is more"
        )),
    }
}

fn one_or_more<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Loop>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum OneOrMore {
        One(Loop),
        More(Vec<Loop>),
    }
    Ok(match OneOrMore::deserialize(from)? {
        OneOrMore::One(one) => vec![one],
        OneOrMore::More(more) => more,
    })
}

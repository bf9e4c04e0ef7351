//! The rules by which rigs are drawn.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::size::Size;
use crate::condition::Loop;
use residyn_core::data::Joint;

/// The rules by which rigs are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    pub condition: ConditionRules,
    /// Free parameters of the model file start at the true value, times or divided by up to this factor.
    pub start: Size,
    /// An effect matters if the best fit without it has at least this many times the error; zero: any does, and rigs
    /// do not depend on what can be fitted.
    pub matters: f64,
    /// Effects of the library, by name.
    pub effects: BTreeMap<String, Kind>,
    /// Effects that the library lacks, by name.
    pub outside: BTreeMap<String, Kind>,
    /// A joint has at most one effect of each of these sets.
    pub exclusive: Vec<Vec<String>>,
}

/// How logs are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConditionRules {
    /// The logs of a rig alternate between two of these.
    pub loops: Vec<Loop>,
    pub rate_hz: Size,
    pub logs: Size,
    pub seconds: Size,
    /// The encoder's step is a turn divided by two to this power.
    pub bits: Size,
    /// Standard deviation of white noise on positions, in encoder steps.
    pub noise: Size,
    pub jitter: Size,
    pub dropped: Size,
    /// Standard deviation of the reported times \[s\], and the share of rows that repeat readings: none if not given.
    pub stamps_s: Option<Size>,
    pub repeated: Option<Size>,
    pub burst: Size,
    /// Standard deviation of the logged torque, and its step, as shares of the joint's largest torque.
    pub torque_noise: Size,
    pub torque_quantum: Size,
    /// One of these \[s\]; zero for velocities that are differences.
    pub filter_s: Vec<f64>,
}

/// An effect that may be drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// How often it is drawn, relative to others.
    #[serde(default = "one")]
    pub weight: f64,
    /// On this joint only.
    #[serde(default)]
    pub joint: Option<Joint>,
    pub values: BTreeMap<String, Size>,
    /// For an effect that the library lacks, the library effects that come nearest to it: it has to matter in addition
    /// to them.
    #[serde(default)]
    pub stand_ins: Vec<StandIn>,
}

fn one() -> f64 {
    1.0
}

/// An effect of the library that is fitted in place of another, from these values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandIn {
    pub name: String,
    pub values: BTreeMap<String, Size>,
}

impl Rules {
    /// Whether a joint can have both of these effects.
    pub fn allow(&self, one: &str, other: &str) -> bool {
        let has = |set: &&Vec<String>, name: &str| set.iter().any(|of| of == name);
        let together = |set: &&Vec<String>| has(set, one) && has(set, other);
        one != other && !self.exclusive.iter().any(|set| together(&set))
    }
}

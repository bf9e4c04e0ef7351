use std::fmt;

use serde::Serialize;

use super::{Alarm, Estimate, Kind};
use residyn_core::data::Joint;

/// How small a change of one thing would have been seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DetectionLimit {
    pub kind: Kind,
    /// From 1.
    pub joint: Joint,
    pub name: String,
    /// The smallest change that is seen within an hour of such motion nine times in ten, as a share of the declared value if
    /// `is_relative`, else in `unit`. `None` if the motion does not show it.
    pub within_an_hour: Option<f64>,
    pub is_relative: bool,
    pub unit: String,
    /// What has changed since the healthy stretch, if an alarm said so.
    pub changed: Option<Estimate>,
}

/// What the watch has seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub rows: usize,
    /// Time that was watched after the healthy stretch, s.
    pub watched_s: f64,
    /// Whether the healthy stretch was long enough to begin.
    pub is_calibrated: bool,
    /// Steps that are too long to smooth over: smoothing began anew after each.
    pub gaps: usize,
    /// Angles that jumped: smoothing began anew after each.
    pub jumps: usize,
    /// Rows that repeat all angles: taken as readings that came late.
    pub repeated_rows: usize,
    /// Alarms that were told, and changes of what was told before that were followed without another word.
    pub alarms: Vec<Alarm>,
    pub followed: usize,
    /// Changes that were over before they could be explained.
    pub disturbances: usize,
    pub limits: Vec<DetectionLimit>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            rows,
            watched_s,
            gaps,
            jumps,
            repeated_rows,
            ..
        } = self;
        writeln!(
            f,
            "{rows} rows, {watched_s:.0} s watched, {} alarm(s)",
            self.alarms.len()
        )?;
        if !self.is_calibrated {
            return writeln!(f, "the healthy stretch has not ended: nothing was watched");
        }
        if gaps + jumps + repeated_rows > 0 {
            writeln!(
                f,
                "{gaps} gap(s), {jumps} jump(s) of an angle, {repeated_rows} row(s) that repeat the angles"
            )?;
        }
        if self.disturbances > 0 {
            writeln!(
                f,
                "{} short disturbance(s), over before they could be explained",
                self.disturbances
            )?;
        }
        for limit in &self.limits {
            writeln!(f, "{limit}")?;
        }
        Ok(())
    }
}

impl fmt::Display for DetectionLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name, joint, unit, ..
        } = self;
        write!(f, "{name} of joint {joint}: ")?;
        match self.within_an_hour {
            Some(limit) if self.is_relative => write!(
                f,
                "a change by {:.1} % is seen within an hour",
                100.0 * limit
            )?,
            Some(limit) => write!(f, "a change by {limit:.2e} {unit} is seen within an hour")?,
            None => write!(f, "the motion does not show it")?,
        }
        match &self.changed {
            Some(estimate) => write!(f, "; {estimate} since the healthy stretch"),
            None => Ok(()),
        }
    }
}

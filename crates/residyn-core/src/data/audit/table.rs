//! An audit as text for a terminal.

use std::fmt;

use super::channel::Channel;
use super::quality::{Audit, Remedy, RemedyWords, Severity};
use crate::layout::{LABEL, hanging, wrap};

/// Widest line \[characters\].
const WIDTH: usize = 80;

impl fmt::Display for Audit {
    /// Sampling, one line per channel, one line per joint, and the findings; no line is longer than 80 characters,
    /// except for a single long word and for text to be pasted.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |remedy: &Remedy| match remedy {
            Remedy::LeaveOut(_) => remedy.to_string(),
            Remedy::Columns(_) => format!("paste: {remedy}"),
        };
        self.write(f, &words)
    }
}

/// An audit with its remedies in the words of the program that shows it.
struct InWords<'a>(&'a Audit, RemedyWords<'a>);

impl fmt::Display for InWords<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(f, self.1)
    }
}

impl Audit {
    /// The same text, with the remedies in these words.
    pub fn message(&self, words: RemedyWords<'_>) -> String {
        InWords(self, words).to_string()
    }

    fn write(&self, f: &mut fmt::Formatter<'_>, words: RemedyWords<'_>) -> fmt::Result {
        self.write_sampling(f)?;
        self.write_channels(f)?;
        self.write_joints(f)?;
        self.write_findings(f, words)
    }

    fn write_sampling(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!(
            "{}: {} rows in {} s; steps of {} ms ({} to {}), jitter {} %, {} gap(s)",
            self.log,
            self.rows,
            short(self.duration_s),
            short(1e3 * self.median_step_s),
            short(1e3 * self.min_step_s),
            short(1e3 * self.max_step_s),
            short(100.0 * self.jitter),
            self.gaps.len()
        );
        writeln!(f, "{}", wrap(&text, WIDTH).join("\n"))
    }

    fn write_channels(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<8}{:<6}{:>11}{:>11}{:>12}{:>12}{:>9}{:>10}",
            "channel", "unit", "min", "max", "resolution", "noise", "spikes", "at limit"
        )?;
        for joint in &self.joints {
            write_channel(f, &joint.q)?;
            write_channel(f, &joint.qd)?;
            write_channel(f, &joint.tau)?;
        }
        Ok(())
    }

    fn write_joints(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<6}{:>11}{:>9}{:>11}{:>10}{:>10}{:>10}  tau lag",
            "joint",
            self.fast(),
            "at rest",
            "reversals",
            "full turn",
            "qd scale",
            "qd lag ms"
        )?;
        for joint in &self.joints {
            let or_dash = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), short);
            let velocity = joint.velocity;
            let torque = joint.torque_lag.map(|lag| 1e3 * lag.lag_s);
            writeln!(
                f,
                "{:<6}{:>11}{:>9}{:>11}{:>10}{:>10}{:>10}  {}",
                joint.joint,
                short(joint.fast_rad_s),
                format!("{:.1} %", 100.0 * joint.share_at_rest),
                joint.reversals,
                if joint.covers_full_turn { "yes" } else { "no" },
                or_dash(velocity.map(|check| check.scale)),
                or_dash(velocity.map(|check| 1e3 * check.lag_s)),
                or_dash(torque) + torque.map_or("", |_| " ms")
            )?;
        }
        Ok(())
    }

    /// The head of the joints' speeds.
    fn fast(&self) -> &'static str {
        let sliding = self.joints.iter().filter(|joint| joint.slides()).count();
        match sliding {
            0 => "fast rad/s",
            all if all == self.joints.len() => "fast m/s",
            _ => "fast",
        }
    }

    fn write_findings(&self, f: &mut fmt::Formatter<'_>, words: RemedyWords<'_>) -> fmt::Result {
        if self.findings.is_empty() {
            return writeln!(f, "\nno findings");
        }
        writeln!(f)?;
        for finding in &self.findings {
            let label = match finding.severity {
                Severity::Serious => "serious",
                Severity::Warning => "warning",
                Severity::Info => "info",
            };
            f.write_str(&hanging(label, &finding.text, WIDTH))?;
            if let Some(place) = finding.place() {
                f.write_str(&hanging("", &place, WIDTH))?;
            }
            if let Some(remedy) = &finding.remedy {
                writeln!(f, "{:<LABEL$}  {}", "", words(remedy))?;
            }
        }
        Ok(())
    }
}

fn write_channel(f: &mut fmt::Formatter<'_>, channel: &Channel) -> fmt::Result {
    writeln!(
        f,
        "{:<8}{:<6}{:>11}{:>11}{:>12}{:>12}{:>9}{:>10}",
        channel.name,
        channel.unit,
        short(channel.min),
        short(channel.max),
        short(channel.resolution),
        short(channel.noise_std),
        channel.spikes,
        format!("{:.1} %", 100.0 * channel.saturated_fraction)
    )
}

/// A number with four significant digits and no trailing zeros.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        return format!("{value:.1e}");
    }
    // Small numbers keep their digits: 0.002914 has two zeros that are not significant.
    let decimals = match size {
        1.0.. => 3_usize.saturating_sub(size.log10() as usize),
        0.0 => 4,
        _ => 4 + (-size.log10()) as usize,
    };
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{audit, swing};
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (-15.7, "-15.7"),
            (0.0029145, "0.002914"),
            (1234.56, "1235"),
            (10.0, "10"),
            (100.0, "100"),
            (3e-7, "3.0e-7"),
            (0.25, "0.25"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn the_table_fits_a_terminal_and_holds_every_channel() {
        let mut log = swing();
        log.qd[0].iter_mut().for_each(|v| *v *= -1e5);
        let text = audit(&log).to_string();
        assert!(
            text.lines().all(|line| line.chars().count() <= WIDTH),
            "{text}"
        );
        for name in ["q1", "qd1", "tau1", "reversals", "serious  qd1"] {
            assert!(text.contains(name), "{name} in\n{text}");
        }
    }
}

use residyn_core::closeloop::{Alternative, Outcome, Verdict};
use residyn_core::data::Joint;
use residyn_core::model::FittedEffect;
use serde::{Deserialize, Serialize};

use super::choice::Purpose;

/// One run and what closing the loop on all runs so far says: a line of `rounds.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Counted from 1; its log is `run-001.csv`, and so on.
    pub run: usize,
    /// What its motion was for.
    pub purpose: Purpose,
    /// Motion of all runs so far, s.
    pub motion_s: f64,
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    /// Effects that are established.
    pub established: Vec<Named>,
    /// Effects that lower the error, without an established name.
    pub supported: Vec<Named>,
    /// Explanations that the runs do not tell from the established ones.
    pub alternatives: Vec<Named>,
    /// Whether the search for effects was stopped because its time ran out.
    pub stopped: bool,
    /// Root mean square of the open-loop error over half a second of this run, which the model of the runs before had not seen,
    /// rad (or m); none for the first run.
    pub unseen_rms: Option<f64>,
    /// The same for the model of all runs so far.
    pub rms: f64,
}

/// An effect by its name and joint.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Named {
    pub name: String,
    pub joint: Joint,
}

impl Named {
    /// The name of an effect on its joint.
    pub fn of(effect: &FittedEffect) -> Self {
        Self {
            name: effect.title(),
            joint: effect.joint,
        }
    }
}

/// The other explanations, without those that hold an established effect as a special case and explain no more than it.
pub(super) fn open_alternatives(outcome: &Outcome) -> impl Iterator<Item = &Alternative> {
    let effects = &outcome.effects;
    let holds_another = |alternative: &Alternative| {
        let mut found = effects.findings.iter();
        found.any(|finding| alternative.effect.contains(&finding.effect))
    };
    (effects.alternatives.iter()).filter(move |alternative| !holds_another(alternative))
}

fn sorted(names: &[Named]) -> Vec<Named> {
    let mut names = names.to_vec();
    names.sort();
    names
}

impl Round {
    /// What an outcome says after a run.
    pub(super) fn new(
        run: usize,
        purpose: Purpose,
        motion_s: f64,
        outcome: &Outcome,
        (unseen_rms, rms): (Option<f64>, f64),
    ) -> Self {
        let named = |findings: &[residyn_core::closeloop::Finding]| {
            findings
                .iter()
                .map(|finding| Named::of(&finding.effect))
                .collect()
        };
        let effects = &outcome.effects;
        Self {
            run,
            purpose,
            motion_s,
            verdict: outcome.verdict,
            reason: outcome.reason.clone(),
            established: named(&effects.findings),
            supported: named(&effects.supported),
            alternatives: (open_alternatives(outcome))
                .map(|alternative| Named::of(&alternative.effect))
                .collect(),
            stopped: effects.stopped,
            unseen_rms,
            rms,
        }
    }

    /// Whether nothing is open: the search came to its end, everything that was found is established, nothing else would explain it
    /// as well, and nothing significant is left.
    pub fn is_settled(&self) -> bool {
        let is_explained = matches!(self.verdict, Verdict::Explained | Verdict::NoMissingEffect);
        !self.stopped && is_explained && self.supported.is_empty() && self.alternatives.is_empty()
    }

    /// Whether it has the established names of another.
    pub fn agrees(&self, other: &Self) -> bool {
        sorted(&self.established) == sorted(&other.established)
    }

    /// Whether the same is established and open as in another.
    pub fn says_as(&self, other: &Self) -> bool {
        let open =
            |round: &Self| sorted(&[round.supported.as_slice(), &round.alternatives].concat());
        self.agrees(other) && open(self) == open(other)
    }
}

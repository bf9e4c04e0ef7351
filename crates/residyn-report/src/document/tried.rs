//! What the search tried: every set of effects, or of many sets what became of each joint.

use super::{Block, cells, folded, paragraph, table};
use crate::overview::in_order;
use crate::schema::{EffectName, Report, TriedEntry};
use crate::wording::{listed, reduction};
use residyn_core::data::Joint;

/// Up to this many sets, some two screens, are shown one by one. A search over the joints of a quadruped fits ten times as
/// many.
const MOST_SETS: usize = 60;

pub(super) fn tried(report: &Report) -> Block {
    let about = paragraph("Gain: relative drop of the loss on blocks held out of the fit.");
    let sets = report.tried.iter().map(Vec::len).sum();
    let blocks = match sets > MOST_SETS {
        true => by_joint(report, sets),
        false => one_by_one(report),
    };
    folded("What was tried", [vec![about], blocks].concat())
}

/// The sets of effects that were fitted, round by round.
fn one_by_one(report: &Report) -> Vec<Block> {
    let rounds = report.tried.iter().zip(&report.candidates).zip(1..);
    let rounds = rounds.flat_map(|((tried, candidates), number)| round(number, *candidates, tried));
    rounds.collect()
}

fn round(number: usize, candidates: usize, tried: &[TriedEntry]) -> Vec<Block> {
    let round = format!("Round {number} ({candidates} candidates");
    if tried.is_empty() {
        let none = "no set came near the loss that the round began with.";
        return vec![paragraph(format!("{round}): {none}"))];
    }
    let row = |tried: &TriedEntry| {
        let effects: Vec<&str> = tried.effects.iter().map(|e| e.label.as_str()).collect();
        let chosen = if tried.chosen { "chosen" } else { "" };
        cells([
            effects.join(", "),
            reduction(tried.gain, "loss"),
            chosen.to_owned(),
        ])
    };
    vec![
        paragraph(format!("{round}; the most promising sets were fitted):")),
        table(1, ["effects", "gain", ""], tried.iter().map(row)),
    ]
}

/// What became of each joint.
fn by_joint(report: &Report, sets: usize) -> Vec<Block> {
    let changes = changes(&report.tried);
    let found = report.effects.iter().chain(&report.supported);
    let model: Vec<Effect<'_>> = found
        .map(|effect| (effect.name.as_str(), effect.on()))
        .collect();
    let row = |(joint, _): (Joint, bool)| {
        let of_joint = OfJoint {
            changes: &changes,
            model: &model,
            joint,
        };
        cells([
            report.label(joint),
            of_joint.taken(),
            of_joint.dropped(),
            of_joint.refused(),
        ])
    };
    let rows = in_order(report.joints, &report.like_joints).into_iter();
    let rounds = report.tried.len();
    let heads = [
        "joint",
        "in the model, with the gain",
        "taken, dropped later",
        "best of those refused",
    ];
    vec![
        table(1, heads, rows.map(row)),
        paragraph(format!(
            "All {sets} sets, in {rounds} rounds, are under `tried` in report.json."
        )),
    ]
}

/// The name of an effect, and the joints that it acts on.
type Effect<'r> = (&'r str, Vec<Joint>);

/// A set of effects, beside the one with which its round began.
struct Change<'r> {
    added: Vec<&'r EffectName>,
    of: &'r TriedEntry,
    /// Of its round.
    chosen: Option<&'r TriedEntry>,
    began: Option<&'r TriedEntry>,
}

/// A round begins with the last choice on the joints that it is about: limbs are searched one by one.
fn changes(rounds: &[Vec<TriedEntry>]) -> Vec<Change<'_>> {
    let mut choices: Vec<&TriedEntry> = Vec::new();
    let mut changes = Vec::new();
    for round in rounds {
        let is_about = |joint: Joint| round.iter().any(|set| set.is_on(joint));
        let is_begin = |set: &&&TriedEntry| set.effects.iter().any(|own| is_about(own.joint));
        let began = choices.iter().rev().find(is_begin).copied();
        let chosen = round.iter().find(|set| set.chosen);
        changes.extend(round.iter().map(|of| Change {
            added: of.beyond(began),
            of,
            chosen,
            began,
        }));
        choices.extend(chosen);
    }
    changes
}

/// What the search did on a joint.
struct OfJoint<'r> {
    changes: &'r [Change<'r>],
    /// The effects of the model in the end.
    model: &'r [Effect<'r>],
    joint: Joint,
}

/// Gains below this are rounded to nothing.
const LEAST_GAIN: f64 = 5e-4;

impl<'r> OfJoint<'r> {
    fn chosen(&self) -> impl DoubleEndedIterator<Item = &'r Change<'r>> {
        self.changes.iter().filter(|change| change.of.chosen)
    }

    fn is_in_model(&self, effect: &EffectName) -> bool {
        let is_it = |(name, on): &Effect<'_>| *name == effect.name && *on == effect.on();
        self.model.iter().any(is_it)
    }

    fn was_taken(&self, effect: &EffectName) -> bool {
        let mut added = self.chosen().flat_map(|change| &change.added);
        added.any(|own| own.label == effect.label)
    }

    /// In the order in which it was taken: `coulomb_friction and viscous_friction 96.6 % (with 4 on other joints); load_friction
    /// 13.0 %`
    fn taken(&self) -> String {
        let mut said: Vec<&str> = Vec::new();
        let mut steps: Vec<String> = Vec::new();
        for change in self.chosen().rev() {
            let (own, others): (Vec<&EffectName>, Vec<&EffectName>) = change
                .added
                .iter()
                .partition(|effect| effect.on().contains(&self.joint));
            let is_new = |effect: &&&EffectName| {
                self.is_in_model(effect) && !said.contains(&effect.label.as_str())
            };
            let own: Vec<&EffectName> = own.iter().filter(is_new).copied().collect();
            said.extend(own.iter().map(|effect| effect.label.as_str()));
            let with = match others.len() {
                0 => String::new(),
                count => format!(" (with {count} on other joints)"),
            };
            let gain = reduction(change.of.gain, "loss");
            steps.extend((!own.is_empty()).then(|| format!("{} {gain}{with}", names(&own))));
        }
        steps.reverse();
        steps.join("; ")
    }

    fn dropped(&self) -> String {
        let mut dropped: Vec<&EffectName> = Vec::new();
        for effect in self.chosen().flat_map(|change| &change.added) {
            let is_own = effect.on().contains(&self.joint);
            let is_said = dropped.iter().any(|other| other.label == effect.label);
            if is_own && !is_said && !self.is_in_model(effect) {
                dropped.push(effect);
            }
        }
        names(&dropped)
    }

    /// The effect that did most on its own and was never taken, and why it was not: `cogging_torque 3.1 %: load_friction on
    /// joint 1 did more, 13.0 %`
    fn refused(&self) -> String {
        let alone = self
            .changes
            .iter()
            .filter_map(|change| match change.added[..] {
                [effect] if !change.of.chosen => Some((change, effect)),
                _ => None,
            });
        let refused = alone.filter(|(change, effect)| {
            let is_own = effect.on().contains(&self.joint);
            is_own
                && change.of.gain > LEAST_GAIN
                && !self.is_in_model(effect)
                && !self.was_taken(effect)
        });
        let best = refused.max_by(|a, b| a.0.of.gain.total_cmp(&b.0.of.gain));
        best.map_or_else(String::new, |(change, effect)| {
            let gain = reduction(change.of.gain, "loss");
            format!("{} {gain}: {}", effect.name, change.why_refused())
        })
    }
}

impl Change<'_> {
    fn why_refused(&self) -> String {
        let Some(chosen) = self.chosen else {
            return "too little".to_owned();
        };
        let gain = reduction(chosen.gain, "loss");
        match chosen.beyond(self.began)[..] {
            [] => "too little".to_owned(),
            [one] => format!("{} did more, {gain}", one.label),
            [one, ref others @ ..] => {
                format!("{} and {} others did more, {gain}", one.label, others.len())
            }
        }
    }
}

fn names(effects: &[&EffectName]) -> String {
    let names: Vec<String> = effects.iter().map(|effect| effect.name.clone()).collect();
    listed(&names)
}

impl TriedEntry {
    fn is_on(&self, joint: Joint) -> bool {
        self.effects
            .iter()
            .any(|effect| effect.on().contains(&joint))
    }

    fn holds(&self, effect: &EffectName) -> bool {
        self.effects.iter().any(|own| own.label == effect.label)
    }

    /// The effects that another set lacks.
    fn beyond(&self, other: Option<&Self>) -> Vec<&EffectName> {
        let is_new = |effect: &&EffectName| !other.is_some_and(|other| other.holds(effect));
        self.effects.iter().filter(is_new).collect()
    }
}

impl EffectName {
    fn on(&self) -> Vec<Joint> {
        self.joints.clone().unwrap_or_else(|| vec![self.joint])
    }
}

#[cfg(test)]
mod tests {
    use super::{OfJoint, changes};
    use crate::schema::{EffectName, TriedEntry};
    use residyn_core::data::Joint;

    /// A set of effects with their joints.
    fn set(effects: &[(&str, usize)], gain: f64, chosen: bool) -> TriedEntry {
        let effect = |(name, joint): &(&str, usize)| EffectName {
            name: (*name).to_owned(),
            joint: Joint::at(joint - 1),
            joints: None,
            label: format!("{name} on joint {joint}"),
            parameter: None,
        };
        TriedEntry {
            effects: effects.iter().map(effect).collect(),
            gain,
            chosen,
        }
    }

    #[test]
    fn each_joint_says_what_was_taken_dropped_and_refused() {
        let base = [("friction", 1), ("friction", 2)];
        let with = |more: &[(&'static str, usize)]| [&base[..], more].concat();
        let rounds = [
            vec![set(&base, 0.9, true)],
            vec![
                set(&with(&[("delay", 1), ("lag", 2)]), 0.4, false),
                set(&with(&[("delay", 1)]), 0.3, true),
                set(&with(&[("lag", 1)]), 0.2, false),
                set(&with(&[("lag", 2)]), 0.04, false),
                set(&with(&[("drag", 1)]), 0.25, false),
            ],
            vec![set(&with(&[("delay", 1), ("lag", 1)]), 0.001, false)],
            vec![set(&with(&[("delay", 1), ("drag", 1)]), 0.002, true)],
            // Another limb.
            vec![set(&[("spring", 3)], 0.5, true)],
        ];
        let changes = changes(&rounds);
        let [first, second, third] = [0, 1, 2].map(Joint::at);
        let model = [
            ("friction", vec![first]),
            ("delay", vec![first]),
            ("spring", vec![third]),
        ];
        let said = |joint: Joint| {
            let of_joint = OfJoint {
                changes: &changes,
                model: &model,
                joint,
            };
            [of_joint.taken(), of_joint.dropped(), of_joint.refused()]
        };
        assert_eq!(
            said(first),
            [
                "friction 90.0 % (with 1 on other joints); delay 30.0 %",
                "drag",
                "lag 20.0 %: delay on joint 1 did more, 30.0 %"
            ]
        );
        let lag = "lag 4.0 %: delay on joint 1 did more, 30.0 %";
        assert_eq!(said(second), ["", "friction", lag]);
        assert_eq!(said(third), ["spring 50.0 %", "", ""]);
        assert_eq!(said(Joint::at(3)), ["", "", ""]);
    }
}

//! Named effects against the true ones.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::coverage::{Coverage, coverage};
use super::grid::Group;
use super::hidden::{Hidden, Label};
use super::recording::log_name;
use residyn_core::closeloop::Verdict;

/// The effects that the rig hides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Each with the true values of its parameters.
    pub effects: Vec<(Label, BTreeMap<String, f64>)>,
    /// True values of declared parameters, if the rig fixes them.
    pub declared: BTreeMap<String, f64>,
    /// Other sets of effects that the logs cannot distinguish from these: they count as right.
    #[serde(default)]
    pub twins: Vec<Vec<Label>>,
}

/// A value with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    pub name: String,
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

/// An effect that was named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    pub label: Label,
    /// Named as in the effect's file.
    pub parameters: Vec<Estimate>,
    pub p_value: f64,
    /// Share of the error that returns without it.
    pub error_reduction: Option<f64>,
}

/// The outcome of closing the loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    pub verdict: Verdict,
    pub reason: String,
    pub named: Vec<Named>,
    /// Sets of effects that are listed as alternatives.
    pub alternatives: Vec<Vec<Label>>,
    pub declared: Vec<Estimate>,
    /// The reported unexplained residual: its share, its p-value, and what it depends on.
    pub left: f64,
    pub left_p_value: f64,
    pub left_where: String,
}

impl Answer {
    fn estimates(&self) -> Vec<(Label, Vec<Estimate>)> {
        let of = |named: &Named| (named.label.clone(), named.parameters.clone());
        self.named.iter().map(of).collect()
    }
}

/// The answer compared with the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    /// The true effects, or a set that the logs cannot distinguish from them, were named, each on its joint, and
    /// nothing else.
    pub exact: bool,
    /// As `exact`, after swapping named effects for alternatives that were listed with them.
    pub within: bool,
    /// Effects that were named and are absent.
    pub wrong: Vec<Label>,
    /// Effects that are present and were not named.
    pub missed: Vec<Label>,
    /// A significant unexplained residual is reported.
    pub flagged: bool,
    /// Effects that were named, are absent, and reduce the error by less than half.
    pub weak: Vec<Label>,
    /// Coverage of the parameters of true effects that were named, as `label.name`, and of declared parameters, by
    /// their names; of many joints, of those whose effects are named, and nothing else, if not all are.
    pub coverage: Vec<Coverage>,
    /// The cell meets the criterion of its group.
    pub passed: bool,
}

/// An effect that reduces the error by less than this share explains nothing in a rig whose hidden effect the library
/// lacks.
const HALF: f64 = 0.5;

/// The name of a parameter's value in a single log: `q_z[log1.csv]`.
pub fn of_log(parameter: &str, log: &str) -> String {
    format!("{parameter}[{log}]")
}

/// An effect's numbers; for an offset, its value in each log.
fn values(effect: &Hidden, offsets: &[Vec<f64>]) -> BTreeMap<String, f64> {
    if effect.name != "sensor_offset" {
        return effect.values.clone();
    }
    let in_log =
        |(k, offset): (usize, &Vec<f64>)| (of_log("q_z", &log_name(k)), offset[effect.joint]);
    offsets.iter().enumerate().map(in_log).collect()
}

impl Truth {
    /// The truth about a rig with these effects and `declared` parameters, whose encoders read high by `offsets` rad,
    /// `[log][joint]`.
    pub fn of(effects: &[Hidden], declared: BTreeMap<String, f64>, offsets: &[Vec<f64>]) -> Self {
        Self {
            effects: effects
                .iter()
                .map(|effect| (effect.label(), values(effect, offsets)))
                .collect(),
            declared,
            twins: Vec::new(),
        }
    }

    /// The set, among the true one and its twins, that has most in common with the `named` effects.
    fn nearest(&self, named: &[Label]) -> Vec<Label> {
        let off = |set: &Vec<Label>| without(set, named).len() + without(named, set).len();
        let sets = std::iter::once(self.labels()).chain(self.twins.iter().cloned());
        sets.min_by_key(off).unwrap_or_default()
    }

    fn labels(&self) -> Vec<Label> {
        self.effects
            .iter()
            .map(|(label, _)| label.clone())
            .collect()
    }
}

/// Compares an answer with the truth.
pub fn judge(group: Group, truth: &Truth, answer: &Answer) -> Judgement {
    let labels = |named: &Named| named.label.clone();
    let named: Vec<Label> = answer.named.iter().map(labels).collect();
    let there = truth.nearest(&named);
    let wrong = without(&named, &there);
    let missed = without(&there, &named);
    let exact = wrong.is_empty() && missed.is_empty();
    let is_truth =
        |set: &Vec<Label>| without(set, &there).is_empty() && without(&there, set).is_empty();
    let listed = |label: &Label| answer.alternatives.iter().any(|set| set.contains(label));
    let swapped = missed.iter().all(listed) && wrong.len() <= missed.len();
    let within = exact || swapped || answer.alternatives.iter().any(is_truth);
    let flagged = matches!(
        answer.verdict,
        Verdict::Unexplained | Verdict::PartlyExplained
    );
    let weak: Vec<Label> = answer
        .named
        .iter()
        .filter(|effect| effect.error_reduction.is_none_or(|share| share < HALF))
        .map(labels)
        .filter(|label| wrong.contains(label))
        .collect();
    let passed = match group {
        Group::Single
        | Group::Pair
        | Group::Several
        | Group::Joints
        | Group::Told
        | Group::Repeated => exact,
        Group::None => named.is_empty() && !flagged,
        Group::Outside => flagged && weak.is_empty(),
    };
    Judgement {
        exact,
        within,
        flagged,
        weak,
        coverage: match (exact, group) {
            (true, _) => coverage(truth, &answer.estimates(), &answer.declared),
            (false, Group::Joints) => {
                let off: Vec<&str> = wrong.iter().chain(&missed).map(of_joint).collect();
                let mut right = answer.estimates();
                right.retain(|(label, _)| !off.contains(&of_joint(label)));
                coverage(truth, &right, &[])
            }
            (false, _) => Vec::new(),
        },
        wrong,
        missed,
        passed,
    }
}

/// The joint in a label.
fn of_joint(label: &Label) -> &str {
    label.rsplit('@').next().unwrap_or_default()
}

/// The labels of `a` that are not in `b`.
fn without(a: &[Label], b: &[Label]) -> Vec<Label> {
    a.iter()
        .filter(|label| !b.contains(label))
        .cloned()
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use residyn_core::data::Joint;

    fn named(label: &str, values: &[(&str, f64, [f64; 2])], error_reduction: f64) -> Named {
        let estimate = |(name, value, interval): &(&str, f64, [f64; 2])| Estimate {
            name: (*name).to_owned(),
            value: *value,
            ci95: Some(*interval),
        };
        Named {
            label: label.to_owned(),
            parameters: values.iter().map(estimate).collect(),
            p_value: 1e-6,
            error_reduction: Some(error_reduction),
        }
    }

    fn answer(verdict: Verdict, named: Vec<Named>, alternatives: &[&[&str]]) -> Answer {
        let set = |set: &&[&str]| set.iter().map(|label| (*label).to_owned()).collect();
        Answer {
            verdict,
            reason: String::new(),
            named,
            alternatives: alternatives.iter().map(set).collect(),
            declared: Vec::new(),
            left: 0.0,
            left_p_value: 1.0,
            left_where: "none".to_owned(),
        }
    }

    fn truth(effects: &[(&str, &[(&str, f64)])]) -> Truth {
        let values = |values: &[(&str, f64)]| {
            let values = values.iter();
            values
                .map(|(name, value)| ((*name).to_owned(), *value))
                .collect()
        };
        Truth {
            effects: effects
                .iter()
                .map(|(label, own)| ((*label).to_owned(), values(own)))
                .collect(),
            declared: BTreeMap::new(),
            twins: Vec::new(),
        }
    }

    fn coulomb() -> Truth {
        truth(&[("coulomb_friction@1", &[("F_c", 0.1)])])
    }

    #[test]
    fn the_intervals_of_an_exact_answer_are_checked() {
        let values = [("F_c", 0.11, [0.105, 0.115])];
        let answer = answer(
            Verdict::Explained,
            vec![named("coulomb_friction@1", &values, 0.9)],
            &[],
        );
        let judgement = judge(Group::Single, &coulomb(), &answer);
        assert!(judgement.exact && judgement.within && judgement.passed);
        assert_eq!(judgement.coverage.len(), 1);
        assert!(!judgement.coverage[0].covered);
    }

    #[test]
    fn an_effect_on_the_wrong_joint_counts_as_wrong_and_missed() {
        let answer = answer(
            Verdict::Explained,
            vec![named("coulomb_friction@2", &[], 0.9)],
            &[],
        );
        let judgement = judge(Group::Single, &coulomb(), &answer);
        assert!(!judgement.exact && !judgement.within);
        assert_eq!(judgement.wrong, ["coulomb_friction@2"]);
        assert_eq!(judgement.missed, ["coulomb_friction@1"]);
    }

    #[test]
    fn a_listed_alternative_counts_but_an_additional_effect_does_not() {
        let viscous = || named("viscous_friction@1", &[], 0.9);
        let listed: &[&[&str]] = &[&["coulomb_friction@1"]];
        let swapped = answer(Verdict::Explained, vec![viscous()], listed);
        let judgement = judge(Group::Single, &coulomb(), &swapped);
        assert!(!judgement.exact && judgement.within && !judgement.passed);
        let more = vec![viscous(), named("joint_spring@1", &[], 0.1)];
        let added = answer(
            Verdict::Explained,
            more,
            &[&["coulomb_friction@1", "joint_spring@1"]],
        );
        assert!(!judge(Group::Single, &coulomb(), &added).within);
    }

    #[test]
    fn a_set_that_the_logs_do_not_tell_from_the_true_one_is_right() {
        let mut delayed = truth(&[("coulomb_friction@1", &[]), ("actuator_delay@1", &[])]);
        let named = || {
            vec![
                named("actuator_lag@1", &[], 0.9),
                named("coulomb_friction@1", &[], 0.9),
            ]
        };
        let judged = |truth: &Truth| {
            let answer = answer(Verdict::Explained, named(), &[]);
            judge(Group::Several, truth, &answer)
        };
        assert_eq!(judged(&delayed).missed, ["actuator_delay@1"]);
        let labels = ["coulomb_friction@1", "actuator_lag@1"].map(str::to_owned);
        delayed.twins.push(labels.to_vec());
        assert!(judged(&delayed).exact && judged(&delayed).passed);
        delayed.twins[0].pop();
        assert_eq!(judged(&delayed).wrong, ["actuator_lag@1"]);
    }

    #[test]
    fn one_effect_may_stand_for_two_where_that_set_is_listed() {
        let pair = truth(&[("coulomb_friction@1", &[]), ("viscous_friction@1", &[])]);
        let one = vec![named("asymmetric_friction@1", &[], 0.9)];
        let listed: &[&[&str]] = &[&["viscous_friction@1", "coulomb_friction@1"]];
        let answer = answer(Verdict::Explained, one, listed);
        assert!(judge(Group::Pair, &pair, &answer).within);
    }

    #[test]
    fn outside_the_library_a_flag_passes_and_weak_effects_fail() {
        let cubic = truth(&[("cubic_damping@1", &[])]);
        let pass =
            |verdict, named| judge(Group::Outside, &cubic, &answer(verdict, named, &[])).passed;
        assert!(pass(Verdict::Unexplained, Vec::new()));
        assert!(!pass(Verdict::NoMissingEffect, Vec::new()));
        let drag = |share| vec![named("quadratic_drag@1", &[], share)];
        assert!(pass(Verdict::PartlyExplained, drag(0.8)));
        assert!(!pass(Verdict::PartlyExplained, drag(0.4)));
        assert!(!pass(Verdict::Explained, drag(0.8)));
    }

    #[test]
    fn the_intervals_of_many_joints_are_checked_where_all_names_are_right() {
        let hidden: [(&str, &[(&str, f64)]); 3] = [
            ("coulomb_friction@1", &[("F_c", 0.1)]),
            ("coulomb_friction@2", &[("F_c", 0.1)]),
            ("rotor_inertia@2", &[("J", 0.01)]),
        ];
        let level = [("F_c", 0.11, [0.09, 0.13])];
        let names = ["coulomb_friction@1", "coulomb_friction@2"];
        let found = names.map(|name| named(name, &level, 0.9)).to_vec();
        let answer = answer(Verdict::Explained, found, &[]);
        let covered = |group| judge(group, &truth(&hidden), &answer).coverage;
        assert_eq!(covered(Group::Several), []);
        let covered = covered(Group::Joints);
        let names: Vec<&str> = covered.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["coulomb_friction@1.F_c"]);
    }

    #[test]
    fn sensor_offsets_are_judged_per_log() {
        let hidden = Hidden {
            name: "sensor_offset".to_owned(),
            joint: Joint::at(1),
            values: [("q_z".to_owned(), 0.1)].into(),
        };
        let values = values(&hidden, &[vec![0.0, 0.05], vec![0.0, -0.02]]);
        let found = values.iter().map(|(name, value)| (name.as_str(), *value));
        let found: Vec<(&str, f64)> = found.collect();
        assert_eq!(found, [("q_z[log1.csv]", 0.05), ("q_z[log2.csv]", -0.02)]);
    }

    #[test]
    fn a_ripple_of_opposite_sign_and_phase_is_recognised() {
        let ripple = truth(&[(
            "cogging_torque@1",
            &[("A", 0.1), ("N", 7.0), ("phase", 1.0)],
        )]);
        let values = [
            ("A", -0.1, [-0.11, -0.09]),
            ("phase", 1.0 + PI, [0.9 + PI, 1.1 + PI]),
        ];
        let found = vec![named("cogging_torque@1", &values, 0.9)];
        let judgement = judge(
            Group::Single,
            &ripple,
            &answer(Verdict::Explained, found, &[]),
        );
        assert_eq!(judgement.coverage.len(), 2);
        assert!(judgement.coverage.iter().all(|c| c.covered));
    }
}

//! Where joints that are built alike differ.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{OwnValues, Side, stem};
use crate::json::parameter;
use crate::schema::Report;
use crate::wording::{listed, small};
use residyn_core::data::Joint;
use residyn_core::data::statistics::mean;
use residyn_core::digits::with_unit;

/// a value of some joints whose 95 % intervals lie apart from those of the joints that are built alike
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(crate) struct DifferenceEntry {
    /// the effect or, for a constant of the drives, its name
    pub of: String,
    /// the parameter's name without its joint's number
    pub parameter: String,
    pub unit: String,
    #[schemars(length(min = 1))]
    pub joints: Vec<Joint>,
    /// mean over these joints
    pub value: f64,
    /// the like joints to which they are compared
    #[schemars(length(min = 1))]
    pub others: Vec<Joint>,
    /// mean over those
    pub of_others: f64,
}

/// Smaller differences, as a share of the larger value, are not worth a word: friction repeats no better from day to day, and
/// what a model leaves out moves values of equal joints by some hundredths, beyond intervals that know of noise alone.
const LEAST: f64 = 0.1;

impl DifferenceEntry {
    pub fn side(&self) -> Side {
        match self.value > self.of_others {
            true => Side::Above,
            false => Side::Below,
        }
    }

    /// `RL_calf: coulomb_friction F_c 1.40 N m, 1.6 times that of FL_calf and RR_calf`
    pub fn text(&self, report: &Report) -> String {
        let what = match self.of == self.parameter {
            true => self.of.clone(),
            false => format!("{} {}", self.of, self.parameter),
        };
        let amount = |value: f64| with_unit(small(value), &self.unit);
        let [own, others] =
            [&self.joints, &self.others].map(|joints| listed(&report.short_names(joints)));
        let compared = match self.of_others > 0.0 && self.value > 0.0 {
            true => format!(
                "{} times that of {others}",
                times(self.value / self.of_others)
            ),
            false => format!("against {} on {others}", amount(self.of_others)),
        };
        format!("{own}: {what} {}, {compared}", amount(self.value))
    }

    /// The difference as a share of the larger of the two.
    fn share(&self) -> f64 {
        let [value, others] = [self.value, self.of_others];
        let largest = value.abs().max(others.abs());
        (value - others).abs() / largest.max(f64::MIN_POSITIVE)
    }
}

/// A ratio with two digits.
fn times(ratio: f64) -> String {
    match ratio {
        10.0.. => format!("{ratio:.0}"),
        1.0.. => format!("{ratio:.1}"),
        _ => format!("{ratio:.2}"),
    }
}

/// A value of one joint.
#[derive(Clone, Copy)]
struct Known {
    joint: Joint,
    value: f64,
    ci95: [f64; 2],
}

/// The differences within groups of like joints, the largest first.
pub(crate) fn differences(like: &[Vec<Joint>], all: &[OwnValues]) -> Vec<DifferenceEntry> {
    let mut found: Vec<DifferenceEntry> =
        like.iter().flat_map(|group| within(group, all)).collect();
    found.retain(|one| one.share() > LEAST);
    found.sort_by(|a, b| b.share().total_cmp(&a.share()));
    found
}

/// What a joint has: the quantity, and what else on the joint its value depends on.
#[derive(PartialEq)]
struct Quantity {
    of: String,
    parameter: String,
    unit: String,
    /// Friction of one kind says little next to friction of two: values are compared where the same effects stand beside them.
    beside: Vec<String>,
}

fn within(group: &[Joint], all: &[OwnValues]) -> Vec<DifferenceEntry> {
    let mut quantities: Vec<(Quantity, Vec<Known>)> = Vec::new();
    for joint in group {
        let own = all
            .iter()
            .filter(|own| own.is_comparable && own.joints == [*joint]);
        for (quantity, known) in own.flat_map(|own| known(own, *joint, all)) {
            match quantities.iter_mut().find(|(other, _)| *other == quantity) {
                Some((_, values)) => values.push(known),
                None => quantities.push((quantity, vec![known])),
            }
        }
    }
    quantities
        .into_iter()
        .flat_map(|(quantity, values)| {
            let contrasts = contrasts_of(values).into_iter();
            contrasts.map(move |[own, others]| DifferenceEntry {
                of: quantity.of.clone(),
                parameter: quantity.parameter.clone(),
                unit: quantity.unit.clone(),
                joints: joints(&own),
                value: middle(&own),
                others: joints(&others),
                of_others: middle(&others),
            })
        })
        .collect()
}

/// The values that the logs determine.
fn known(own: &OwnValues, joint: Joint, all: &[OwnValues]) -> Vec<(Quantity, Known)> {
    let beside = all
        .iter()
        .filter(|other| other.of != own.of && own.trades_with(other));
    let mut beside: Vec<String> = beside.map(|other| other.of.clone()).collect();
    beside.sort_unstable();
    let shared = own.parameters.iter().filter(|p| !p.per_log).map(parameter);
    shared
        .filter(|parameter| parameter.identifiable)
        .filter_map(|parameter| {
            let quantity = Quantity {
                of: own.of.clone(),
                parameter: stem(&parameter.name, &own.of, joint),
                unit: parameter.unit,
                beside: beside.clone(),
            };
            let value = parameter.value;
            let ci95 = parameter.ci95?;
            Some((quantity, Known { joint, value, ci95 }))
        })
        .collect()
}

fn joints(values: &[Known]) -> Vec<Joint> {
    let mut joints: Vec<Joint> = values.iter().map(|known| known.joint).collect();
    joints.sort_unstable();
    joints
}

fn middle(values: &[Known]) -> f64 {
    let values: Vec<f64> = values.iter().map(|known| known.value).collect();
    mean(&values)
}

/// Values that differ, each with those that they differ from: the most that agree or, of equally many, those in the middle.
///
/// Values agree if their intervals overlap, or are linked by others that overlap both: so that a value has to lie beyond its
/// own interval and those of all others.
fn contrasts_of(mut values: Vec<Known>) -> Vec<[Vec<Known>; 2]> {
    values.sort_by(|a, b| a.ci95[0].total_cmp(&b.ci95[0]));
    let mut apart: Vec<Vec<Known>> = Vec::new();
    let mut end = f64::NEG_INFINITY;
    for known in values {
        match apart.last_mut().filter(|_| known.ci95[0] <= end) {
            Some(agreeing) => agreeing.push(known),
            None => apart.push(vec![known]),
        }
        end = end.max(known.ci95[1]);
    }
    let most = apart.iter().map(Vec::len).max().unwrap_or(0);
    let largest: Vec<usize> = (0..apart.len())
        .filter(|k| apart[*k].len() == most)
        .collect();
    let Some(usual) = largest.get(largest.len().saturating_sub(1) / 2).copied() else {
        return Vec::new();
    };
    let others = (0..apart.len()).filter(|k| *k != usual);
    others
        .map(|k| [apart[k].clone(), apart[usual].clone()])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Known, contrasts_of, differences, times};
    use crate::overview::OwnValues;
    use residyn_core::data::Joint;
    use residyn_core::model::Parameter;

    /// Which joints differ from which, given values with the half widths of their intervals.
    fn differ(values: &[[f64; 2]]) -> Vec<[Vec<usize>; 2]> {
        let known = |(k, [value, half]): (usize, &[f64; 2])| Known {
            joint: Joint::at(k),
            value: *value,
            ci95: [value - half, value + half],
        };
        let contrasts = contrasts_of(values.iter().enumerate().map(known).collect());
        let numbers =
            |joints: Vec<Known>| super::joints(&joints).iter().map(|j| j.number()).collect();
        contrasts
            .into_iter()
            .map(|pair| pair.map(numbers))
            .collect()
    }

    #[test]
    fn a_joint_differs_if_its_interval_lies_apart_from_all_others() {
        let calves = [[0.94, 0.07], [0.41, 0.02], [1.40, 0.11], [0.85, 0.06]];
        assert_eq!(
            differ(&calves),
            [[vec![2], vec![1, 4]], [vec![3], vec![1, 4]]]
        );
        let linked = [[1.0, 0.1], [1.15, 0.1], [1.3, 0.1]];
        assert!(differ(&linked).is_empty());
    }

    #[test]
    fn a_pair_is_compared_with_the_lower_of_the_two_and_two_pairs_with_each_other() {
        assert_eq!(differ(&[[2.0, 0.1], [1.0, 0.1]]), [[vec![1], vec![2]]]);
        let pairs = [[1.0, 0.1], [2.0, 0.1], [1.05, 0.1], [2.05, 0.1]];
        assert_eq!(differ(&pairs), [[vec![2, 4], vec![1, 3]]]);
        assert!(differ(&[[1.0, 0.1]]).is_empty() && differ(&[]).is_empty());
    }

    #[test]
    fn a_difference_of_a_few_per_cent_is_none() {
        let friction = |(k, value): (usize, &f64)| OwnValues {
            of: "coulomb_friction".to_owned(),
            joints: vec![Joint::at(k)],
            parameters: vec![Parameter {
                name: format!("F_c{}", k + 1),
                value: *value,
                unit: "N m".to_owned(),
                bounds: [0.0, f64::INFINITY],
                fixed: false,
                per_log: false,
                per_group: false,
                ci95: Some([0.999 * value, 1.001 * value]),
                scale: 0.1,
            }],
            is_comparable: true,
            related: Vec::new(),
        };
        let found = |values: [f64; 4]| {
            let all: Vec<OwnValues> = values.iter().enumerate().map(friction).collect();
            let like = [(0..4).map(Joint::at).collect()];
            let found = differences(&like, &all).into_iter();
            found.map(|one| one.joints).collect::<Vec<_>>()
        };
        assert!(found([0.25, 0.25, 0.257, 0.245]).is_empty());
        assert_eq!(found([0.25, 0.25, 0.45, 0.257]), [[Joint::at(2)]]);
    }

    #[test]
    fn ratios_have_two_digits() {
        assert_eq!([0.456, 1.62, 23.4].map(times), ["0.46", "1.6", "23"]);
    }
}

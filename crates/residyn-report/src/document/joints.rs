//! Each joint of a rig of many: its effects, its errors and its pictures.

use super::Block::{self, Boxed, Drawn, List, Part};
use super::{better, heading, missing, values};
use crate::overview::in_order;
use crate::page;
use crate::schema::{AlternativeEntry, EffectEntry, Report};
use residyn_core::data::Joint;

/// The identifier of a joint's part.
pub(super) fn id(joint: Joint) -> String {
    format!("joint-{joint}")
}

pub(super) fn parts(report: &Report) -> Vec<Block> {
    let joints = in_order(report.joints, &report.like_joints).into_iter();
    joints.map(|(joint, _)| part(report, joint)).collect()
}

fn part(report: &Report, joint: Joint) -> Block {
    let pictures = Drawn {
        page: page::pictures_of(report, joint),
        files: &[],
    };
    let parts = [
        differences(report, joint),
        effects(report, joint),
        declared(report, joint),
        rivals(report, joint),
        better::of_joint(report, joint),
        vec![pictures],
    ];
    let both = report.effects.iter().chain(&report.supported);
    let own = both.filter(|effect| effect.on().contains(&joint));
    let own: Vec<&str> = own.map(|effect| effect.title.as_str()).collect();
    let found = match own.is_empty() {
        true => "no effect found".to_owned(),
        false => own.join(", "),
    };
    Part {
        id: id(joint),
        about: format!("Joint {}: {found}", report.label(joint)),
        blocks: parts.concat(),
    }
}

fn differences(report: &Report, joint: Joint) -> Vec<Block> {
    let own = report
        .differences
        .iter()
        .filter(|one| one.joints.contains(&joint));
    listed(None, own.map(|one| one.text(report)).collect())
}

fn effects(report: &Report, joint: Joint) -> Vec<Block> {
    let is_own = |effect: &&EffectEntry| effect.on().contains(&joint);
    let cards: Vec<Block> = (report.effects.iter().filter(is_own))
        .map(|effect| missing::card(report, effect))
        .collect();
    let cards = (!cards.is_empty()).then_some(Boxed("cards", cards));
    let supported = report.supported.iter().filter(is_own);
    let supported = listed(
        Some("Supported, not established"),
        supported.map(missing::supported_item).collect(),
    );
    cards.into_iter().chain(supported).collect()
}

fn declared(report: &Report, joint: Joint) -> Vec<Block> {
    let own = report.of_joints.iter().filter(|own| own.joint == joint);
    let item = own.map(|own| format!("{}: {}", own.of, values(&own.parameters)));
    listed(Some("Of the model file, refitted"), item.collect())
}

fn rivals(report: &Report, joint: Joint) -> Vec<Block> {
    let label = report.label(joint);
    // One that couples two joints has a place of both.
    let is_own =
        |rival: &&AlternativeEntry| rival.place.split(" with ").any(|place| place == label);
    let item = |rival: &AlternativeEntry| {
        format!(
            "**{}**: {}. To tell: {}.",
            rival.title, rival.reason, rival.experiment
        )
    };
    let own = report.alternatives.iter().filter(is_own);
    listed(Some("Other explanations"), own.map(item).collect())
}

/// A list under a title, if there is anything to list.
fn listed(title: Option<&str>, items: Vec<String>) -> Vec<Block> {
    if items.is_empty() {
        return Vec::new();
    }
    let title = title.map(heading);
    title.into_iter().chain([List(items)]).collect()
}

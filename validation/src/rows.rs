//! The rows of the table: how often the answer was right.

use serde::{Deserialize, Serialize};

use super::cell::{Findings, KnownStructure, Searched};
use super::coverage::Coverage;
use super::grid::{Cell, Group};
use super::hidden::{Hidden, Label};
use super::judge::Judgement;
use super::table::Line;
use residyn_core::data::statistics::wilson;

/// A relative frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    pub hits: usize,
    pub of: usize,
}

impl Rate {
    pub fn count(all: impl Iterator<Item = bool>) -> Self {
        all.fold(Self { hits: 0, of: 0 }, |rate, hit| Self {
            hits: rate.hits + usize::from(hit),
            of: rate.of + 1,
        })
    }

    /// The share; NaN without a trial.
    #[allow(clippy::cast_precision_loss)] // counts are small
    pub fn share(self) -> f64 {
        self.hits as f64 / self.of as f64
    }

    /// 95 % interval of the share (Wilson 1927).
    pub fn wilson(self) -> [f64; 2] {
        wilson(self.hits, self.of)
    }
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    pub what: String,
    pub rate: Rate,
    pub wilson: [f64; 2],
}

impl Row {
    pub fn new(what: impl Into<String>, rate: Rate) -> Self {
        Self {
            what: what.into(),
            rate,
            wilson: rate.wilson(),
        }
    }
}

/// The error after closing the loop counts as equally small if it is at most this factor times the true structure's.
const AS_GOOD: f64 = 1.1;

/// A cell that was run; if closing the loop failed on it, it counts as not passed everywhere.
pub struct Done<'l> {
    pub cell: &'l Cell,
    pub findings: Option<&'l Searched>,
    pub message: Option<&'l KnownStructure>,
}

impl<'l> Done<'l> {
    pub fn of(line: &'l Line) -> Self {
        let (findings, message) = match &line.findings {
            Ok(Findings::Searched(searched)) => (Some(&**searched), None),
            Ok(Findings::Told(message)) => (None, Some(message)),
            Err(_) => (None, None),
        };
        Self {
            cell: &line.cell,
            findings,
            message,
        }
    }

    pub fn shows(&self, what: impl Fn(&Judgement) -> bool) -> bool {
        self.findings.is_some_and(|f| what(&f.judgement))
    }

    pub fn ratio(&self) -> Option<f64> {
        self.findings?.errors.ratio()
    }

    /// Coverage of the effects that were named, or of those that the fit was told.
    pub fn coverage(&self) -> &[Coverage] {
        let named = self.findings.map(|f| &f.judgement.coverage);
        let message = self.message.map(|message| &message.coverage);
        named.or(message).map_or(&[], Vec::as_slice)
    }

    /// Each hidden effect, and whether it is named on its joint; a cell that could not be run has named nothing.
    pub fn hidden(&self) -> impl Iterator<Item = (Label, bool)> {
        let labels = self.cell.effects.iter().map(Hidden::label);
        labels.map(|label| {
            let is_named = self.shows(|j| !j.missed.contains(&label));
            (label, is_named)
        })
    }

    /// Each named effect, and whether it is hidden on its joint.
    pub fn named(&self) -> impl Iterator<Item = (Label, bool)> {
        self.findings.into_iter().flat_map(|f| {
            let is_hidden = |label: &Label| !f.judgement.wrong.contains(label);
            let labels = f.answer.named.iter().map(|named| named.label.clone());
            labels.map(move |label| (label.clone(), is_hidden(&label)))
        })
    }

    pub fn is_told(&self) -> bool {
        self.cell.group == Group::Told
    }
}

/// How often the answer was right, by question; `ratios` are errors divided by the true structure's.
pub fn rows(done: &[Done<'_>], ratios: &[f64]) -> Vec<Row> {
    let of = |group: Group, hit: &dyn Fn(&Done<'_>) -> bool| {
        Rate::count(done.iter().filter(|d| d.cell.group == group).map(hit))
    };
    let exact = |d: &Done<'_>| d.shows(|j| j.exact);
    let within = |d: &Done<'_>| d.shows(|j| j.within);
    let named = |d: &Done<'_>| !d.findings.is_some_and(|f| f.answer.named.is_empty());
    let false_alarms = |d: &Done<'_>| !d.shows(|j| !j.flagged);
    let flagged = |d: &Done<'_>| d.shows(|j| j.flagged);
    let passed = |d: &Done<'_>| d.shows(|j| j.passed);
    let mut rows = vec![
        Row::new("one effect: exact", of(Group::Single, &exact)),
        Row::new(
            "one effect: exact or a listed alternative",
            of(Group::Single, &within),
        ),
        Row::new("two effects: exact", of(Group::Pair, &exact)),
        Row::new(
            "two effects: exact or listed alternatives",
            of(Group::Pair, &within),
        ),
    ];
    rows.extend(rows_of_several(done));
    rows.extend([
        Row::new("no effect: something is named", of(Group::None, &named)),
        Row::new(
            "no effect: something is flagged",
            of(Group::None, &false_alarms),
        ),
        Row::new(
            "no effect: nothing is named, nothing flagged",
            of(Group::None, &passed),
        ),
        Row::new("outside the library: flagged", of(Group::Outside, &flagged)),
        Row::new(
            "outside the library: flagged, and no false name that cuts less than half of the error",
            of(Group::Outside, &passed),
        ),
    ]);
    rows.push(Row::new(
        "repeated readings: the same effects as without",
        of(Group::Repeated, &passed),
    ));
    rows.extend(rows_of_intervals(done));
    rows.push(Row::new(
        "error after within a tenth of that of the true structure",
        Rate::count(ratios.iter().map(|ratio| *ratio <= AS_GOOD)),
    ));
    rows
}

/// Rigs that hide several effects: how many were named completely, and how many of the effects.
fn rows_of_several(done: &[Done<'_>]) -> Vec<Row> {
    let several = of_group(done, Group::Several);
    let exact = |joints: usize| {
        let on = several.iter().filter(|d| d.cell.joints() == Some(joints));
        Rate::count(on.map(|d| d.shows(|j| j.exact)))
    };
    let within = several.iter().map(|d| d.shows(|j| j.within));
    let mut rows = vec![
        Row::new("several effects, one joint: exact", exact(1)),
        Row::new("several effects, two joints: exact", exact(2)),
        Row::new(
            "several effects: exact or listed alternatives",
            Rate::count(within),
        ),
    ];
    for (group, what) in [
        (Group::Several, "several effects"),
        (Group::Joints, "many joints"),
    ] {
        let all = of_group(done, group);
        let hidden = all.iter().flat_map(|d| d.hidden());
        let named = all.iter().flat_map(|d| d.named());
        rows.extend([
            Row::new(
                format!("{what}: hidden ones that are named"),
                Rate::count(hidden.map(|(_, is_named)| is_named)),
            ),
            Row::new(
                format!("{what}: named ones that are hidden"),
                Rate::count(named.map(|(_, is_hidden)| is_hidden)),
            ),
        ]);
    }
    rows
}

fn of_group<'d, 'l>(done: &'d [Done<'l>], group: Group) -> Vec<&'d Done<'l>> {
    done.iter().filter(|d| d.cell.group == group).collect()
}

/// Intervals that hold the truth: for named effects and, separately, for structures that the fit was told.
fn rows_of_intervals(done: &[Done<'_>]) -> Vec<Row> {
    let covered = |message: bool, of_effects: bool| {
        let cells = done.iter().filter(|d| d.is_told() == message);
        let all = cells.flat_map(Done::coverage);
        let wanted = all.filter(|c| c.name.contains('.') == of_effects);
        Rate::count(wanted.map(|c| c.covered))
    };
    let fitted = done
        .iter()
        .filter(|d| d.is_told())
        .map(|d| d.message.is_some());
    vec![
        Row::new(
            "95 % intervals of effects that hold the truth",
            covered(false, true),
        ),
        Row::new(
            "95 % intervals of declared parameters that hold the truth",
            covered(false, false),
        ),
        Row::new("message the structure: fitted", Rate::count(fitted)),
        Row::new(
            "message the structure: 95 % intervals of effects that hold the truth",
            covered(true, true),
        ),
        Row::new(
            "message the structure: 95 % intervals of declared parameters that hold the truth",
            covered(true, false),
        ),
    ]
}

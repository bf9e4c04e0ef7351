//! The report as a document: composed once in the order of a reader's questions, and shown as a page or as Markdown.
//!
//! Texts have two marks: `code` between backticks, and **what matters** between double asterisks.

mod better;
mod bodies;
mod calibration;
mod joints;
mod left;
mod logs;
mod made;
mod missing;
mod next;
mod overview;
mod tried;
mod trust;

use maud::Markup;

use super::json::PLOTS;
use super::overview::{is_large, sentence};
use super::page;
use super::schema::{ParameterEntry, Report};
use super::wording::{amount, capitalised};
use residyn_core::data::together;

pub(super) use better::{
    all_torques, fitted_tests, force_unit, judges_by_torques, position_unit, removed,
};
pub(super) use calibration::alarms;
pub(super) use left::{proposal_line, structure};
pub(super) use made::of_call;

pub(super) struct Document {
    /// What was examined, in a few words.
    pub about: String,
    /// The answer in a sentence, without a full stop.
    pub headline: String,
    pub head: Vec<Block>,
    pub sections: Vec<Section>,
}

/// One section: its name in the list of contents, its question, and the answer.
pub(super) struct Section {
    pub id: &'static str,
    pub question: &'static str,
    pub answer: Vec<Block>,
}

#[derive(Clone)]
pub(super) enum Block {
    Heading(String),
    Paragraph(String),
    Small(String),
    /// A warning that concerns all of the document.
    Serious(String),
    List(Vec<String>),
    Steps(Vec<String>),
    Table(Table),
    Code(String),
    /// In LaTeX, and as it is written in a model file if it can be.
    Formula {
        latex: String,
        plain: Option<String>,
    },
    /// Set apart by a frame or a colour of this name.
    Boxed(&'static str, Vec<Block>),
    Folded {
        about: String,
        is_open: bool,
        blocks: Vec<Block>,
    },
    /// A part that others point to by its identifier.
    Part {
        id: String,
        about: String,
        blocks: Vec<Block>,
    },
    /// Ready for a page; a text shows files of the report's folder instead.
    Drawn {
        page: Markup,
        files: &'static [&'static str],
    },
}

#[derive(Clone)]
pub(super) struct Table {
    pub heads: Vec<String>,
    pub rows: Vec<Vec<Cell>>,
    /// Number of columns that name a row.
    pub labels: usize,
}

#[derive(Clone, Default)]
pub(super) struct Cell {
    pub text: String,
    /// Its look on a page.
    pub class: Option<&'static str>,
    /// What a page says when one points at it.
    pub hint: Option<String>,
    /// A share that a page shows as a bar.
    pub bar: Option<f64>,
    /// The part of the page with more about it.
    pub part: Option<String>,
}

pub(super) fn document(report: &Report) -> Document {
    let pictures = Block::Drawn {
        page: page::pictures(report),
        files: &PLOTS,
    };
    let section = |id, question, answer| Section {
        id,
        question,
        answer,
    };
    let missing = match is_large(report.joints) {
        true => overview::answer(report),
        false => missing::answer(report),
    };
    let joints =
        is_large(report.joints).then(|| section("joints", "Joint by joint", joints::parts(report)));
    let first = [section("missing", "What is missing?", missing)];
    let rest = [
        section("better", "How much better is it?", better::answer(report)),
        section("trust", "Can I trust it?", trust::answer(report)),
        section("show", "Show me", vec![pictures]),
        section("next", "What next?", vec![next::steps(report)]),
        made::section(report),
    ];
    Document {
        about: report.system.clone(),
        headline: report.headline.clone(),
        head: head(report),
        sections: first.into_iter().chain(joints).chain(rest).collect(),
    }
}

/// Findings that make results wrong unless they are fixed, then why the answer is as it is.
fn head(report: &Report) -> Vec<Block> {
    let said = report.serious();
    let said = together(said.map(|(log, finding)| (log.to_owned(), finding.to_string())));
    let serious = said.into_iter().map(|one| {
        let about = one.about(report.audit.len());
        Block::Serious(format!("**{about}**, to be fixed first: {}", one.text))
    });
    serious.chain(reason(report)).collect()
}

fn reason(report: &Report) -> Vec<Block> {
    let sentence_of = |text: &str| format!("{}.", capitalised(text));
    if !is_large(report.joints) {
        return vec![paragraph(sentence_of(&report.reason))];
    }
    let (first, more) = reasons(report);
    let more = (!more.is_empty()).then(|| {
        let list = more.iter().map(|text| format!("{text}.")).collect();
        folded("More about the verdict", vec![Block::List(list)])
    });
    let first = [
        sentence_of(first),
        sentence(report, 0..report.error.horizons_s.len()),
    ]
    .map(paragraph);
    first.into_iter().chain(more).collect()
}

/// The reason for the verdict: what it says first, and the rest. A search over many joints has much to add.
pub(super) fn reasons(report: &Report) -> (&str, Vec<&str>) {
    let mut clauses = report.reason.split("; ");
    (clauses.next().unwrap_or_default(), clauses.collect())
}

fn heading(text: &str) -> Block {
    Block::Heading(text.to_owned())
}

fn paragraph(text: impl Into<String>) -> Block {
    Block::Paragraph(text.into())
}

fn paragraphs(texts: impl IntoIterator<Item = String>) -> Vec<Block> {
    texts.into_iter().map(Block::Paragraph).collect()
}

fn folded(about: impl Into<String>, blocks: Vec<Block>) -> Block {
    Block::Folded {
        about: about.into(),
        is_open: false,
        blocks,
    }
}

/// What is too long for the page of a rig of many joints, folded away there.
fn folded_if_large(report: &Report, about: &str, blocks: Vec<Block>) -> Vec<Block> {
    match is_large(report.joints) {
        true => vec![folded(about, blocks)],
        false => blocks,
    }
}

/// A table in which the first columns, so many as there are labels, name the rows.
fn table<H: ToString>(
    labels: usize,
    heads: impl IntoIterator<Item = H>,
    rows: impl IntoIterator<Item = Vec<Cell>>,
) -> Block {
    Block::Table(Table {
        heads: heads.into_iter().map(|head| head.to_string()).collect(),
        rows: rows.into_iter().collect(),
        labels,
    })
}

fn cell(text: impl ToString) -> Cell {
    Cell {
        text: text.to_string(),
        ..Cell::default()
    }
}

fn cells<T: ToString>(texts: impl IntoIterator<Item = T>) -> Vec<Cell> {
    texts.into_iter().map(cell).collect()
}

/// `` `F_c1` = 0.1598 N m (0.1593 to 0.1603) ``
fn value(parameter: &ParameterEntry) -> String {
    format!("`{}` = {}", parameter.name, amount(parameter))
}

pub(super) fn values<'p>(parameters: impl IntoIterator<Item = &'p ParameterEntry>) -> String {
    let values: Vec<String> = parameters.into_iter().map(value).collect();
    values.join(", ")
}

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

/// An error in a formula, and its place. [`Display`](fmt::Display) shows the formula with carets below that place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FormulaError {
    /// The formula as written; of a long one, the part around the place.
    pub formula: String,
    /// Byte range of the offending place within `formula`, or of its beginning.
    pub span: Range<usize>,
    /// The error and, if there is a similar one, the name that was probably meant.
    pub message: String,
}

impl FormulaError {
    pub(super) fn new(formula: &str, span: Range<usize>, message: impl Into<String>) -> Self {
        let shown = around(formula, span.start);
        let within = |at: usize| at.clamp(shown.start, shown.end) - shown.start;
        Self {
            span: within(span.start)..within(span.end),
            formula: formula[shown].to_owned(),
            message: message.into(),
        }
    }
}

impl std::error::Error for FormulaError {}

impl fmt::Display for FormulaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let before = self.formula[..self.span.start].chars().count();
        let under = self.formula[self.span.clone()].chars().count().max(1);
        writeln!(f, "{}", self.message)?;
        writeln!(f, "    {}", self.formula.replace(['\n', '\t'], " "))?;
        write!(f, "    {}{}", " ".repeat(before), "^".repeat(under))
    }
}

/// Bytes of a formula that are shown before and after a place.
const SHOWN: [usize; 2] = [60, 120];

/// The part of a text that is shown for a place in it.
fn around(text: &str, at: usize) -> Range<usize> {
    let [before, behind] = SHOWN;
    let start = text.floor_char_boundary(at.saturating_sub(before));
    start..text.floor_char_boundary(at + behind)
}

/// A text as a message quotes it: a long one is cut off.
pub fn shortened(text: &str) -> Cow<'_, str> {
    let end = text.floor_char_boundary(SHOWN[0]);
    match end == text.len() {
        true => text.into(),
        false => format!("{} ..", &text[..end]).into(),
    }
}

/// Names that are listed before a message says that there are more.
const LISTED: usize = 40;

/// `a, b, c`; only the first if there are many names.
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let (first, rest) = names.split_at(names.len().min(LISTED));
    let first: Vec<_> = first.iter().map(|name| shortened(name)).collect();
    let more = match rest.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    first.join(", ") + &more
}

/// Longer names are not compared with others.
const LONGEST_NAME: usize = 100;

/// The candidate most similar to `name`, if the difference may be a typing error.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_lowercase();
    candidates
        .into_iter()
        .filter(|c| c.len().max(name.len()) <= LONGEST_NAME)
        .map(|c| (distance(&name, &c.to_lowercase()), c))
        .filter(|(distance, c)| *distance <= 1 + c.len().max(name.len()) / 4)
        // Ties are broken by the common prefix.
        .min_by(|a, b| {
            let likeness = |c: &str| strsim::jaro_winkler(&name, &c.to_lowercase());
            a.0.cmp(&b.0).then(likeness(b.1).total_cmp(&likeness(a.1)))
        })
        .map(|(_, c)| c)
}

/// Number of typing errors between two names; a prefix of at least four letters counts as one.
fn distance(name: &str, candidate: &str) -> usize {
    if name.len() >= 4 && candidate.starts_with(name) {
        return 1;
    }
    strsim::damerau_levenshtein(name, candidate)
}

/// `; did you mean ...?` or nothing.
pub fn suggestion<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, candidates).map_or_else(String::new, |c| format!("; did you mean `{c}`?"))
}

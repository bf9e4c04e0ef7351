use std::fmt;
use std::ops::Range;

/// An error in a formula, and its place. [`Display`](fmt::Display) shows the formula with carets below that place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FormulaError {
    /// The whole formula as written.
    pub formula: String,
    /// Byte range of the offending place within `formula`.
    pub span: Range<usize>,
    /// The error and, where one is similar, the name that was probably meant.
    pub message: String,
}

impl FormulaError {
    pub(super) fn new(formula: &str, span: Range<usize>, message: impl Into<String>) -> Self {
        Self {
            formula: formula.to_owned(),
            span,
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

/// The candidate most similar to `name`, if the difference may be a typing error.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_lowercase();
    candidates
        .into_iter()
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

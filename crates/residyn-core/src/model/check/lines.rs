//! Lines of the file that a model was read from, counted from 1.

use crate::model::system::Model;
use crate::toml_text::line;

impl Model {
    /// The line of a place in the text \[bytes\].
    pub(super) fn line(&self, at: usize) -> usize {
        line(&self.text, at)
    }

    /// The line of a declared parameter.
    pub(super) fn line_of_parameter(&self, name: &str) -> Option<usize> {
        let k = self.parameters.iter().position(|own| own.name == name)?;
        Some(self.line(*self.places.parameters.get(k)?))
    }

    /// The line of a measured column's unit.
    pub(super) fn line_of_measured(&self, name: &str) -> Option<usize> {
        let k = self.measured_names().position(|own| own == name)?;
        Some(self.line(*self.places.measured.get(k)?))
    }

    /// The line of an intermediate.
    pub(super) fn line_of_let(&self, name: &str) -> Option<usize> {
        let mut lets = self.equations.lets.iter();
        let (_, formula) = lets.find(|(own, _)| own == name)?;
        Some(self.line(formula.at))
    }

    /// The line of the k-th effect, if the file has it.
    pub(super) fn line_of_effect(&self, k: usize) -> Option<usize> {
        Some(self.line(*self.places.effects.get(k)?))
    }
}

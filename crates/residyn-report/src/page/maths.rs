//! Formulas as browsers typeset them.

use maud::{Markup, PreEscaped, html};
use pulldown_latex::{Parser, RenderConfig, Storage, config::DisplayMode, push_mathml};

/// A LaTeX formula as MathML, or unchanged if it cannot be read.
pub(super) fn formula(latex: &str) -> Markup {
    let storage = Storage::new();
    let config = RenderConfig {
        display_mode: DisplayMode::Block,
        ..RenderConfig::default()
    };
    let mut out = String::new();
    match push_mathml(&mut out, Parser::new(latex, &storage), config) {
        Ok(()) if !out.contains("<merror") => {
            html! { div.formula tabindex="0" { (PreEscaped(out)) } }
        }
        _ => html! { pre tabindex="0" { (latex) } },
    }
}

#[cfg(test)]
mod tests {
    use super::formula;

    #[test]
    fn formulas_are_set_and_others_are_shown_as_they_are() {
        let set =
            formula("\\ddot{q}_{1} = -\\frac{g}{l}\\,\\sin\\left(q_{1}\\right)").into_string();
        assert!(set.contains("<mfrac>") && set.contains("sin"), "{set}");
        let odd = formula("\\frac{<").into_string();
        assert!(odd.starts_with("<pre") && odd.contains("&lt;"), "{odd}");
    }
}

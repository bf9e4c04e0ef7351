use std::fmt::Write;

use residyn_core::data::{Joint, Log};
use residyn_core::model::Model;
use residyn_excite::{Excitation, excitation};

/// How well logs excite a model, in sentences, or why that cannot be said.
pub(super) fn text(model: &Model, logs: &[Log]) -> String {
    match excitation(model, logs) {
        Ok(found) => sentences(&found, model),
        Err(error) => format!("excitation: not looked at: {error}\n"),
    }
}

fn sentences(found: &Excitation, model: &Model) -> String {
    let label = |joint: Joint| model.joint_label(joint);
    let mut out = String::from("excitation:\n");
    for pair in &found.collinear {
        let [a, b] = pair.joints.map(label);
        let _ = writeln!(
            out,
            "  joints {a} and {b} are driven as one (correlation {:.3}): their values trade; give each its own phases",
            pair.correlation
        );
    }
    for one in &found.one_way {
        let _ = writeln!(
            out,
            "  joint {} hardly reverses ({:.1} % of its path): friction looks like a constant torque; move it to and fro",
            label(one.joint),
            100.0 * one.reverse
        );
    }
    for sweep in &found.gravity {
        let _ = writeln!(
            out,
            "  the weight on joint {} varies by {:.2} N m of {:.2}: masses trade with friction and zeros; move it through more \
             angles",
            label(sweep.joint),
            sweep.swept,
            sweep.possible
        );
    }
    let _ = writeln!(
        out,
        "  {} of {} sums of parameters are told",
        found.sums.saturating_sub(found.open.len()),
        found.sums
    );
    for open in &found.open {
        let parts = open
            .iter()
            .map(|(name, weight)| format!("{weight:+.2} {name}"));
        let _ = writeln!(out, "  not told: {}", parts.collect::<Vec<_>>().join(" "));
    }
    let next = &found.next;
    let joints: Vec<String> = next.joints.iter().copied().map(label).collect();
    let pace = if next.is_slow { "slowly, " } else { "" };
    let (name, factor) = &next.narrows;
    if *factor > 1.0 {
        let _ = writeln!(
            out,
            "  one more run would tell most if joint(s) {} moved {pace}with phases of their own: the interval of {name} becomes \
             {factor:.1} times narrower; `residyn excite` designs it",
            joints.join(", ")
        );
    }
    out
}

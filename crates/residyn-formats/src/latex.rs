//! LaTeX: the equations with fitted values and intervals, as a standalone document.

use std::fmt::Write;
use std::path::Path;

use super::verify::Client;
use super::{ExportError, ExportModel, File, Format};
use residyn_core::digits::digits;
use residyn_core::expr::latex_name;
use residyn_core::model::{Angles, MlpWeights, Parameter, ResidualOn};

pub(super) const FORMAT: Format = Format {
    name: "latex",
    about: "the equations with their values and intervals, as a document",
    extension: "tex",
    not_carried,
    files,
    client: Client::None("it is for people to read"),
    tolerance: 0.0,
    robots: None,
};

fn not_carried(model: &ExportModel) -> Vec<String> {
    let network = model.networks().next();
    let weights = network.map(|_| "weights of networks: only their form is described".to_owned());
    weights.into_iter().collect()
}

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    let about = "document with equations, parameters and effects";
    Ok(vec![File::new(path, document(model), about)])
}

fn document(model: &ExportModel) -> String {
    let mut out = format!(
        "% {}\n\\documentclass{{article}}\n\\usepackage[T1]{{fontenc}}\n\\usepackage{{amsmath}}\n\\usepackage[margin=25mm]{{geometry}}\n\
         \\begin{{document}}\n\n\\section*{{{}}}\n\n",
        model.provenance(),
        escaped(model.name())
    );
    if !model.system.about.is_empty() {
        let _ = writeln!(out, "{}.\n", sentence(&model.system.about));
    }
    motion(&mut out, model);
    effects(&mut out, model);
    parameters(&mut out, &model.equations.parameters);
    for (name, network) in model.networks() {
        out += &network_in_words(name, network);
    }
    out += &step(model);
    out + "\\end{document}\n"
}

/// Text with the special characters of LaTeX escaped.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\\' => out += "\\textbackslash{}",
            '^' => out += "\\textasciicircum{}",
            '~' => out += "\\textasciitilde{}",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            _ => out.push(c),
        }
    }
    out
}

/// Escaped, with a capital letter at its beginning.
fn sentence(text: &str) -> String {
    let text = escaped(text.trim_end_matches('.'));
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

fn motion(out: &mut String, model: &ExportModel) {
    if model.prior.is_some() {
        *out += "The derivative of the state is that of a network.\n\n";
        return;
    }
    *out += "\\subsection*{Equations of motion}\n\n\\begin{align*}\n";
    *out += &model.system.latex().join(" \\\\\n");
    *out += "\n\\end{align*}\n\n";
    if !model.effects.is_empty() {
        *out +=
            "Here $\\tau$ is the torque that results from the command and the effects below.\n\n";
    }
}

fn effects(out: &mut String, model: &ExportModel) {
    if model.effects.is_empty() {
        return;
    }
    *out += "\\subsection*{Effects}\n\n\\begin{itemize}\n";
    for (effect, carried) in model.system.effects.iter().zip(&model.effects) {
        let _ = writeln!(
            out,
            "\\item {} on joint {}, {}: ${}$",
            sentence(&carried.name.replace('_', " ")),
            carried.joint,
            effect.enters(|name| format!("${}$", latex_name(name))),
            effect.latex(&carried.parameters, model.system.driven_by())
        );
    }
    *out += "\\end{itemize}\n\n";
}

fn parameters(out: &mut String, parameters: &[Parameter]) {
    if parameters.is_empty() {
        return;
    }
    *out += "\\subsection*{Parameters}\n\n\\begin{tabular}{llll}\n\
             symbol & value & unit & 95\\,\\% interval \\\\\n\\hline\n";
    for parameter in parameters {
        let (value, ends) = digits(parameter);
        let (value, interval) = match ends {
            Some([low, high]) => (value, format!("${low}$ to ${high}$")),
            None if parameter.fixed => (plain(&value), "fixed".to_owned()),
            None => (plain(&value), "not fitted".to_owned()),
        };
        let _ = writeln!(
            out,
            "${}$ & ${value}$ & {} & {interval} \\\\",
            latex_name(&parameter.name),
            unit(&parameter.unit)
        );
    }
    *out += "\\end{tabular}\n\n";
}

/// Without trailing zeros, which would suggest digits that were not determined.
fn plain(value: &str) -> String {
    if value.contains('.') {
        let value = value.trim_end_matches('0');
        return value.trim_end_matches('.').to_owned();
    }
    value.to_owned()
}

/// `1/(kg m^2)` with raised powers and thin spaces.
fn unit(unit: &str) -> String {
    if unit.is_empty() {
        return "1".to_owned();
    }
    let mut out = String::from("$\\mathrm{");
    let mut letters = unit.chars().peekable();
    while let Some(c) = letters.next() {
        match c {
            ' ' => out += "\\,",
            '^' => {
                out += "^{";
                while let Some(digit) = letters.next_if(|c| c.is_ascii_digit() || *c == '-') {
                    out.push(digit);
                }
                out.push('}');
            }
            _ => out += &escaped(&c.to_string()),
        }
    }
    out + "}$"
}

fn network_in_words(what: &str, network: &MlpWeights) -> String {
    let widths: Vec<String> = network.widths().iter().map(ToString::to_string).collect();
    let angles = match network.angles {
        Angles::Raw => "positions",
        Angles::SinCos => "sines and cosines of positions",
    };
    let on = match network.on {
        ResidualOn::Accelerations => "the accelerations",
        ResidualOn::Derivative => "the derivative of the whole state",
    };
    format!(
        "\\subsection*{{Network}}\n\nThe {what} is a network with ReLU between layers of {} neurons. Its inputs are \
         {angles}, velocities and torques, its outputs are added to {on}.\n\n",
        widths.join(", ")
    )
}

fn step(model: &ExportModel) -> String {
    let steps = match model.integrator.substeps() {
        1 => "one step".to_owned(),
        substeps => format!("{substeps} equal steps"),
    };
    let scheme = model.integrator.scheme().title;
    let scheme = scheme.replace("Runge-Kutta", "Runge--Kutta");
    format!(
        "\\subsection*{{Step}}\n\nTorques are held for {} s, over which the motion is integrated by {steps} of the {scheme}.\n\n",
        model.step_s
    )
}

//! One C99 header: derivative, step and both Jacobians, and the inverse dynamics, without allocation, in double or float.

mod client;
mod compiler;
mod equations;
mod names;
mod networks;

pub(super) use compiler::{compile, compiler};
pub(super) use names::Names;

use super::template::filled;
use super::verify::Client;
use super::{ExportError, ExportModel, File, Format};
use residyn_core::data::{Joint, Quantity};
use residyn_core::expr::Notation;
use residyn_core::model::CommandFilter;
use residyn_core::sim::{Scheme, Stage};

pub(super) const FORMAT: Format = Format {
    name: "c",
    about: "one C99 header with its Jacobians, in double or float, without allocation",
    extension: "h",
    not_carried: ExportModel::sensors_not_carried,
    files: |model, path| {
        let about = "derivative, step, Jacobians and inverse dynamics in C";
        Ok(vec![File::new(path, header(model)?, about)])
    },
    client: Client::Own(client::predict),
    tolerance: 1e-9,
    robots: None,
};

/// The text of the header.
pub(super) fn header(model: &ExportModel) -> Result<String, ExportError> {
    // Refuses networks that do not fit the model.
    model.reference()?;
    let names = Names::new(model);
    let code = [
        include_str!("types.h").to_owned(),
        sizes(model),
        parameters(model, &names),
        include_str!("functions.h").to_owned(),
        memory(model, &names),
        networks::tables(model, &names),
        equations::derivative(model, &names),
        equations::inverse(model, &names),
        stepped(include_str!("flow.h"), model),
        stepped(&advance(model.integrator.scheme(), &names), model),
        include_str!("step.h").to_owned(),
    ];
    let (head, upper) = (head(model, &names), &names.upper);
    let code = names.fill(&code.concat());
    Ok(format!(
        "{head}#ifndef {upper}_H\n#define {upper}_H\n\n{code}\n#undef {upper}_\n#endif\n"
    ))
}

/// A template in which the rates are those at a moment or, if effects have states, the means over a step.
fn stepped(template: &str, model: &ExportModel) -> String {
    let places = [
        ("RATES", "derivative", "mean_rates"),
        ("STATE_AND_STEP", "", "state, h, "),
        ("STATE_OF_STATE_AND_STEP", "", "state, of_state, h, "),
        ("STEP", "", "begun, length, "),
        (
            "STEP_TAKEN",
            "",
            "\n        const model_real begun[MODEL_STATES],\n        \
             model_real of_begun[MODEL_STATES][MODEL_COLUMNS], model_real length,",
        ),
        ("BY_BEGUN", "", "by_begun, "),
        (
            "BY_BEGUN_TAKEN",
            "",
            "\n    model_real by_begun[MODEL_STATES][MODEL_INTERNAL];",
        ),
        ("OF_BEGUN", "", include_str!("of_begun.h")),
        ("OTHERS", "", include_str!("others.h")),
        ("OF_OTHERS", "", include_str!("of_others.h")),
    ];
    let has_states = model.internal().next().is_some();
    let chosen =
        places.map(|(name, without, with)| (name, if has_states { with } else { without }));
    let values: Vec<(&str, &dyn std::fmt::Display)> = (chosen.iter())
        .map(|(name, text)| (*name, text as &dyn std::fmt::Display))
        .collect();
    filled(template, &values)
}

/// The step of a scheme, and its derivatives.
fn advance(scheme: &Scheme, names: &Names) -> String {
    if scheme.semi_implicit {
        return include_str!("semi_implicit.h").to_owned();
    }
    let list = |of: fn(&Stage) -> f64| {
        let numbers = scheme.stages.iter().map(|stage| names.number(of(stage)));
        numbers.collect::<Vec<_>>().join(", ")
    };
    filled(
        include_str!("runge_kutta.h"),
        &[
            ("TITLE", &scheme.title),
            ("STAGES", &scheme.stages.len()),
            ("WEIGHTS", &list(|stage| stage.weight)),
            ("REACHES", &list(|stage| stage.reach)),
        ],
    )
}

/// The comment at the head of the file.
fn head(model: &ExportModel, names: &Names) -> String {
    let mut lines = vec![
        format!("{}: {}", model.name(), model.system.about),
        format!(
            "Written by residyn {}, integrator {}, steps of {} s.",
            env!("CARGO_PKG_VERSION"),
            model.integrator,
            model.step_s
        ),
    ];
    lines.extend(
        (FORMAT.not_carried)(model)
            .iter()
            .map(|limit| format!("Not carried: {limit}.")),
    );
    let driving = match model.equations.driven_by() {
        Quantity::Command => "the commands of the drives",
        _ => "in N m (N)",
    };
    let rest = match model.internal().next() {
        Some(_) => "\n    model_rest(&parameters, state);",
        None => "",
    };
    let usage = filled(
        include_str!("usage.txt"),
        &[
            ("STEP", &model.step_s),
            ("DRIVING", &driving),
            ("REST", &rest),
        ],
    );
    let usage = names.fill(&usage);
    lines.extend(["".to_owned(), usage.trim_end().to_owned(), "".to_owned()]);
    let origin = serde_json::to_string_pretty(&model.provenance()).expect("JSON is text");
    lines.push(
        origin
            .replace("*/", "*\\/")
            .replace("/*", "\\/*")
            .replace("??/", "??\\/"),
    );
    let lines = lines.join("\n");
    let lines: String = lines
        .lines()
        .map(|line| format!(" * {}", comment(line)).trim_end().to_owned() + "\n")
        .collect();
    format!("/*\n{lines} */\n")
}

/// Text that cannot end a comment.
fn comment(text: &str) -> String {
    let text = text
        .replace("*/", "* /")
        .replace("/*", "/ *")
        .replace("??/", "?? /");
    let text = text.replace(['\n', '\r'], " ");
    text.trim_end_matches('\\').to_owned()
}

fn sizes(model: &ExportModel) -> String {
    let (n, states) = (model.joints(), model.states());
    let parts = model.integrator.substeps();
    let internal: Vec<String> = model.internal_labels().collect();
    let (of_effects, defined) = match internal.len() {
        0 => (String::new(), String::new()),
        count => (
            format!(", then {}", comment(&internal.join(", "))),
            format!("#define MODEL_INTERNAL {count} /* states of effects */\n"),
        ),
    };
    format!(
        "#define MODEL_JOINTS {n}\n\
         #define MODEL_STATES {states} /* positions, then velocities{of_effects} */\n{defined}\
         #define MODEL_COLUMNS {} /* states and torques, which derivatives are by */\n\
         #define MODEL_PARTS {parts} /* of a step */\n",
        states + n
    )
}

fn parameters(model: &ExportModel, names: &Names) -> String {
    let parameters = &model.equations.parameters;
    let notes = model.parameter_notes();
    let fields: String = (parameters.iter().zip(notes))
        .map(|(parameter, note)| {
            let field = names.field(&parameter.name);
            let known = [parameter.unit.clone(), note]
                .into_iter()
                .filter(|text| !text.is_empty());
            let known = known.collect::<Vec<_>>().join("; ");
            format!("    model_real {field}; /* {} */\n", comment(&known))
        })
        .collect();
    let values: Vec<String> = parameters.iter().map(|p| names.number(p.value)).collect();
    let (fields, values) = match parameters.is_empty() {
        true => (
            "    char unused; /* the model is a network alone */\n".to_owned(),
            "0".to_owned(),
        ),
        false => (fields, values.join(", ")),
    };
    format!(
        "\ntypedef struct {{\n{fields}}} model_parameters;\n\n\
         /* The values that were exported. */\n\
         static inline model_parameters model_defaults(void)\n{{\n    \
         const model_parameters defaults = {{{values}}};\n    return defaults;\n}}\n"
    )
}

/// Capacity for past torques, relative to the delays at the exported step: parameters may change, and steps may be
/// shorter.
const HEADROOM: f64 = 2.0;

fn memory(model: &ExportModel, names: &Names) -> String {
    if model.equations.filters.is_empty() {
        return include_str!("memoryless.h").to_owned();
    }
    let of_joints = |kind: CommandFilter| {
        let of_joint = |joint: Joint| names.filter(model, joint, kind);
        let each: Vec<String> = Joint::all(model.joints()).map(of_joint).collect();
        each.join(", ")
    };
    let delays =
        Joint::all(model.joints()).filter_map(|joint| model.filter(joint, CommandFilter::Delay));
    let longest = delays.fold(0.0, f64::max);
    let past = (HEADROOM * longest / model.step_s).ceil() + 2.0;
    filled(
        include_str!("memory.h"),
        &[
            ("PAST", &past),
            ("DELAYS", &of_joints(CommandFilter::Delay)),
            ("LAGS", &of_joints(CommandFilter::Lag)),
        ],
    )
}

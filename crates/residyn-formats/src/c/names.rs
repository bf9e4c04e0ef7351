use std::collections::HashMap;

use crate::ExportModel;
use residyn_core::data::Joint;
use residyn_core::expr::{Notation, Part};
use residyn_core::model::CommandFilter;

/// Names of one model's parts in C, and the notation of its formulas. In templates and generated code all names begin
/// with `model_` or `MODEL_` until [`Names::fill`] replaces these prefixes.
pub(crate) struct Names {
    /// Prefix of functions and types; in capitals, the prefix of macros.
    pub lower: String,
    pub upper: String,
    /// C expressions for the inputs of the equations.
    inputs: HashMap<String, String>,
}

/// Reserved names: keywords of C and C++, names that the functions use, and macros.
const TAKEN: &str = "\
    HUGE_VAL INFINITY M_E M_PI NAN NULL acceleration alignas alignof and and_eq asm auto bitand bitor bool break \
    begun by_begun by_state by_torque case catch char class compl concept const const_cast consteval constexpr \
    constinit continue cos decltype default delete do double dynamic_cast else enum exp explicit \
    export extern fabs false float for friend goto if inline int length linux log long mutable namespace \
    needed new noexcept not not_eq nullptr operator or or_eq parameters pow private protected public rates \
    register reinterpret_cast requires restrict return short signed sin sizeof sqrt state static \
    static_assert static_cast struct switch tan tanh template this thread_local throw time torque \
    true try typedef typeid typename union unix unsigned using virtual void volatile wchar_t while \
    xor xor_eq atan2";

impl Names {
    pub fn new(model: &ExportModel) -> Self {
        let lower = prefix(model.name());
        let n = model.joints();
        let of_joints = |stem: &'static str, member: &'static str, first: usize| {
            Joint::all(n).map(move |joint| {
                let place = first + joint.index();
                (joint.name(stem), format!("{member}[{place}]"))
            })
        };
        let moving = of_joints("q", "state", 0)
            .chain(of_joints("qd", "state", n))
            .chain(of_joints("qdd", "acceleration", 0))
            .chain(of_joints(model.equations.driven_by().key(), "torque", 0))
            .chain([("t".to_owned(), "time".to_owned())]);
        let internal = model.internal().enumerate().flat_map(|(k, (_, state))| {
            let before = (
                format!("{}_before", state.name),
                format!("begun[{}]", 2 * n + k),
            );
            [
                (state.name.clone(), format!("state[{}]", 2 * n + k)),
                before,
            ]
        });
        let length = ("step_s".to_owned(), "length".to_owned());
        let moving = moving.chain(internal).chain([length]);
        let held = model.equations.parameters.iter().map(|parameter| {
            let field = variable(&parameter.name);
            (parameter.name.clone(), format!("parameters->{field}"))
        });
        Self {
            inputs: moving.chain(held).collect(),
            upper: lower.to_uppercase(),
            lower,
        }
    }

    /// A template with the names of this model.
    pub fn fill(&self, template: &str) -> String {
        let filled = template.replace("MODEL_", &format!("{}_", self.upper));
        filled.replace("model_", &format!("{}_", self.lower))
    }

    /// The member of the parameter struct.
    pub fn field(&self, parameter: &str) -> String {
        variable(parameter)
    }

    /// The time constant of a joint's filter, or zero.
    pub fn filter(&self, model: &ExportModel, joint: Joint, kind: CommandFilter) -> String {
        let parameter = model.filter_parameter(joint, kind);
        parameter.map_or_else(|| "0".to_owned(), |p| self.name(&p.name))
    }
}

impl Notation for Names {
    fn number(&self, value: f64) -> String {
        let sign = if value.is_sign_negative() { "-" } else { "" };
        format!("{sign}MODEL_({:?})", value.abs())
    }

    fn name(&self, name: &str) -> String {
        match self.inputs.get(name) {
            Some(input) => input.clone(),
            // An element of an output array.
            None if name.ends_with(']') => name.to_owned(),
            None => variable(name),
        }
    }

    fn choice(&self, condition: &Part, a: &str, b: &str) -> String {
        format!("({} ? {a} : {b})", condition.condition())
    }

    fn call(&self, function: &str, arguments: &[String]) -> String {
        let arguments = arguments.join(", ");
        match function {
            "sign" | "min" | "max" => format!("model_{function}({arguments})"),
            "abs" => format!("MODEL_(fabs)({arguments})"),
            _ => format!("MODEL_({function})({arguments})"),
        }
    }
}

/// The prefix of a system's names.
fn prefix(system: &str) -> String {
    let ascii = system
        .to_lowercase()
        .replace(|c: char| !c.is_ascii_alphanumeric(), "_");
    match ascii.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => ascii,
        false => format!("model_{ascii}"),
    }
}

/// A model's name in C. Distinct names stay distinct: a character that C lacks becomes its code point, and a reserved
/// name gets an underscore.
fn variable(name: &str) -> String {
    let letter = |c: char| match c {
        'a'..='z' | 'A'..='Z' | '0'..='9' | '_' => c.to_string(),
        c => format!("_u{:x}_", u32::from(c)),
    };
    let ascii: String = name.chars().map(letter).collect();
    let stem = ascii.trim_end_matches('_');
    match TAKEN.split(' ').any(|taken| taken == stem) {
        true => ascii + "_",
        false => ascii,
    }
}

//! Probes of the residual over the further measured columns of the logs, whether the model mentions them or not: a
//! temperature, a supply. Each is asked as the library's probes ask the time.

use std::path::Path;

use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::statistics::ends;
use crate::data::{Joint, Log};
use crate::expr::parse;
use crate::model::{Effect, FittedEffect};

/// A column whose values differ by less than this share of their magnitude shows nothing.
const CONSTANT: f64 = 1e-9;

/// The model with every column that all logs have, and what asks of each column on each joint.
pub(super) fn measured_probes(
    problem: &Problem<'_>,
    fitted: &Fitted,
) -> Option<(Fitted, Vec<FittedEffect>)> {
    let columns = columns(problem.logs);
    let effects: Vec<Effect> = columns.iter().flat_map(probes).collect();
    let is_driven =
        |effect: &Effect, joint: Joint| !effect.needs_torque() || problem.top_torque[joint] > 0.0;
    let on_joints = effects.iter().flat_map(|effect| {
        let joints = Joint::all(problem.declared.joints);
        let driven = joints.filter(|joint| is_driven(effect, *joint));
        driven.map(|joint| FittedEffect::absent(effect, joint))
    });
    let probes: Vec<FittedEffect> = on_joints.collect();
    let reading = || Fitted {
        model: (fitted.model).reading(columns.iter().map(|column| column.name.as_str())),
        fit: fitted.fit.clone(),
    };
    (!probes.is_empty()).then(|| (reading(), probes))
}

/// A column, and the range of its values in all logs.
struct Column {
    name: String,
    ends: [f64; 2],
}

/// The columns that all logs have, that vary, and whose names formulas may use.
fn columns(logs: &[Log]) -> Vec<Column> {
    let Some(first) = logs.first() else {
        return Vec::new();
    };
    let column = |name: &String| {
        let of_log = |log: &Log| log.measured.iter().find(|own| own.name == *name).cloned();
        let of_logs: Option<Vec<_>> = logs.iter().map(of_log).collect();
        let values: Vec<f64> = of_logs?.into_iter().flat_map(|own| own.values).collect();
        let [low, high] = ends(&values);
        let varies = high - low > CONSTANT * (1.0 + low.abs().max(high.abs()));
        let is_usable = parse(name).is_ok_and(|formula| formula.is_name(name));
        (varies && is_usable).then(|| Column {
            name: name.clone(),
            ends: [low, high],
        })
    };
    let names = first.measured.iter().map(|measured| &measured.name);
    names.filter_map(column).collect()
}

/// As the library's probes of the time, over the column from -1 to 1: what its mean value does, the model explains.
fn probes(Column { name, ends }: &Column) -> [Effect; 2] {
    let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
    let x = format!("(({name} - ({middle:?}))/({half:?}))");
    [
        probe(
            name,
            &format!("a_1*{x} + a_2*{x}*qd + a_3*{x}*sign(qd)"),
            "a_1 = { unit = \"N m\", typical = 0.1 }\na_2 = { unit = \"N m s/rad\", typical = 0.02 }\na_3 = { unit = \
             \"N m\", typical = 0.1 }",
        ),
        probe(
            &format!("{name}*tau"),
            &format!("a_1*{x}*tau"),
            "a_1 = { unit = \"1\", typical = 0.1 }",
        ),
    ]
}

fn probe(name: &str, force: &str, parameters: &str) -> Effect {
    let text = format!(
        "[effect]\nname = \"{name}\"\nabout = \"a function of a measured column\"\nforce = \"{force}\"\n[parameters]\n\
         {parameters}\n"
    );
    Effect::from_text(Path::new("probe.toml"), &text).expect("probes are formulas of an effect")
}

#[cfg(test)]
mod tests {
    use super::{Column, columns, probes};
    use crate::data::{Log, Measured};

    fn log(measured: &[(&str, [f64; 2])]) -> Log {
        let column = |(name, values): &(&str, [f64; 2])| Measured {
            name: (*name).to_owned(),
            values: values.to_vec(),
        };
        Log {
            measured: measured.iter().map(column).collect(),
            ..Log::empty(1)
        }
    }

    #[test]
    fn columns_of_all_logs_that_vary_are_asked() {
        let logs = [
            log(&[
                ("u_volts", [12.0, 12.0]),
                ("u_temp", [300.0, 301.0]),
                ("u_x", [0.0, 1.0]),
            ]),
            log(&[("u_temp", [290.0, 295.0]), ("u_volts", [12.0, 12.0])]),
        ];
        let found = columns(&logs);
        let names: Vec<&str> = found.iter().map(|column| column.name.as_str()).collect();
        assert_eq!((names, found[0].ends), (vec!["u_temp"], [290.0, 301.0]));
    }

    #[test]
    fn probes_are_named_by_their_variables() {
        let ends = [-1e-9, 3e7];
        let name = "u_temp".to_owned();
        let asked = probes(&Column { name, ends }).map(|effect| effect.name);
        assert_eq!(asked, ["u_temp", "u_temp*tau"]);
    }
}

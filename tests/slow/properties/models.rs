//! Model files: read and written, as they are and with the values of a fit.

use std::fmt::Write as _;
use std::path::Path;

use proptest::prelude::*;
use residyn_core::data::{Joint, Quantity};
use residyn_core::model::tree::model_text;
use residyn_core::model::{Effect, FittedEffect, Library, Model, PerLogValue, Status};

use super::mechanisms::tree;
use super::{cases, same_number};

/// Finite numbers of all sizes.
fn number() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    prop_oneof![
        3 => -10.0..10.0_f64,
        1 => NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE,
    ]
}

/// Texts as people write them, and as nobody does.
pub fn words() -> impl Strategy<Value = String> {
    let usual = prop::collection::vec(prop::char::range('a', 'z'), 1..12);
    let any = prop::collection::vec(prop::char::any(), 0..12);
    let odd = [
        "",
        "a \"b\" c",
        "back\\slash",
        "# none",
        "'",
        "é ü 漢",
        "[[effect]]",
        "a = 1",
        "two\nlines\t",
    ];
    prop_oneof![
        usual.prop_map(String::from_iter),
        any.prop_map(String::from_iter),
        prop::sample::select(odd.to_vec()).prop_map(str::to_owned),
    ]
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// `{ value = 1.0, .. }`
fn parameter() -> impl Strategy<Value = String> {
    let bounds = prop::option::of((0.0..1e3_f64, 1e-3..1e3_f64));
    (
        number(),
        words(),
        words(),
        any::<bool>(),
        bounds,
        prop::option::of((number(), number())),
    )
        .prop_map(|(value, unit, about, fixed, bounds, ci95)| {
            let mut text = format!(
                "{{ value = {value:?}, unit = {}, about = {}",
                quoted(&unit),
                quoted(&about)
            );
            if fixed {
                text += ", fixed = true";
            }
            if value > 0.0 {
                text += ", positive = true";
            }
            if let Some((below, above)) = bounds {
                let [low, high] = [
                    value - below * value.abs().min(1e300),
                    value + above * (1.0 + value.abs().min(1e300)),
                ];
                let _ = write!(text, ", bounds = [{low:?}, {high:?}]");
            }
            if let Some((low, high)) = ci95 {
                let _ = write!(text, ", ci95 = [{low:?}, {high:?}]");
            }
            text + " }"
        })
}

/// An entry of `[columns]`.
fn column(quantity: Quantity, standard: String) -> BoxedStrategy<String> {
    let units: Vec<&str> = quantity.units().iter().map(|(unit, _)| *unit).collect();
    let unit = prop::option::of(prop::sample::select(units));
    // Only what drives a joint may be missing.
    let may_lack = matches!(quantity, Quantity::Torque | Quantity::Command);
    let named = words().prop_filter("a name", move |name| may_lack || !name.is_empty());
    let name = prop_oneof![Just(standard), named].boxed();
    let late = prop::option::of(-0.01..0.01_f64);
    let table = (name.clone(), unit, 1e-3..1e3_f64, any::<bool>(), late).prop_map(
        move |(name, unit, factor, flag, late)| {
            let mut text = format!("{{ column = {}, factor = {factor:?}", quoted(&name));
            if let Some(unit) = unit {
                let _ = write!(text, ", unit = {}", quoted(unit));
            }
            if quantity == Quantity::Angle && flag {
                text += ", wrapped = true";
            }
            if let Some(late) = late.filter(|_| quantity != Quantity::Time) {
                let _ = write!(text, ", late = {late:?}");
            }
            text + " }"
        },
    );
    prop_oneof![name.prop_map(|name| quoted(&name)), table].boxed()
}

/// `[columns]` of a rig, with some of its entries.
fn columns(joints: usize, driven_by: Quantity) -> BoxedStrategy<String> {
    let list =
        move |quantity: Quantity| {
            let each: Vec<_> = (1..=joints)
                .map(|joint| column(quantity, format!("{}{joint}", quantity.key())))
                .collect();
            prop::option::of(each.prop_map(move |entries| {
                format!("{} = [{}]\n", quantity.key(), entries.join(", "))
            }))
        };
    let time = column(Quantity::Time, "time".into()).prop_map(|time| format!("time = {time}\n"));
    let topic = words().prop_map(|topic| format!("topic = {}\n", quoted(&topic)));
    (
        prop::option::of(time),
        list(Quantity::Angle),
        list(Quantity::Velocity),
        list(driven_by),
        prop::option::of(topic),
    )
        .prop_map(|(time, q, qd, tau, topic)| {
            let lines: String = [time, q, qd, tau, topic].into_iter().flatten().collect();
            format!("[columns]\n{lines}\n")
        })
        .boxed()
}

/// A term of an equation of joint `j`, of `joints`.
fn term(joints: usize, driven: &'static str) -> BoxedStrategy<String> {
    let joint = 1..=joints;
    (0..8_usize, joint.clone(), joint)
        .prop_map(move |(kind, j, k)| match kind {
            0 => format!("p_a*sin(q{j})"),
            1 => format!("-p_b * qd{j}*abs(qd{k})"),
            2 => format!("p_c * {driven}{j}"),
            3 => format!("x_1 * cos(q{j} - q{k})^2"),
            4 => format!("where(q{j} < q{k}, p_a, 0.5) * qd{k}"),
            5 => format!("p_b*tanh(t) * exp(-q{j}^2)"),
            6 => format!("max(p_c, q{j}/(2 + cos(q{k})))"),
            _ => format!("1.5e-3*{driven}{k} - (p_a - p_b)*x_1"),
        })
        .boxed()
}

fn equation(joints: usize, driven: &'static str) -> impl Strategy<Value = String> {
    prop::collection::vec(term(joints, driven), 1..5).prop_map(|terms| terms.join(" + "))
}

/// `[dynamics]` in one of its two forms.
fn dynamics(joints: usize) -> BoxedStrategy<String> {
    let accelerations = prop::collection::vec(equation(joints, "tau"), joints).prop_map(|all| {
        let line = |(joint, formula): (usize, String)| format!("qdd{joint} = \"{formula}\"\n");
        (1..).zip(all).map(line).collect::<String>()
    });
    let entries = prop::collection::vec(0..3_usize, joints * joints);
    let balance = (
        entries,
        prop::collection::vec(equation(joints, "q"), joints),
    )
        .prop_map(move |(mass, bias)| {
            let entry = |i: usize, j: usize| match (i == j, mass[i * joints + j]) {
                (true, kind) => format!("\"{} + x_1^2\"", kind + 2),
                (false, 0) => "\"0\"".to_owned(),
                (false, kind) => format!("\"0.{kind}*cos(q{} - q{})\"", i + 1, j + 1),
            };
            let row = |i: usize| {
                format!(
                    "[{}]",
                    (0..joints)
                        .map(|j| entry(i, j))
                        .collect::<Vec<_>>()
                        .join(", ")
                )
            };
            let rows: Vec<String> = (0..joints).map(row).collect();
            let bias: Vec<String> = bias
                .iter()
                .map(|formula| format!("\"{formula}\""))
                .collect();
            format!(
                "mass = [{}]\nbias = [{}]\n",
                rows.join(", "),
                bias.join(", ")
            )
        });
    prop_oneof![accelerations, balance]
        .prop_map(|motion| {
            format!("[dynamics.let]\nx_1 = \"p_a + p_b*sin(q1)\"\n\n[dynamics]\n{motion}\n")
        })
        .boxed()
}

/// `[system]`
fn system(joints: usize) -> BoxedStrategy<String> {
    let slides = prop::collection::vec(any::<bool>(), joints);
    let widths = prop::option::of(prop::collection::vec(1e-6..1.0_f64, joints));
    (words(), words(), any::<bool>(), slides, widths)
        .prop_map(move |(name, about, named, slides, widths)| {
            let mut text = format!(
                "[system]\nname = {}\njoints = {joints}\nabout = {}\n",
                quoted(&name),
                quoted(&about)
            );
            if named {
                let names: Vec<String> = (1..=joints)
                    .map(|j| quoted(&format!("{about} {j}")))
                    .collect();
                let _ = writeln!(text, "joint_names = [{}]", names.join(", "));
            }
            let sliding: Vec<usize> = (1..)
                .zip(&slides)
                .filter(|(_, slides)| **slides)
                .map(|(j, _)| j)
                .collect();
            let _ = writeln!(text, "prismatic = {sliding:?}");
            if let Some(widths) = widths {
                let _ = writeln!(text, "smoothing_velocity = {widths:?}");
            }
            text + "\n"
        })
        .boxed()
}

/// A model file without effects, its tables in any order.
fn declaration() -> BoxedStrategy<String> {
    (1..=3_usize, any::<bool>())
        .prop_flat_map(|(joints, is_driven)| {
            let driven_by = if is_driven {
                Quantity::Command
            } else {
                Quantity::Torque
            };
            let parameters = prop::collection::vec(parameter(), 3).prop_map(|all| {
                let line = |(name, entry): (&str, String)| {
                    format!("{name} = {entry} # as from a drawing\n")
                };
                let lines: String = ["p_a", "p_b", "p_c"]
                    .into_iter()
                    .zip(all)
                    .map(line)
                    .collect();
                format!("[parameters]\n{lines}\n")
            });
            let drive =
                prop::collection::vec(equation(joints, "cmd"), joints).prop_map(move |all| {
                    let line = |(joint, formula): (usize, String)| {
                        format!("tau{joint} = \"{}\"\n", formula.replace("x_1", "p_c"))
                    };
                    let lines: String = (1..).zip(all).map(line).collect();
                    if is_driven {
                        format!("[drive]\n{lines}\n")
                    } else {
                        String::new()
                    }
                });
            let hidden = prop::collection::vec(1..40_usize, 1..4)
                .prop_map(|hidden| format!("[residual]\nhidden = {hidden:?}\n\n"));
            let tables = (
                system(joints),
                columns(joints, driven_by),
                parameters,
                drive,
                dynamics(joints),
                hidden,
            );
            tables.prop_map(|(a, b, c, d, e, f)| vec![a, b, c, d, e, f])
        })
        .prop_shuffle()
        .prop_map(|tables| tables.concat())
        .boxed()
}

/// Random numbers to choose and size a model's parts other than its equations.
#[derive(Debug, Clone)]
struct Draws(Vec<f64>);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0.rotate_left(1);
        self.0[0]
    }

    fn index(&mut self, below: usize) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss
        )]
        let index = (self.next() * below as f64) as usize;
        index.min(below - 1)
    }
}

fn draws() -> impl Strategy<Value = Draws> {
    prop::collection::vec(0.0..1.0_f64, 40).prop_map(Draws)
}

/// An effect as a fit might find it: values within their bounds, intervals, per-log values.
fn effect(model: &Model, effects: &[Effect], draws: &mut Draws) -> Option<FittedEffect> {
    let kind = &effects[draws.index(effects.len())];
    let joint = Joint::at(draws.index(model.joints));
    let mut found = FittedEffect::absent(kind, joint);
    for (k, parameter) in kind.parameters.iter().enumerate() {
        let mut value = || {
            let value = parameter.typical * (0.5 + draws.next());
            let value = if parameter.whole {
                value.round()
            } else {
                value
            };
            value.clamp(parameter.bounds[0], parameter.bounds[1])
        };
        found.values[k].0 = value();
        let logs = [
            "run 1.csv",
            "a/same.csv",
            "b/same.csv",
            "odd \"name\" = 'é'.csv",
        ];
        if parameter.per_log {
            found.own.extend(logs.map(|log| PerLogValue {
                log: log.to_owned(),
                parameter: k,
                value: value(),
                ci95: None,
            }));
        }
        found.values[k].1 = match draws.index(3) {
            0 => None,
            1 => Some([
                found.values[k].0 - draws.next(),
                found.values[k].0 + draws.next(),
            ]),
            _ => Some([f64::NEG_INFINITY, f64::INFINITY]),
        };
    }
    found.fixed = draws.index(4) == 0;
    found.status = [None, Some(Status::Established), Some(Status::Supported)][draws.index(3)];
    let fits = model.check_effect(&found, &model.effects).is_ok();
    // Its parameter values may not be meant for this model.
    fits.then_some(found)
}

/// The model with other values and with effects, as a fit leaves it.
fn fitted(model: &Model, draws: &mut Draws) -> Model {
    let library = Library::built_in();
    let mut model = model.clone();
    for _ in 0..draws.index(5) {
        if let Some(found) = effect(&model, library.effects(), draws) {
            model.effects.push(found);
        }
    }
    for parameter in &mut model.parameters {
        let moved = parameter.value * (0.9 + 0.1 * draws.next());
        parameter.value = moved.clamp(parameter.bounds[0], parameter.bounds[1]);
        parameter.ci95 =
            (draws.index(2) == 0).then(|| [parameter.value - 0.1, parameter.value + draws.next()]);
    }
    let widths = (0..model.joints)
        .map(|_| 1e-6 + 0.1 * draws.next())
        .collect();
    match draws.index(2) {
        0 => model.with_smoothing_velocities(widths),
        _ => model,
    }
}

fn read(text: &str) -> Model {
    let library = Library::built_in();
    Model::from_text(Path::new("model.toml"), text, library.effects())
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn same(a: &Model, b: &Model, text: &str) -> Result<(), TestCaseError> {
    prop_assert_eq!(
        (
            &a.name,
            &a.about,
            a.joints,
            &a.joint_names,
            &a.prismatic,
            &a.hidden
        ),
        (
            &b.name,
            &b.about,
            b.joints,
            &b.joint_names,
            &b.prismatic,
            &b.hidden
        )
    );
    prop_assert_eq!(&a.columns, &b.columns, "{}", text);
    prop_assert_eq!(&a.smoothing_velocity, &b.smoothing_velocity, "{}", text);
    prop_assert_eq!(a.parameters.len(), b.parameters.len());
    for (a, b) in a.parameters.iter().zip(&b.parameters) {
        prop_assert!(same_number(a.value, b.value), "{}", text);
        // The step scale follows the value in the file.
        let (mut a, mut b) = (a.clone(), b.clone());
        (a.scale, b.scale) = (1.0, 1.0);
        prop_assert_eq!(a, b, "{}", text);
    }
    prop_assert_eq!(a.effects.len(), b.effects.len(), "{}", text);
    for (a, b) in a.effects.iter().zip(&b.effects) {
        prop_assert_eq!(
            (&a.effect, a.joint, a.fixed, a.status),
            (&b.effect, b.joint, b.fixed, b.status)
        );
        prop_assert_eq!(&a.values, &b.values, "{}", text);
        let of = |own: &PerLogValue| (own.parameter, own.value.to_bits(), own.ci95);
        prop_assert_eq!(
            a.own.iter().map(of).collect::<Vec<_>>(),
            b.own.iter().map(of).collect::<Vec<_>>(),
            "{}",
            text
        );
        let named = |own: &PerLogValue| own.log_name();
        prop_assert_eq!(
            a.own.iter().map(named).collect::<Vec<_>>(),
            b.own.iter().map(named).collect::<Vec<_>>()
        );
    }
    prop_assert_eq!(a.dynamics().program, b.dynamics().program, "{}", text);
    Ok(())
}

/// Written, read and written again, a model is the same.
fn survives(model: &Model) -> Result<(), TestCaseError> {
    let text = model.file_text();
    let again = read(&text);
    same(model, &again, &text)?;
    prop_assert_eq!(again.file_text(), text);
    Ok(())
}

proptest! {
    #![proptest_config(cases(400))]

    #[test]
    fn model_files_survive_being_read_and_written(text in declaration(), mut draws in draws()) {
        let model = read(&text);
        survives(&model)?;
        survives(&fitted(&model, &mut draws))?;
    }

    #[test]
    fn effects_may_stand_anywhere_in_a_file(
        text in declaration(),
        mut draws in draws(),
        form in 0..3_usize,
    ) {
        let effects = Library::built_in();
        let Ok(declared) = Model::from_text(Path::new("model.toml"), &text, &[]) else { return Ok(()) };
        let mut model = declared.clone();
        model.effects.extend(effect(&declared, effects.effects(), &mut draws));
        model.effects.extend(effect(&model, effects.effects(), &mut draws));
        let whole = model.file_text();
        let rest = whole.strip_prefix(declared.file_text().as_str()).unwrap_or_default();
        let rest = match form {
            0 => rest.to_owned(),
            1 => rest.replace("[[effect]]", "[[ effect ]]"),
            _ => rest.replace("[[effect]]", "[['effect']] # found"),
        };
        survives(&read(&format!("{rest}\n{text}")))?;
        survives(&read(&format!("{text}\n{rest}")))?;
        same(&model, &read(&format!("{rest}\n{text}")), &text)?;
    }

    #[test]
    fn models_of_mechanisms_survive_too(tree in tree(1..=5), mut draws in draws()) {
        let model = read(&model_text(&tree));
        survives(&model)?;
        survives(&fitted(&model, &mut draws))?;
    }
}

//! The equations of motion of a small tree as formulas of a model file.

use std::fmt::Write;

use super::base::{Base, base_parameters};
use super::body::{Joint, Tree};
use super::equations::{Column, Kind, Lengths, christoffel, columns};
use super::formula::{Weighed, factors, join, number, sum};
use super::model_file::{gravity_parameter, name, parameter, short};
use super::series::Series;
use crate::data;

/// Formulas longer than this many characters are broken into lines.
const WIDTH: usize = 110;

/// The equations of motion as formulas, and their base parameters.
pub(super) struct ClosedForm<'c> {
    tree: &'c Tree,
    base: Vec<Base>,
    names: Vec<String>,
    lengths: Lengths,
    rotors: Vec<Base>,
}

impl<'c> ClosedForm<'c> {
    pub fn of(tree: &'c Tree) -> Self {
        let base = base_parameters(columns(&tree.joints, &tree.gravity));
        let (rotors, base): (Vec<Base>, Vec<Base>) = base
            .into_iter()
            .partition(|base| base.column.kind == Kind::Rotor);
        Self {
            tree,
            names: base
                .iter()
                .map(|b| name(b.column.kind, b.column.joint))
                .collect(),
            base,
            lengths: Lengths::of(&tree.joints),
            rotors,
        }
    }

    /// Parameters, dynamics and energy of the model file.
    pub fn text(&self) -> String {
        [self.parameters(), self.dynamics(), self.energy()].concat()
    }

    /// The terms of which each parameter is the sum: factor, kind and joint.
    pub fn sums(&self) -> impl Iterator<Item = (&str, Vec<(f64, Kind, data::Joint)>)> {
        let parts = |base: &Base| {
            let own = (1.0, base.column.kind, base.column.joint);
            [&[own], &base.others[..]].concat()
        };
        let names = self.names.iter().map(String::as_str);
        names.zip(self.base.iter().map(parts))
    }

    /// For each joint, the rotor inertia that is not part of another parameter.
    pub fn rotors(&self) -> Vec<f64> {
        let of_joint = |joint: data::Joint| {
            let mut rotors = self.rotors.iter();
            let own = rotors.find(|rotor| rotor.column.joint == joint);
            own.map_or(0.0, |rotor| rotor.value)
        };
        data::Joint::all(self.joints()).map(of_joint).collect()
    }

    fn joints(&self) -> usize {
        self.tree.joints.len()
    }

    fn parameters(&self) -> String {
        let mut text = "\n[parameters]\n".to_owned();
        for base in &self.base {
            let Column { kind, joint, .. } = base.column;
            let about = about(base, &self.tree.joints[joint]);
            text += &parameter(kind, joint, base.value, base.is_positive(), &about);
        }
        if self.has_gravity() {
            text += &gravity_parameter(self.tree);
        }
        text
    }

    fn has_gravity(&self) -> bool {
        self.base
            .iter()
            .any(|base| !base.column.potential.is_zero())
    }

    fn dynamics(&self) -> String {
        let n = self.joints();
        let mut text = "\n[dynamics.let]\n".to_owned();
        for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
            if self.moves_together(i, j) {
                let entry = self.sum(&[i, j], 0, |base| base.column.mass[i][j].clone());
                text += &entry_line(&mass_name(i, j), &entry);
            }
        }
        for i in (0..n).filter(|i| self.is_drawn(*i)) {
            let slope = self.sum(&[i], 1, |base| base.column.potential.derivative(i));
            text += &entry_line(&format!("G{}", i + 1), &factors(&slope, "g"));
        }
        if self.has_gravity() {
            let potential = self.sum(&[], 1, |base| base.column.potential.clone());
            text += &entry_line("V", &factors(&potential, "g"));
        }
        let row = |i| {
            let entries: Vec<String> = (0..n)
                .map(|j| format!("\"{}\"", self.mass_entry(i, j)))
                .collect();
            format!("[{}]", entries.join(", "))
        };
        let rows: Vec<String> = (0..n).map(row).collect();
        let _ = write!(
            text,
            "\n[dynamics]\nmass = [{}]\nbias = [\n",
            rows.join(", ")
        );
        for i in 0..n {
            let _ = writeln!(text, "    {},", formula_text(&self.bias(i)));
        }
        text + "]\n"
    }

    fn mass_entry(&self, i: usize, j: usize) -> String {
        if self.moves_together(i, j) {
            mass_name(i.min(j), i.max(j))
        } else {
            "0".into()
        }
    }

    fn moves_together(&self, i: usize, j: usize) -> bool {
        self.base
            .iter()
            .any(|base| !base.column.mass[i][j].is_zero())
    }

    /// Whether gravity acts on a joint.
    fn is_drawn(&self, i: usize) -> bool {
        self.base
            .iter()
            .any(|base| !base.column.potential.derivative(i).is_zero())
    }

    /// Coriolis and centrifugal terms by Christoffel's symbols, then gravity.
    fn bias(&self, i: usize) -> String {
        let n = self.joints();
        let mut text = String::new();
        for (j, k) in (0..n).flat_map(|j| (j..n).map(move |k| (j, k))) {
            let of = [i, j, k];
            let symbol = self.sum(&of, 0, |Base { column, .. }| {
                let symbol = christoffel(&column.mass, i, j, k);
                self.lengths.cleaned(column.kind, &of, &symbol)
            });
            if symbol != "0" {
                join(&mut text, &factors(&symbol, &speeds(j, k)));
            }
        }
        if self.is_drawn(i) {
            join(&mut text, &format!("G{}", i + 1));
        }
        if text.is_empty() { "0".into() } else { text }
    }

    fn energy(&self) -> String {
        let n = self.joints();
        let mut total = String::new();
        for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
            if self.moves_together(i, j) {
                let half = if i == j { "0.5*" } else { "" };
                join(
                    &mut total,
                    &format!("{half}{}*{}", mass_name(i, j), speeds(i, j)),
                );
            }
        }
        if self.has_gravity() {
            join(&mut total, "V");
        }
        let power: Vec<String> = (1..=n).map(|j| format!("tau{j}*qd{j}")).collect();
        format!(
            "\n[energy]\ntotal = \"{total}\"\npower = \"{}\"\n",
            power.join(" + ")
        )
    }

    /// The sum over all parameters of a function of each, in an equation of these joints and per this power of a length.
    fn sum(&self, of: &[usize], per: i32, function: impl Fn(&Base) -> Series) -> String {
        let names = self.names.iter().map(String::as_str);
        let weighed = |(base, name)| Weighed {
            name,
            series: function(base),
            lengths: self.lengths.powers(base.column.kind, of) - per,
        };
        let terms: Vec<Weighed<'_>> = self.base.iter().zip(names).map(weighed).collect();
        sum(&terms)
    }
}

/// `M12`
fn mass_name(i: usize, j: usize) -> String {
    format!("M{}{}", data::Joint::at(i), data::Joint::at(j))
}

/// `qd1^2`, `qd1*qd2`
fn speeds(j: usize, k: usize) -> String {
    let speed = |k: usize| data::Joint::at(k).name("qd");
    if j == k {
        format!("{}^2", speed(j))
    } else {
        format!("{}*{}", speed(j), speed(k))
    }
}

fn entry_line(name: &str, formula: &str) -> String {
    format!("{name} = {}\n", formula_text(formula))
}

/// A formula as a TOML string, over several lines if long.
fn formula_text(formula: &str) -> String {
    if formula.len() <= WIDTH {
        return format!("\"{formula}\"");
    }
    let (mut lines, mut line) = (Vec::new(), String::new());
    for word in formula.split(' ') {
        if line.len() + word.len() > WIDTH && may_break(&line) {
            lines.push(std::mem::take(&mut line));
        }
        line += if line.is_empty() { "" } else { " " };
        line += word;
    }
    lines.push(line);
    format!("\"\"\"\n    {}\"\"\"", lines.join("\n    "))
}

/// Whether a line may end here: not after a sign, and not within an angle.
fn may_break(line: &str) -> bool {
    let angle = ["cos(", "sin("]
        .into_iter()
        .filter_map(|wave| line.rfind(wave))
        .max();
    !line.ends_with(['+', '-']) && angle.is_none_or(|at| line[at..].contains(')'))
}

fn about(base: &Base, joint: &Joint) -> String {
    let body = &joint.body;
    let axis = |k: usize| ["x", "y", "z"][k];
    let mut text = match base.column.kind {
        Kind::Tensor(2, 2) => format!("inertia of {body} about the axis of {}", joint.name),
        Kind::Tensor(a, b) if a == b => {
            format!("inertia of {body} about {} at {}", axis(a), joint.name)
        }
        Kind::Tensor(a, b) => format!(
            "inertia of {body}, entry {}{} at {}",
            axis(a),
            axis(b),
            joint.name
        ),
        Kind::Moment(a) => format!("mass of {body} times its centre of mass along {}", axis(a)),
        Kind::Mass => format!("mass of {body}"),
        Kind::Rotor => format!("inertia of the rotor of {}", joint.name),
    };
    for (factor, kind, joint) in &base.others {
        let sign = if *factor < 0.0 { "less" } else { "plus" };
        let size = number(short(factor.abs()));
        let times = if size == "1" {
            String::new()
        } else {
            format!("{size} ")
        };
        let _ = write!(text, ", {sign} {times}{}", name(*kind, *joint));
    }
    text
}

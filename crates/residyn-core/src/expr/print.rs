//! Prints programs: assignments and formulas in any notation.

use std::collections::{HashMap, HashSet};

use super::Program;
use super::latex::Latex;
use super::notation::{COMPARE, Notation, PRODUCT, Part, SIGN, SUM, Text, atom, infix};
use super::op::{Binary, Function, Node, Op, Unary};

/// Inputs and constants in a formula that is written out wherever it is used. Without a limit, the equations of a long chain
/// would double with each of its joints.
const READABLE: usize = 60;

impl Program {
    /// The equations as formulas that the parser reads back: one line for each labelled intermediate, then one for each
    /// output, with these `names`.
    pub fn text(&self, names: &[&str]) -> String {
        let lines = self.lines(&Text, names).into_iter();
        lines.map(|(l, r)| format!("{l} = {r}\n")).collect()
    }

    /// The equations as assignments, left side and right side, with a name for every value that is used more than once;
    /// `names` are those of the outputs.
    pub fn assignments(&self, notation: &dyn Notation, names: &[&str]) -> Vec<(String, String)> {
        self.lines_with(notation, &self.shared(0), names)
    }

    /// The labels, and names for other values that are used more than once and have more than `terms` inputs and
    /// constants when written out.
    fn shared(&self, terms: usize) -> Vec<(Node, String)> {
        let mut taken: HashSet<String> = self.inputs.iter().cloned().collect();
        taken.extend(self.labels.iter().map(|(_, label)| label.clone()));
        let mut fresh = (1..)
            .map(|k| format!("w{k}"))
            .filter(|name| !taken.contains(name));
        let mut named = self.labels.clone();
        let mut known: HashSet<Node> = named.iter().map(|(node, _)| *node).collect();
        let mut sizes: Vec<usize> = Vec::with_capacity(self.ops.len());
        for (node, uses) in (0..).map(Node).zip(self.uses()) {
            let operands = self.ops[node.index()].operands();
            let size: usize = operands.map(|operand| sizes[operand.index()]).sum();
            if uses > 1 && size > terms && self.is_step(node) && known.insert(node) {
                named.push((node, fresh.next().expect("names do not run out")));
            }
            sizes.push(if known.contains(&node) {
                1
            } else {
                size.max(1)
            });
        }
        named
    }

    /// The formula of one output, with all intermediates written out.
    pub fn formula(&self, output: usize) -> String {
        self.written(&Text, &[]).outputs.swap_remove(output)
    }

    /// The formula of one output in LaTeX, with all intermediates written out.
    pub fn latex_formula(&self, output: usize) -> String {
        self.written(&Latex, &[]).outputs.swap_remove(output)
    }

    /// The equations as lines of a LaTeX `align` environment.
    pub fn latex(&self, names: &[&str]) -> String {
        let lines = self.lines(&Latex, names).into_iter();
        let lines: Vec<String> = lines.map(|(l, r)| format!("{l} &= {r}")).collect();
        lines.join(" \\\\\n")
    }

    fn lines(&self, notation: &dyn Notation, names: &[&str]) -> Vec<(String, String)> {
        self.lines_with(notation, &self.shared(READABLE), names)
    }

    /// One line for each node that has a name, then one for each output.
    fn lines_with(
        &self,
        notation: &dyn Notation,
        named: &[(Node, String)],
        names: &[&str],
    ) -> Vec<(String, String)> {
        let Written { mut lines, outputs } = self.written(notation, named);
        let names = names.iter().map(|name| notation.name(name));
        lines.extend(names.zip(outputs));
        lines
    }

    fn is_step(&self, node: Node) -> bool {
        !matches!(self.ops[node.index()], Op::Const(_) | Op::Input(_))
    }

    /// Each node printed once, those with a name on a line of their own.
    fn written(&self, notation: &dyn Notation, named: &[(Node, String)]) -> Written {
        let mut names: HashMap<usize, &str> = HashMap::new();
        for (node, name) in named.iter().filter(|(node, _)| self.is_step(*node)) {
            names.entry(node.index()).or_insert(name);
        }
        let mut parts = Parts {
            parts: Vec::with_capacity(self.ops.len()),
            uses: self.uses(),
        };
        let mut lines = Vec::new();
        for (index, op) in self.ops.iter().enumerate() {
            let whole = self.part(notation, *op, &mut parts);
            parts.parts.push(match names.get(&index) {
                Some(name) => {
                    lines.push((notation.name(name), whole.text));
                    atom(notation.name(name))
                }
                None => whole,
            });
        }
        let outputs = self.outputs.iter().map(|node| parts.take(*node).text);
        Written {
            outputs: outputs.collect(),
            lines,
        }
    }

    /// How often each node is an operand or an output.
    fn uses(&self) -> Vec<usize> {
        let mut uses = vec![0; self.ops.len()];
        let operands = self.ops.iter().flat_map(|op| op.operands());
        for node in operands.chain(self.outputs.iter().copied()) {
            uses[node.index()] += 1;
        }
        uses
    }

    fn part(&self, notation: &dyn Notation, op: Op, parts: &mut Parts) -> Part {
        let mut at = |node: Node| parts.take(node);
        match op {
            Op::Const(value) if value.is_sign_negative() => Part::of(SIGN, notation.number(value)),
            Op::Const(value) => atom(notation.number(value)),
            Op::Input(k) => atom(notation.name(&self.inputs[k as usize])),
            Op::Unary(op, a) => unary(notation, op, at(a)),
            Op::Binary(Binary::Mul, a, b) if a == b => notation.power(at(a), atom("2".into())),
            Op::Binary(Binary::Mul, square, a)
                if self.ops[square.index()] == Op::Binary(Binary::Mul, a, a) =>
            {
                notation.power(at(a), atom("3".into()))
            }
            Op::Binary(op, a, b) => binary(notation, op, at(a), at(b)),
            Op::Where(c, a, b) => atom(notation.choice(&at(c), &at(a).text, &at(b).text)),
        }
    }
}

/// A program in a notation.
struct Written {
    /// Name and formula of each node that has a name.
    lines: Vec<(String, String)>,
    outputs: Vec<String>,
}

/// The nodes printed so far.
struct Parts {
    parts: Vec<Part>,
    /// How often each is still to be written.
    uses: Vec<usize>,
}

impl Parts {
    /// The text of a node: moved when it is written for the last time, since a sum of many terms would otherwise be
    /// copied with each term.
    fn take(&mut self, node: Node) -> Part {
        let (part, uses) = (&mut self.parts[node.index()], &mut self.uses[node.index()]);
        *uses -= 1;
        match *uses {
            0 => std::mem::replace(part, atom(String::new())),
            _ => part.clone(),
        }
    }
}

fn unary(notation: &dyn Notation, op: Unary, a: Part) -> Part {
    match op {
        Unary::Neg => Part::of(SIGN, "-".to_owned() + &a.binding(notation, PRODUCT + 1)),
        Unary::Abs => atom(notation.absolute(&a.text)),
        Unary::Sqrt => atom(notation.root(&a.text)),
        Unary::Sign => atom(notation.call(Function::Sign.name(), &[a.text])),
        _ => atom(notation.call(Function::Unary(op).name(), &[a.text])),
    }
}

fn binary(notation: &dyn Notation, op: Binary, a: Part, b: Part) -> Part {
    match op {
        Binary::Add => infix(notation, a, "+", b, SUM),
        Binary::Sub => infix(notation, a, "-", b, SUM),
        Binary::Less => infix(notation, a, "<", b, COMPARE),
        Binary::Mul => {
            let b = b.binding(notation, PRODUCT + 1);
            Part::of(PRODUCT, notation.product(a.binding(notation, PRODUCT), &b))
        }
        Binary::Div => notation.quotient(a, b),
        Binary::Pow => notation.power(a, b),
        Binary::Atan2 | Binary::Min | Binary::Max => {
            atom(notation.call(Function::Binary(op).name(), &[a.text, b.text]))
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::expr::{Program, parse};

    fn program(text: &str) -> Program {
        let names = ["a", "b", "q1", "qd1", "F_c1", "C_g"];
        parse(text).unwrap().program(names).unwrap()
    }

    #[test]
    fn formulas_print_as_they_are_written() {
        for text in [
            "-F_c1 * sign(qd1)",
            "C_g * sin(q1) + a",
            "a - (b - q1)",
            "a / (b * q1)",
            "(a + b)^1.5",
            "-(a + b)",
            "where(a < b, atan2(a, b), max(a, 0.25))",
            "a^b^q1",
            "exp(-(qd1 / a)^2) * b^3",
            "a - b + q1",
        ] {
            assert_eq!(program(text).formula(0), text);
        }
    }

    #[test]
    fn latex_reads_as_in_a_textbook() {
        assert_eq!(
            program("-F_c1 * sign(qd1) + sin(q1)/sqrt(a)").latex(&["qdd1"]),
            "\\ddot{q}_{1} &= -F_{\\mathrm{c1}} \\,\\operatorname{sign}\\left(\\dot{q}_{1}\\right) + \
             \\frac{\\sin\\left(q_{1}\\right)}{\\sqrt{a}}"
        );
    }
}

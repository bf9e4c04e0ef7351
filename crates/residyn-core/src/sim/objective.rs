use crate::expr::{FormulaError, Graph, Program, Scope, SignForm, parse_finite};

/// A formula of the state at the end of a step (`q1`, `qd1`, ...), the torque or command held over it (`tau1` or
/// `cmd1`, ...) and time (`t`):
/// the reward of a step, which planners sum over a rollout and maximise, or another quantity of a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Objective {
    program: Program,
}

impl Objective {
    /// The formula in terms of `joints` joints, e.g. `cos(q1) - 0.01 * tau1^2`.
    ///
    /// # Errors
    /// A syntax error, or an unknown name.
    pub fn new(formula: &str, joints: usize) -> Result<Self, FormulaError> {
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        let names = ["q", "qd", "tau"].into_iter();
        let numbered =
            names.flat_map(|name| (1..=joints).map(move |joint| format!("{name}{joint}")));
        for name in numbered.chain(["t".to_owned()]) {
            let node = graph.input(&name);
            scope.bind(&name, node);
            if let Some(joint) = name.strip_prefix("tau") {
                scope.bind(&format!("cmd{joint}"), node);
            }
        }
        let reward = scope.lower(&mut graph, &parse_finite(formula)?)?;
        Ok(Self {
            program: graph.finish(&[reward]),
        })
    }

    /// The value at `state` (positions, then velocities) after `tau` was held, at `time_s`.
    ///
    /// # Panics
    /// When `state` or `tau` has a different number of joints.
    pub fn value(&self, state: &[f64], tau: &[f64], time_s: f64) -> f64 {
        self.program.eval(&[state, tau, &[time_s]].concat())[0]
    }

    /// Inputs: `q`, `qd` and `tau` of every joint, then `t`. One output.
    pub fn program(&self) -> &Program {
        &self.program
    }
}

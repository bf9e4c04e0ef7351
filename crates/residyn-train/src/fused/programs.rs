use crate::Structure;
use residyn_core::expr::{Program, Tape};
use residyn_core::sim::batch::W;

/// The programs of a structure as tapes, one for each thread.
#[derive(Debug)]
pub(super) struct Programs {
    pub program: Tape<f32, W>,
    pub adjoint: Tape<f32, W>,
    pub parameter_adjoint: Tape<f32, W>,
}

impl Programs {
    pub(super) fn new(structure: &Structure) -> Self {
        let tape = |program: &Program| {
            let first = program.inputs().len() - structure.parameters().len();
            program.tape_with_held(first)
        };
        Self {
            program: tape(&structure.program),
            adjoint: tape(&structure.adjoint),
            parameter_adjoint: tape(&structure.parameter_adjoint),
        }
    }

    /// Sets the parameters, in their units: the last inputs of each program.
    pub(super) fn set_parameters(&mut self, parameters: &[f32]) {
        for tape in [
            &mut self.program,
            &mut self.adjoint,
            &mut self.parameter_adjoint,
        ] {
            let inputs = tape.inputs();
            let first = inputs.len() - parameters.len();
            for (input, value) in inputs[first..].iter_mut().zip(parameters) {
                input.fill(*value);
            }
        }
    }
}

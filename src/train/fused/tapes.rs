use crate::expr::{Program, Tape};
use crate::sim::batch::W;
use crate::train::Frame;

/// The programs of a frame, ready to run.
#[derive(Debug)]
pub(super) struct Tapes {
    pub program: Tape<'static, f32, W>,
    pub adjoint: Tape<'static, f32, W>,
    pub parameter_adjoint: Tape<'static, f32, W>,
    /// Of the parameters, the last inputs of each.
    count: usize,
}

impl Tapes {
    pub(super) fn new(frame: &Frame) -> Self {
        let count = frame.parameters().len();
        let tape = |program: &Program| {
            let first = program.inputs().len() - count;
            program.tape_with_held(first).into_owned()
        };
        Self {
            program: tape(&frame.program),
            adjoint: tape(&frame.adjoint),
            parameter_adjoint: tape(&frame.parameter_adjoint),
            count,
        }
    }

    /// Put the parameters in place.
    pub(super) fn set_parameters(&mut self, parameters: &[f32]) {
        for tape in [
            &mut self.program,
            &mut self.adjoint,
            &mut self.parameter_adjoint,
        ] {
            let inputs = tape.inputs();
            let first = inputs.len() - self.count;
            for (input, value) in inputs[first..].iter_mut().zip(parameters) {
                input.fill(*value);
            }
        }
    }
}

//! The built-in systems against equations written by hand.

use residyn_core::expr::SignForm;

use crate::support::catalogue::{assert_all_near, dynamics, points, system};
use crate::support::oracles::{COMMANDED, ORACLES};

/// Rounding only: both sides take a few dozen operations in f64 (1e-16 each), and a subtraction in the acrobot's
/// denominator may lose two digits.
const ROUNDING: f64 = 1e-12;

#[test]
fn systems_match_equations_written_by_hand() {
    for (name, oracle) in ORACLES.into_iter().chain(COMMANDED) {
        let model = dynamics(&system(name), &[], SignForm::Exact);
        let n = model.joints;
        for point in points(&model, 500, 1) {
            let found = model.program.eval(&point);
            assert_eq!(found[..n], point[n..2 * n], "{name}: dq/dt is qd");
            assert_all_near(&found[n..], &oracle(&point), ROUNDING, name);
        }
    }
}

#[test]
fn every_system_has_an_oracle() {
    let all = ORACLES.into_iter().chain(COMMANDED);
    let mut known: Vec<&str> = all.map(|(name, _)| name).collect();
    known.sort_unstable();
    assert_eq!(residyn_core::model::Library::system_names(), known);
}

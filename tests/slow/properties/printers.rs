//! Exported formulas: what other programs compute from them.

use proptest::prelude::*;
use residyn_core::expr::parse_finite;
use residyn_core::model::{Library, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportModel, Samples, find};
use serde_json::json;

use super::cases;
use super::formulas::{point, usual_formula};
use crate::support::clients::there_are;

/// Formulas per model: as many as it has joints.
const FORMULAS: usize = 12;

/// Formulas that a model may have.
fn formula() -> impl Strategy<Value = String> {
    usual_formula().prop_filter("a finite number somewhere", |formula| {
        parse_finite(formula).is_ok()
    })
}

/// A model whose accelerations are these formulas.
fn model(formulas: &[String]) -> ExportModel {
    let accelerations = (1..).zip(formulas);
    let accelerations: String = accelerations
        .map(|(joint, formula)| format!("qdd{joint} = \"{formula}\"\n"))
        .collect();
    let text = format!(
        "[system]\nname = \"random\"\njoints = {FORMULAS}\n[parameters]\np_1 = {{ value = 0.7 }}\n\
         [dynamics]\nlet.x = \"q1\"\nlet.y = \"q2\"\n{accelerations}"
    );
    let model = Model::from_text("random.toml".as_ref(), &text, Library::built_in().effects());
    ExportModel::of_system(&model.unwrap(), Integrator::RK4, 0.01, json!({}))
}

/// States in which x and y have these values.
fn samples(points: &[[f64; 3]]) -> Samples {
    let state = |[x, y, _]: &[f64; 3]| {
        let mut state = vec![0.0; 2 * FORMULAS];
        // Clients in single precision get the same values.
        state[0] = f64::from(*x as f32);
        state[1] = f64::from(*y as f32);
        state
    };
    Samples {
        joints: FORMULAS,
        step_s: 0.01,
        states: points.iter().map(state).collect(),
        torques: vec![vec![0.0; FORMULAS]; points.len()],
        start: vec![0.0; 2 * FORMULAS],
        held: Vec::new(),
    }
}

proptest! {
    // Each case compiles a program.
    #![proptest_config(ProptestConfig { max_shrink_iters: 300, ..cases(8) })]

    #[test]
    fn compiled_formulas_compute_what_the_program_does(
        formulas in prop::collection::vec(formula(), FORMULAS),
        points in prop::collection::vec(point(), 50),
    ) {
        if !there_are(&["cc"]) {
            return Ok(());
        }
        let (model, samples) = (model(&formulas), samples(&points));
        let folder = tempfile::tempdir().unwrap();
        let header = folder.path().join("model.h");
        let format = find("c").unwrap();
        format.write(&model, &header).unwrap();
        let compiled = format.predict(&header, &samples).unwrap().derivative.unwrap();
        let own = model.predict(&samples).unwrap().derivative.unwrap();
        for ((own, compiled), state) in own.iter().zip(&compiled).zip(&samples.states) {
            for ((own, compiled), formula) in own[FORMULAS..].iter().zip(&compiled[FORMULAS..]).zip(&formulas) {
                let near = (own - compiled).abs() <= 1e-9 * own.abs();
                let same = near || own == compiled || own.is_nan() && compiled.is_nan();
                prop_assert!(same, "{} is {:?}, compiled {:?} at {:?}", formula, own, compiled, &state[..2]);
            }
        }
    }
}

use super::{Gradient, hybrid, rng, transitions};
use crate::{Backend, HybridModel, Objective, Segments};
use residyn_core::model::{LastLayer, MlpWeights, ModelWeights};
use residyn_core::sim::Integrator;

/// A trajectory with irregular steps, cut into segments of three.
fn segments() -> Segments {
    use rand::RngExt;
    let mut rng = rng(5);
    let mut time = vec![0.0];
    let (mut states, mut inputs) = (vec![0.3, -1.0], vec![0.5]);
    for k in 0..40 {
        time.push(time[k] + rng.random_range(0.01..0.05));
        states.extend([rng.random_range(-3.0..3.0), rng.random_range(-4.0..4.0)]);
        inputs.push(rng.random_range(-3.0..3.0));
    }
    let mut segments = Segments::new(1, 3);
    segments
        .push_trajectory(&time, &states, &inputs, 2)
        .unwrap();
    segments
}

const WEIGHTS: [f64; 2] = [1.0, 0.3];

fn gradient(model: &HybridModel, segments: &Segments, integrator: Integrator) -> Gradient {
    let objective = Objective::new(integrator, Some(&[0.5, 2.0]), 1).unwrap();
    let batch = objective.all(segments, &model.device());
    super::gradient(&objective, model, &batch, WEIGHTS)
}

/// The k-th weight of the first hidden layer or the k-th physical parameter, moved by `by`.
fn moved(weights: &ModelWeights, physical: bool, k: usize, by: f64) -> ModelWeights {
    let mut weights = weights.clone();
    let value = match (&mut weights.residual, physical) {
        (Some(MlpWeights { layers, .. }), false) => &mut layers[1].weight[k],
        _ => &mut weights.parameters[k],
    };
    *value += by;
    weights
}

#[test]
fn gradients_match_central_differences() {
    for (backend, integrator) in Backend::ALL
        .iter()
        .flat_map(|b| Integrator::each().into_iter().map(move |i| (*b, i)))
    {
        let segments = segments();
        let model = hybrid((8.0, 2.0), &segments, backend, LastLayer::Random);
        let found = gradient(&model, &segments, integrator).by_numbers;
        let (physics, residual) = found.split_at(2);
        // After the weights and biases of the first layer.
        let hidden = &residual[4 * 16..];

        let value = |weights: &ModelWeights| {
            let model = model.with_weights(weights).unwrap();
            let [error, norm] = gradient(&model, &segments, integrator).loss;
            WEIGHTS[0] * error + WEIGHTS[1] * norm
        };
        let weights = model.weights();
        // The loss is an f32 near 30, so differences over 2 h carry about 2e-6 / h.
        let check = |found: f32, physical, k, scale: f64| {
            let h = 0.01;
            let slope = |by: f64| value(&moved(&weights, physical, k, by));
            let wanted = (slope(h * scale) - slope(-h * scale)) / (2.0 * h);
            let off = (f64::from(found) - wanted).abs();
            assert!(
                off < 2e-3 + 1e-2 * wanted.abs(),
                "{found} or {wanted}, {backend} {integrator:?}"
            );
        };
        check(physics[0], true, 0, 8.0);
        check(physics[1], true, 1, 2.0);
        for k in [0, 17, 100, 255] {
            // Burn's weights are `[input][output]`.
            check(hidden[k % 16 * 16 + k / 16], false, k, 1.0);
        }
    }
}

#[test]
fn a_residual_of_zero_has_a_finite_gradient() {
    let segments = transitions(20, -0.5, 1);
    let model = hybrid((15.0, 3.0), &segments, Backend::NdArray, LastLayer::Zero);
    let found = gradient(&model, &segments, Integrator::default()).by_numbers;
    let last = &found[2 + 16 * (4 + 17 + 17)..];
    assert!(last.iter().all(|g| g.is_finite()) && last.iter().any(|g| *g != 0.0));
}

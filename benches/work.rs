//! The models, data and engines that all benches measure, the same in every run.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residyn_control::plan::Objective;
use residyn_core::model::{Dynamics, InputScaling, LastLayer, Library, MlpSettings, MlpWeights};
use residyn_core::sim::Integrator;
use residyn_core::sim::batch::Rollouts;
use residyn_train::{Backend, FitSettings, HybridModel, Segments, Training};

/// How long a torque is held, s.
pub const STEP_S: f64 = 0.02;

/// The equations of a built-in system.
pub fn dynamics(name: &str) -> Dynamics {
    let system = Library::built_in().model(name);
    system.expect("a built-in system").dynamics()
}

/// A network with random weights.
pub fn network(joints: usize, settings: &MlpSettings) -> MlpWeights {
    let scaling = InputScaling::identity(settings.angles.features(joints));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    MlpWeights::new(joints, settings, scaling, LastLayer::Random, &mut rng)
}

/// Segments of `steps` steps with random states and inputs: the cost depends on these sizes alone.
pub fn segments(joints: usize, steps: usize, count: usize) -> Segments {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut draw =
        |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-3.0..3.0)).collect() };
    let time: Vec<f64> = (0..=steps).map(|k| STEP_S * k as f64).collect();
    let mut segments = Segments::new(joints, steps);
    for _ in 0..count {
        let states = draw(2 * joints * time.len());
        let inputs = draw(joints * time.len());
        let pushed = segments.push_trajectory(&time, &states, &inputs, 1);
        pushed.expect("one segment");
    }
    segments
}

/// Training of a hybrid model, recorded only at its end.
pub fn training(dynamics: &Dynamics, network: &MlpWeights, epochs: usize) -> Training {
    let model = HybridModel::physics(dynamics, &Backend::NdArray.device())
        .and_then(|model| model.with_residual(network))
        .expect("a model of this system");
    let settings = FitSettings {
        epochs,
        record_every: epochs.try_into().expect("at least once"),
        ..FitSettings::default()
    };
    let training = Training::new(model, settings, ChaCha8Rng::seed_from_u64(3));
    training.expect("settings in range")
}

/// Rollouts of a hybrid model under this reward.
pub fn rollouts(dynamics: &Dynamics, network: MlpWeights, reward: &str) -> Rollouts {
    let objective = Objective::new(reward, dynamics.joints).expect("a formula");
    Rollouts::new(
        dynamics,
        &[network],
        objective.program(),
        Integrator::default(),
        STEP_S,
    )
}

use burn::tensor::{Tensor, TensorData};

use crate::{Backend, HybridModel};
use residyn_core::model::Library;
use residyn_core::sim::{Environment, Integrator};

#[test]
fn an_environment_steps_as_training_does() {
    let model = Library::built_in().model("acrobot").unwrap();
    let dynamics = model.dynamics();
    let device = Backend::NdArray.device();
    let model = HybridModel::physics(&dynamics, &device).unwrap();
    let column = |x: f64| Tensor::<1>::from_data(TensorData::new(vec![x as f32], [1]), &device);
    let (start, tau) = ([0.5, -1.0, 2.0, -3.0], [1.0, -2.0]);
    for integrator in Integrator::each() {
        let mut state = start;
        Environment::new(&dynamics, integrator, 0.02).step(&mut state, &tau, 0.0);
        let unpacked = model.unpack();
        let (columns, inputs) = (start.map(column), tau.map(column));
        let step = unpacked.step(integrator, &columns, &inputs, &column(0.0), &column(0.02));
        for (mine, trained) in state.iter().zip(step.state) {
            let trained = f64::from(trained.into_scalar::<f32>());
            assert!(
                (mine - trained).abs() < 1e-5,
                "{mine} {trained} {integrator:?}"
            );
        }
    }
}

//! The hybrid model as a Burn module.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::{GradientsParams, SgdConfig};
use burn::tensor::Tensor;

use super::{hybrid, hybrid_of, one_joint, parameter, pendulum, transitions};
use crate::{Backend, HybridModel, Objective};
use residyn_core::model::LastLayer;
use residyn_core::sim::Integrator;

fn model() -> HybridModel {
    let segments = transitions(50, -0.5, 1);
    hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Random)
}

/// The path and the entries of every tensor.
#[derive(Default)]
struct Paths {
    path: Vec<String>,
    found: Vec<(String, usize)>,
}

impl ModuleVisitor for Paths {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let entries = param.shape().num_elements();
        self.found.push((self.path.join("."), entries));
    }
}

#[test]
fn visitors_find_every_part_by_its_path() {
    let mut paths = Paths::default();
    let model = model();
    model.visit(&mut paths);
    assert_eq!(paths.found.len(), 9);
    assert_eq!(paths.found[0], ("physics.scaled".to_owned(), 2));
    assert_eq!(
        paths.found[1],
        ("residual.layers.0.weight".to_owned(), 3 * 16)
    );
    assert_eq!(paths.found[8], ("residual.layers.3.bias".to_owned(), 1));
    let entries: usize = paths.found.iter().map(|(_, entries)| entries).sum();
    assert_eq!(model.num_params(), entries);
    let names: Vec<&str> = model.physics.as_ref().unwrap().names().collect();
    assert_eq!(names, ["C_g", "C_i"]);
}

#[test]
fn a_record_restores_the_numbers_of_a_model_that_is_made_anew() {
    let trained = model();
    let segments = transitions(50, -0.5, 2);
    let fresh = hybrid((1.0, 1.0), &segments, Backend::NdArray, LastLayer::Zero);
    assert_ne!(fresh.weights().residual, trained.weights().residual);
    let bytes = trained.clone().into_record().into_bytes().unwrap();
    let record = burn::store::ModuleRecord::from_bytes(bytes).unwrap();
    let restored = fresh.load_record(record);
    let flat = |model: &HybridModel| model.weights().residual.unwrap().flat();
    assert_eq!(flat(&restored), flat(&trained));
}

#[test]
fn what_takes_no_gradient_stays_as_it_is() {
    let segments = transitions(50, -0.5, 1);
    let mut model = model();
    model.residual = model.residual.map(Module::no_grad);
    let before = model.weights();
    let objective = Objective::new(Integrator::default(), None, 1).unwrap();
    let batch = objective.all(&segments, &model.device());
    let gradients = objective.loss(&model, &batch).sum().backward();
    let gradients = GradientsParams::from_grads(gradients, &model);
    assert_eq!(gradients.len(), 1);
    let after = SgdConfig::new()
        .init()
        .step(1e-3, model, gradients)
        .weights();
    assert_eq!(after.residual, before.residual);
    assert_ne!(after.parameters, before.parameters);
}

#[test]
fn a_term_of_ones_own_adds_its_derivative() {
    let segments = transitions(50, -0.5, 1);
    let model = model();
    let objective = Objective::new(Integrator::default(), None, 1).unwrap();
    let batch = objective.all(&segments, &model.device());
    let slope = |of_term: f64| {
        let loss = objective.loss(&model, &batch).sum();
        let physics = model.physics.as_ref().unwrap();
        let term = physics.parameter("C_i").unwrap().powi_scalar(2) * of_term;
        let gradients = (loss + term).backward();
        let gradient = physics.scaled.val().grad(&gradients).unwrap();
        gradient.into_data().iter::<f32>().collect::<Vec<_>>()
    };
    let (with, without) = (slope(0.5), slope(0.0));
    assert_eq!(with[0], without[0]);
    // d (C_i^2 / 2) / d (C_i / scale) = C_i * scale, and both are 2.
    assert!(
        ((with[1] - without[1]) - 4.0).abs() < 1e-3,
        "{with:?} {without:?}"
    );
    assert!(model.physics.as_ref().unwrap().parameter("C_x").is_none());
}

#[test]
fn a_step_out_of_the_bounds_ends_on_them() {
    let mut c_i = parameter("C_i", 2.0);
    c_i.bounds = [0.0, 2.05];
    let free = parameter("C_g", 8.0);
    let dynamics = one_joint("C_g * sin(q1) + C_i * tau1", vec![free, c_i]);
    let device = Backend::NdArray.device();
    let mut model = HybridModel::physics(&dynamics, &device).unwrap();
    let physics = model.physics.as_mut().unwrap();
    physics.scaled = physics.scaled.clone().map(|scaled| {
        let moved = scaled.inner() * 3.0;
        Tensor::from_inner(moved).require_grad()
    });
    let within = model.within_bounds();
    assert!((within.weights().parameters[1] - 2.05).abs() < 1e-6);
    assert!((within.weights().parameters[0] - 24.0).abs() < 1e-5);
    assert!(within.physics.unwrap().scaled.is_require_grad());
}

#[test]
fn deep_networks_are_joined_in_groups() {
    let segments = transitions(40, -0.5, 1);
    let settings = residyn_core::model::MlpSettings {
        hidden: vec![3; 40],
        ..residyn_core::model::MlpSettings::for_joints(1)
    };
    let network = segments.network(&settings, LastLayer::Random, &mut super::rng(7));
    let model = hybrid_of(&pendulum(8.0, 2.0), &network, &Backend::NdArray.device());
    let objective = Objective::new(Integrator::default(), None, 1).unwrap();
    let gradient = |objective: &Objective| {
        let batch = objective.all(&segments, &model.device());
        super::gradient(objective, &model, &batch, [1.0, 0.3]).by_numbers
    };
    let (fused, composed) = (
        gradient(&objective),
        gradient(&objective.clone().composed()),
    );
    assert_eq!(fused.len(), model.num_params());
    let norm = |x: &[f32]| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let off: Vec<f32> = fused.iter().zip(&composed).map(|(a, b)| a - b).collect();
    assert!(norm(&off) <= 1e-5 * norm(&composed));
}

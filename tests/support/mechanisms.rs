//! Models made from robot descriptions.

use std::fs;
use std::path::{Path, PathBuf};

use rand::RngExt;
use residyn_core::expr::SignForm;
use residyn_core::model::tree::{Tree, model_text};
use residyn_core::model::{Dynamics, FittedEffect, Library, Model};
use residyn_formats::{FORMATS, Format};
use serde_json::json;

use super::catalogue::{dynamics, rng};
use super::clients::client;
use super::paths::ours;

/// The descriptions among the fixtures, with the last link of the tree.
pub const FILES: [(&str, Option<&str>); 8] = [
    ("planar_2r.urdf", None),
    ("rounded_2r.urdf", None),
    ("spatial_3r.urdf", None),
    ("tree_3r.urdf", None),
    ("rp.xml", None),
    ("prr.xml", None),
    ("geoms.xml", None),
    ("linkage_4r.urdf", Some("hand")),
];

pub fn fixture(name: &str) -> PathBuf {
    ours("tests/fixtures/mechanisms").join(name)
}

/// The format of a robot description, by the file's extension.
pub fn format_of(file: &Path) -> &'static Format {
    let extension = file.extension().unwrap();
    let mut formats = FORMATS.iter().filter(|format| format.robots.is_some());
    formats.find(|f| extension == f.extension).unwrap()
}

/// The tree of a description to the link `tip`.
pub fn read_to(file: &Path, tip: Option<&str>) -> Tree {
    (format_of(file).robots.as_ref().unwrap().read)(file, tip).unwrap()
}

pub fn read(file: &Path) -> Tree {
    read_to(file, None)
}

/// A model as `residyn new` writes it.
pub fn system(tree: &Tree) -> Model {
    let library = Library::built_in();
    Model::from_text(Path::new(&tree.name), &model_text(tree), library.effects()).unwrap()
}

/// The model, keeping only effects that are forces of the state: in MuJoCo dry friction and limits are constraints.
pub fn comparable(system: &Model) -> Dynamics {
    let others = ["coulomb_friction", "actuator_saturation"];
    let is_force = |effect: &&FittedEffect| !others.contains(&effect.effect.name.as_str());
    let effects: Vec<FittedEffect> = system.effects.iter().filter(is_force).cloned().collect();
    dynamics(system, &effects, SignForm::Exact)
}

/// MuJoCo's inverse dynamics of a description reproduces the torques that moved a model.
pub fn mujoco_agrees(description: &Path, model: &Dynamics) {
    let n = model.joints;
    let mut rng = rng(1);
    let sample = |_| {
        let mut draw = |bound: f64| (0..n).map(|_| rng.random_range(-bound..bound)).collect();
        let [q, qd, tau]: [Vec<f64>; 3] = [draw(3.0), draw(4.0), draw(20.0)];
        let inputs = [&q, &qd, &tau, &vec![0.0], &model.values()]
            .map(Vec::as_slice)
            .concat();
        let qdd = &model.program.eval(&inputs)[n..];
        json!({"q": q, "qd": qd, "tau": tau, "qdd": qdd})
    };
    let samples: Vec<_> = (0..200).map(sample).collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("samples.json");
    fs::write(&file, serde_json::to_string(&samples).unwrap()).unwrap();
    client("mechanism.py", &[description, &file]);
}

//! Chains of bodies: written as URDF and MJCF and read back; written into a description that was made from them.

use std::fs;
use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;
use residyn_core::model::tree::{Drivetrain, Inertia, Joint, Pose, Spring, Tree};
use residyn_core::model::{Dynamics, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportError, ExportModel, find, write_back};

use super::cases;
use crate::support::catalogue::points;
use crate::support::mechanisms::{comparable, system};

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

/// Any orientation, or quarter turns as most robots have.
fn rotation() -> impl Strategy<Value = Matrix3<f64>> {
    let axis = prop_oneof![
        Just(Vector3::<f64>::x()),
        Just(Vector3::y()),
        Just(Vector3::z())
    ];
    let quarter = (axis, 0..4_u8).prop_map(|(axis, turns)| {
        let cross = axis.cross_matrix();
        (0..turns).fold(Matrix3::identity(), |turned, _| {
            turned * (axis * axis.transpose() + cross)
        })
    });
    let any = prop::array::uniform4(-1.0..1.0_f64)
        .prop_filter("a direction", |q| {
            q.iter().map(|x| x * x).sum::<f64>() > 0.01
        })
        .prop_map(|[w, x, y, z]| {
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            *turn.to_rotation_matrix().matrix()
        });
    prop_oneof![any, quarter]
}

/// A body with positive density: the principal moments of three spreads of mass.
fn inertia() -> impl Strategy<Value = Inertia> {
    let spreads = prop::array::uniform3(1e-3..0.1_f64);
    (0.2..5.0_f64, vector(0.3), spreads, rotation()).prop_map(
        |(mass, origin, [a, b, c], rotation)| {
            let principal = Matrix3::from_diagonal(&Vector3::new(b + c, a + c, a + b));
            Inertia::central(mass, principal * mass, &Pose { rotation, origin })
        },
    )
}

fn drivetrain() -> impl Strategy<Value = Drivetrain> {
    let spring = prop::option::of((0.1..5.0_f64, -1.0..1.0_f64));
    let some = |most: f64| prop_oneof![Just(0.0), 1e-3..most];
    (
        some(1.0),
        some(0.5),
        some(0.1),
        spring,
        prop::option::of(1.0..50.0_f64),
    )
        .prop_map(|(damping, friction, armature, spring, effort)| Drivetrain {
            damping,
            friction,
            armature,
            spring: spring.map(|(stiffness, rest)| Spring { stiffness, rest }),
            effort,
            servo: None,
        })
}

fn joint() -> impl Strategy<Value = Joint> {
    let slides = prop::bool::weighted(0.25);
    (slides, vector(0.5), rotation(), inertia(), drivetrain()).prop_map(
        |(slides, origin, rotation, inertia, drivetrain)| Joint {
            name: String::new(),
            body: String::new(),
            parent: None,
            slides,
            pose: Pose { rotation, origin },
            reference: 0.0,
            across: Vector3::x(),
            axis: Vector3::z(),
            anchor: Vector3::zeros(),
            inertia,
            follows: None,
            drivetrain,
        },
    )
}

/// A tree with this number of joints, limb by limb: each joint sits on the one before it, or some steps further up.
pub fn tree(joints: RangeInclusive<usize>) -> impl Strategy<Value = Tree> {
    let up = prop_oneof![3 => Just(0), 1 => 1..4_usize];
    prop::collection::vec((joint(), up), joints).prop_map(|drawn| {
        let mut joints: Vec<Joint> = Vec::new();
        for (k, (mut joint, up)) in drawn.into_iter().enumerate() {
            joint.name = format!("joint_{}", k + 1);
            joint.body = format!("body_{}", k + 1);
            joint.parent = (0..up).fold(k.checked_sub(1), |at, _| joints[at?].parent);
            joints.push(joint);
        }
        Tree {
            name: "tree".into(),
            gravity: Vector3::new(0.0, 0.0, -9.81),
            joints,
            drive: None,
            notes: Vec::new(),
        }
    })
}

/// The models' accelerations at the same states, to 1e-9 of the largest.
fn same(found: &Dynamics, wanted: &Dynamics) -> Result<(), TestCaseError> {
    let n = wanted.joints;
    prop_assert_eq!(found.joints, n);
    for point in points(wanted, 20, 5) {
        let [found, wanted] = [found, wanted].map(|model| {
            let inputs = [&point[..3 * n + 1], &model.values()].concat();
            model.program.eval(&inputs)[n..].to_vec()
        });
        let size = wanted
            .iter()
            .fold(0.0_f64, |most, rate| most.max(rate.abs()));
        for (f, w) in found.iter().zip(&wanted) {
            prop_assert!((f - w).abs() <= 1e-9 * size, "{:?} and {:?}", found, wanted);
        }
    }
    Ok(())
}

/// A tree as read back from a format, or why the format does not carry it.
fn through(format: &str, model: &Model) -> Result<Result<Tree, String>, TestCaseError> {
    let format = find(format).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree").with_extension(format.extension);
    let exported = ExportModel::of_system(model, Integrator::RK4, 0.01, serde_json::json!({}));
    match format.write(&exported, &path) {
        Err(error @ ExportError::Model { .. }) => Ok(Err(error.to_string())),
        Err(error) => Err(TestCaseError::fail(error.to_string())),
        // Only MuJoCo reads the gravity in such a file.
        Ok(_)
            if (format.not_carried)(&exported)
                .iter()
                .any(|lost| lost.contains("gravity")) =>
        {
            Ok(Err("its gravity is none of this format".to_owned()))
        }
        Ok(_) => {
            let read = format.robots.as_ref().unwrap().read;
            let again =
                read(&path, None).map_err(|error| TestCaseError::fail(error.to_string()))?;
            Ok(Ok(again))
        }
    }
}

/// The part of a tree that a format carries.
fn carried(tree: &Tree, format: &str) -> Tree {
    let mut tree = tree.clone();
    for drivetrain in tree.joints.iter_mut().map(|joint| &mut joint.drivetrain) {
        if format == "urdf" {
            drivetrain.armature = 0.0;
            drivetrain.spring = None;
        }
    }
    tree
}

proptest! {
    #![proptest_config(cases(40))]

    #[test]
    fn trees_move_alike_when_they_are_read_back(tree in tree(1..=7)) {
        for format in ["urdf", "mjcf"] {
            let tree = carried(&tree, format);
            let model = system(&tree);
            let again = match through(format, &model)? {
                Ok(again) => again,
                Err(why) => {
                    // From equations in closed form, only some kinds of mechanism are recovered.
                    prop_assert!((2..=3).contains(&tree.joints.len()), "{}: {}", format, why);
                    continue;
                }
            };
            same(&comparable(&system(&again)), &comparable(&model))?;
            let damping = |tree: &Tree| -> Vec<f64> {
                tree.joints.iter().map(|joint| joint.drivetrain.damping).collect()
            };
            prop_assert_eq!(damping(&again), damping(&tree));
        }
    }

    #[test]
    fn values_come_back_from_a_description_that_they_were_written_into(
        tree in tree(1..=6),
        more in prop::collection::vec(1.0..1.3_f64, 6),
    ) {
        for (format, extension) in [("urdf", "urdf"), ("mjcf", "xml")] {
            let tree = carried(&tree, format);
            let Ok(original) = through(format, &system(&tree))? else { continue };
            let mut fitted = original.clone();
            for (joint, more) in fitted.joints.iter_mut().zip(&more) {
                joint.inertia.mass *= more;
                joint.inertia.moment *= *more;
                joint.inertia.tensor *= more * more;
                joint.drivetrain.damping += more - 1.0;
            }
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("tree").with_extension(extension);
            let exported = ExportModel::of_system(&system(&tree), Integrator::RK4, 0.01, serde_json::json!({}));
            find(format).unwrap().write(&exported, &path).unwrap();
            let written = write_back(&system(&fitted), &path, None)
                .map_err(|error| TestCaseError::fail(error.to_string()))?;
            fs::write(&path, &written.text).unwrap();
            let read = find(format).unwrap().robots.as_ref().unwrap().read;
            let again = read(&path, None).map_err(|error| TestCaseError::fail(error.to_string()))?;
            same(&comparable(&system(&again)), &comparable(&system(&fitted)))?;
        }
    }
}

/// A description and its weights, read back.
mod descriptions {
    use residyn::Library;
    use residyn_formats::Imported;

    use super::*;

    proptest! {
        #![proptest_config(cases(40))]

        #[test]
        fn a_description_holds_every_number(tree in tree(1..=7)) {
            let model = system(&tree);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("model.json");
            let exported = ExportModel::of_system(&model, Integrator::RK4, 0.01, serde_json::json!({}));
            find("json").unwrap().write(&exported, &path).unwrap();
            let again = Imported::read(&path, Library::built_in().effects()).unwrap();
            let equations = again.system.dynamics();
            prop_assert_eq!(&again.numbers.parameters, &model.values());
            prop_assert_eq!(&equations.program, &model.dynamics().program);
            prop_assert_eq!(again.system.file_text(), model.file_text());
        }
    }
}

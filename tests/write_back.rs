//! A model's values, written back into the robot description that it was made from.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::Library;
use residyn::read_model;
use residyn_core::model::Model;
use residyn_core::model::chain::{Chain, model_text};
use residyn_formats::write_back;

use crate::support::mechanisms::{comparable, fixture, mujoco_agrees, read_to, system};
use crate::support::{refuses, residyn, succeeds, text};

/// Descriptions with the last link of the chain.
const FILES: [(&str, Option<&str>); 7] = [
    ("planar_2r.urdf", None),
    ("rounded_2r.urdf", None),
    ("spatial_3r.urdf", None),
    ("linkage_4r.urdf", Some("hand")),
    ("rp.xml", None),
    ("prr.xml", None),
    ("geoms.xml", None),
];

/// The chain as a fit might find it: every body heavier and wider, more friction, and larger rotors if the format has
/// rotors.
fn as_fitted(file: &Path, tip: Option<&str>) -> Chain {
    let mut chain = read_to(file, tip);
    let has_rotors = file.extension().unwrap() == "xml";
    for (k, joint) in (1..).zip(&mut chain.joints) {
        let more = 1.0 + 0.03 * f64::from(k);
        joint.inertia.mass *= more;
        joint.inertia.moment *= more;
        joint.inertia.tensor *= more * more;
        if joint.follows.is_none() {
            joint.drivetrain.damping += 0.05;
            joint.drivetrain.friction += 0.2;
            joint.drivetrain.armature += if has_rotors { 0.02 } else { 0.0 };
        }
    }
    chain
}

/// A description with these values, in a new file.
fn written(folder: &Path, file: &Path, tip: Option<&str>, values: &Chain) -> PathBuf {
    let model = folder.join("model.toml");
    fs::write(&model, model_text(values)).unwrap();
    let out = folder.join(file.file_name().unwrap());
    let mut arguments = vec![
        "export",
        "--model",
        text(&model),
        "--into",
        text(file),
        "--out",
        text(&out),
    ];
    arguments.extend(tip.iter().flat_map(|tip| ["--tip", tip]));
    succeeds(&arguments);
    out
}

#[test]
fn nothing_else_in_the_file_changes() {
    let folder = tempfile::tempdir().unwrap();
    for (name, tip) in FILES {
        let original = fs::read_to_string(fixture(name)).unwrap();
        let unchanged = written(
            folder.path(),
            &fixture(name),
            tip,
            &read_to(&fixture(name), tip),
        );
        assert_eq!(fs::read_to_string(unchanged).unwrap(), original, "{name}");
        let out = written(
            folder.path(),
            &fixture(name),
            tip,
            &as_fitted(&fixture(name), tip),
        );
        let fitted = fs::read_to_string(out).unwrap();
        let is_new = |line: &&str| !original.lines().any(|known| known == *line);
        let numbers = [
            "<inertial",
            "<origin xyz",
            "<mass",
            "<inertia ",
            "<dynamics",
            "<joint name",
        ];
        for line in fitted.lines().filter(is_new) {
            assert!(
                numbers.iter().any(|tag| line.trim_start().starts_with(tag)),
                "{name}: {line}"
            );
        }
        let changed = |line: &&str| !fitted.lines().any(|kept| kept == *line);
        let kept = [
            "<!--", "<limit", "<geom", "<axis", "<default", "<motor", "<parent",
        ];
        for line in original.lines().filter(changed) {
            assert!(!kept.iter().any(|tag| line.contains(tag)), "{name}: {line}");
        }
    }
}

/// One link on one joint, lighter than the demo rig and without its friction.
const ROD: &str = r#"<?xml version="1.0"?>
<!-- From a drawing. -->
<robot name="rod">
  <link name="base"/>
  <joint name="pivot" type="continuous">
    <parent link="base"/> <child link="rod"/>
    <axis xyz="0 1 0"/>
  </joint>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 -0.3"/>
      <mass value="1.0"/>
      <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.001"/>
    </inertial>
  </link>
</robot>
"#;

#[test]
fn files_that_the_model_was_not_made_from_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let chain = read_to(&fixture("spatial_3r.urdf"), None);
    let model = folder.path().join("model.toml");
    fs::write(&model, model_text(&chain)).unwrap();
    let out = folder.path().join("out.urdf");
    let says = |file: &Path, part: &str| {
        let said = refuses(&[
            "export",
            "--model",
            text(&model),
            "--into",
            text(file),
            "--out",
            text(&out),
        ]);
        assert!(
            said.contains(part) && !out.exists(),
            "{part:?} is missing in:\n{said}"
        );
    };
    says(
        &fixture("planar_2r.urdf"),
        "has j1, j2, j3; give the file that the model was made from",
    );
    let original = fs::read_to_string(fixture("spatial_3r.urdf")).unwrap();
    let other = folder.path().join("other.urdf");
    fs::write(&other, original.replace("0.07 0.03 0.31", "0.07 0.03 0.32")).unwrap();
    says(&other, "its frames are not those of spatial_3R");
    fs::write(&other, "<svg/>").unwrap();
    says(
        &other,
        "the root element is <svg>; give a URDF (<robot>) or an MJCF (<mujoco>)",
    );
    let none = model_text(&chain).replace("zz_3 = { value = ", "zz_3 = { value = -");
    fs::write(&model, none.replace("positive = true", "positive = false")).unwrap();
    says(
        &fixture("spatial_3r.urdf"),
        "no physical bodies have the model's values: the logs do not determine them",
    );
    let both = residyn(&[
        "export", "--model", "pendulum", "--format", "urdf", "--into", "a.urdf", "--out", "b.urdf",
    ]);
    assert_eq!(both.status.code(), Some(2));
}

#[test]
fn what_the_format_cannot_hold_is_listed() {
    let file = fixture("spatial_3r.urdf");
    let effects = "\n[[effect]]\nname = \"rotor_inertia\"\njoint = 2\nJ = 0.01\n\n[[effect]]\nname = \"cogging_torque\"\njoint = 1\nA = 0.2\nN = 8\nphase = 0\n";
    let declared = model_text(&read_to(&file, None)) + effects;
    let model = Model::from_text(
        Path::new("model.toml"),
        &declared,
        Library::built_in().effects(),
    )
    .unwrap();
    let lost = write_back(&model, &file, None).unwrap().not_carried;
    assert_eq!(
        lost,
        [
            "rotor_inertia on joint 2: J = 0.01000",
            "cogging_torque on joint 1: A = 0.20000, N = 8.00000, phase = 0.00000"
        ]
    );
}

mod slow {
    use super::*;

    #[test]
    fn what_is_written_back_moves_like_the_model() {
        let folder = tempfile::tempdir().unwrap();
        for (name, tip) in FILES {
            let values = as_fitted(&fixture(name), tip);
            let out = written(folder.path(), &fixture(name), tip, &values);
            let again = read_to(&out, tip);
            for (again, wanted) in again.joints.iter().zip(&values.joints) {
                // In the model, a rotor may be part of its body's inertia; the motion decides, below.
                let [again_has, wanted_has] = [again, wanted].map(|joint| {
                    let has = &joint.drivetrain;
                    [has.damping, has.friction]
                });
                // The file has as many digits as people write.
                let is_same =
                    |(again, wanted): (f64, f64)| (again - wanted).abs() <= 1e-12 * wanted.abs();
                assert!(
                    again_has.into_iter().zip(wanted_has).all(is_same),
                    "{name}, {}: {again_has:?}, {wanted_has:?}",
                    wanted.name
                );
            }
            let [found, wanted] = [&again, &values].map(|chain| comparable(&system(chain)));
            let n = wanted.joints;
            for point in crate::support::catalogue::points(&wanted, 100, 5) {
                let moving = &point[..3 * n + 1];
                let rates = |model: &residyn_core::model::Dynamics| {
                    model.program.eval(&[moving, &model.values()].concat())
                };
                let size = rates(&wanted)[n..]
                    .iter()
                    .fold(0.0_f64, |most, rate| most.max(rate.abs()));
                for (found, wanted) in rates(&found).iter().zip(&rates(&wanted)).skip(n) {
                    assert!(
                        (found - wanted).abs() <= 1e-9 * size,
                        "{name}: {found} {wanted}"
                    );
                }
            }
            if values.joints.iter().all(|joint| joint.follows.is_none()) {
                mujoco_agrees(&out, &comparable(&system(&values)));
            }
        }
    }

    #[test]
    fn what_closing_the_loop_finds_is_in_the_description() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/demo.toml");
        for (log, seed) in [("1.csv", "1"), ("2.csv", "2"), ("3.csv", "3")] {
            succeeds(&[
                "simulate",
                "--plant",
                plant,
                "--seed",
                seed,
                "--out",
                text(&at(log)),
            ]);
        }
        fs::write(at("rod.urdf"), ROD).unwrap();
        succeeds(&[
            "new",
            "--from-urdf",
            text(&at("rod.urdf")),
            "--out",
            text(&at("rod.toml")),
        ]);
        let logs = ["1.csv", "2.csv", "3.csv"].map(at);
        succeeds(&[
            "closeloop",
            "--model",
            text(&at("rod.toml")),
            "--train",
            text(&logs[0]),
            text(&logs[1]),
            "--test",
            text(&logs[2]),
            "--out",
            text(&at("report")),
        ]);
        let model = at("report/model.toml");
        let out = at("fitted.urdf");
        succeeds(&[
            "export",
            "--model",
            text(&model),
            "--into",
            text(&at("rod.urdf")),
            "--out",
            text(&out),
        ]);
        assert_eq!(fs::read_to_string(at("rod.urdf")).unwrap(), ROD);
        let joint = &read_to(&out, None).joints[0];
        assert!(
            (joint.drivetrain.friction - 0.16).abs() < 0.0016,
            "{joint:?}"
        );
        // The values of configs/demo.toml: the inertia is 1 / C_i, the weight C_g / C_i.
        let (inertia, weight) = (
            joint.inertia.tensor[(2, 2)],
            9.81 * joint.inertia.moment.norm(),
        );
        assert!(
            (inertia * 4.6 - 1.0).abs() < 0.01 && (weight / 17.4 * 4.6 - 1.0).abs() < 0.01,
            "{joint:?}"
        );
        let library = Library::built_in();
        let fitted = comparable(&read_model(&model, &library).unwrap());
        let again = comparable(&system(&read_to(&out, None)));
        for (fitted, again) in fitted.values().iter().zip(&again.values()) {
            assert!(
                (fitted - again).abs() <= 1e-12 * fitted.abs(),
                "{fitted} {again}"
            );
        }
    }
}

//! A model's values, written back into the robot description that it was made from.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::Library;
use residyn::read_model;
use residyn_core::model::Model;
use residyn_core::model::tree::{Tree, model_text};
use residyn_formats::write_back;

use crate::support::catalogue::points;
use crate::support::mechanisms::{FILES, comparable, fixture, mujoco_agrees, read_to, system};
use crate::support::tables::rows;
use crate::support::{Scratch, replaced, says, succeeds, text};

/// The tree as a fit might find it: every body heavier and wider, more friction, and larger rotors if the format has
/// rotors.
fn as_fitted(file: &Path, tip: Option<&str>) -> Tree {
    let mut tree = read_to(file, tip);
    let has_rotors = file.extension().unwrap() == "xml";
    for (k, joint) in (1..).zip(&mut tree.joints) {
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
    tree
}

/// A description with these values, in a new file.
fn written(folder: &Path, file: &Path, tip: Option<&str>, values: &Tree) -> PathBuf {
    let model = folder.join("model.toml");
    fs::write(&model, model_text(values)).unwrap();
    let out = folder.join(file.file_name().unwrap());
    let into = ["export", "--model", text(&model), "--into", text(file)];
    let tip = tip.map_or(vec![], |tip| vec!["--tip", tip]);
    succeeds(&[&into[..], &["--out", text(&out)], &tip].concat());
    out
}

#[test]
fn nothing_else_in_the_file_changes() {
    let folder = tempfile::tempdir().unwrap();
    for (name, tip) in FILES {
        let file = fixture(name);
        let original = fs::read_to_string(&file).unwrap();
        let with = |values: &Tree| {
            let out = written(folder.path(), &file, tip, values);
            fs::read_to_string(out).unwrap()
        };
        assert_eq!(with(&read_to(&file, tip)), original, "{name}");
        let fitted = with(&as_fitted(&file, tip));
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

/// A model, the description that its values are to be written into, and words of the message.
const REFUSED: &str = "
fitted.toml   | $REPO/tests/fixtures/mechanisms/planar_2r.urdf  | has j1, j2, j3; give the file that the model was made from
fitted.toml   | moved.urdf | its frames are not those of spatial_3R
fitted.toml   | drawing.urdf | the root element is <svg>; give a URDF (<robot>) or an MJCF (<mujoco>)
negative.toml | $REPO/tests/fixtures/mechanisms/spatial_3r.urdf | no physical bodies have the model's values: the logs do not determine them
";

#[test]
fn files_that_the_model_was_not_made_from_are_refused() {
    let scratch = Scratch::new();
    let file = fixture("spatial_3r.urdf");
    let fitted = model_text(&read_to(&file, None));
    let negative = replaced(&fitted, "zz_3 = { value = ", "zz_3 = { value = -");
    let original = fs::read_to_string(&file).unwrap();
    scratch.file(
        "negative.toml",
        negative.replace("positive = true", "positive = false"),
    );
    scratch.file("fitted.toml", fitted);
    let moved = replaced(&original, "0.07 0.03 0.31", "0.07 0.03 0.32");
    scratch.file("moved.urdf", moved);
    scratch.file("drawing.urdf", "<svg/>");
    for [model, file, words] in rows(REFUSED) {
        let line = format!("export --model {model} --into {file} --out out.urdf");
        says(&scratch.refuses(&line), &[&words]);
    }
    scratch.refuses("export --model pendulum --format urdf --into a.urdf --out out.urdf");
    assert!(!scratch.has("out.urdf"));
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
            let [found, wanted] = [&again, &values].map(|tree| comparable(&system(tree)));
            let n = wanted.joints;
            for point in points(&wanted, 100, 5) {
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
        let scratch = Scratch::new();
        scratch.simulates("$REPO/configs/demo.toml", &[1, 2, 3]);
        // One link on one joint, lighter than the demo rig and without its friction.
        let rod = include_str!("fixtures/rod.urdf");
        scratch.file("rod.urdf", rod);
        scratch.succeeds("new --from-urdf rod.urdf --out rod.toml");
        let logs = "--train run1.csv run2.csv --test run3.csv";
        scratch.succeeds(&format!("closeloop --model rod.toml {logs} --out report"));
        scratch.succeeds("export --model report/model.toml --into rod.urdf --out fitted.urdf");
        assert_eq!(scratch.read("rod.urdf"), rod);
        let fitted = read_to(&scratch.path("fitted.urdf"), None);
        let joint = &fitted.joints[0];
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
        let model = read_model(scratch.path("report/model.toml"), &library).unwrap();
        let [wanted, again] = [model, system(&fitted)].map(|model| comparable(&model).values());
        for (wanted, again) in wanted.iter().zip(&again) {
            assert!(
                (wanted - again).abs() <= 1e-12 * wanted.abs(),
                "{wanted} {again}"
            );
        }
    }
}

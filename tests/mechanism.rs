//! Model files derived from robot descriptions.

use std::fs;

use residyn_core::expr::SignForm;
use residyn_core::model::Dynamics;
use residyn_core::model::tree::{Tree, model_text};

use crate::support::catalogue::{assert_energy_balanced, dynamics, points};
use crate::support::mechanisms::{
    FILES, comparable, fixture, format_of, mujoco_agrees, read, read_to, system,
};
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, replaced, says};

/// Every joint of these moves on its own.
fn independent() -> impl Iterator<Item = &'static str> {
    let alone = FILES.into_iter().filter(|(_, tip)| tip.is_none());
    alone.map(|(name, _)| name)
}

fn tree(name: &str) -> Tree {
    read(&fixture(name))
}

/// Positions, velocities, torques, time, and the parameters at their values.
fn states(model: &Dynamics, count: usize) -> Vec<Vec<f64>> {
    let moving = 3 * model.joints + 1;
    let with_values = |point: Vec<f64>| [&point[..moving], &model.values()].concat();
    points(model, count, 3)
        .into_iter()
        .map(with_values)
        .collect()
}

/// Also if a joint follows another.
#[test]
fn energy_changes_by_the_power() {
    for (name, tip) in FILES {
        let system = system(&read_to(&fixture(name), tip));
        let model = dynamics(&system, &[], SignForm::Exact);
        let energy = system.energy_program().unwrap();
        // Coefficients are rounded to 15 digits.
        assert_energy_balanced(&model, &energy, &states(&model, 200), 1e-12);
    }
}

/// The mass matrix at a point, the inverse of the accelerations by unit torques.
fn inverse_mass(model: &Dynamics, point: &[f64]) -> nalgebra::DMatrix<f64> {
    let n = model.joints;
    let accelerations = |torque: Option<usize>| {
        let mut point = point.to_vec();
        point[2 * n..3 * n].fill(0.0);
        if let Some(joint) = torque {
            point[2 * n + joint] = 1.0;
        }
        model.program.eval(&point)[n..].to_vec()
    };
    let free = accelerations(None);
    nalgebra::DMatrix::from_fn(n, n, |i, j| accelerations(Some(j))[i] - free[i])
}

#[test]
fn the_mass_matrix_is_symmetric_and_positive() {
    for name in independent() {
        let model = dynamics(&system(&tree(name)), &[], SignForm::Exact);
        for mut point in states(&model, 100) {
            point[model.joints..2 * model.joints].fill(0.0);
            let inverse = inverse_mass(&model, &point);
            let off = (&inverse - inverse.transpose()).norm();
            assert!(off <= 1e-12 * inverse.norm(), "{name}: {off:e}");
            let eigenvalues = inverse.symmetric_eigenvalues();
            assert!(eigenvalues.min() > 0.0, "{name}: {eigenvalues}");
        }
    }
}

/// A change of one parameter cannot be compensated by the others: the derivatives of the torques are independent.
#[test]
fn base_parameters_are_linearly_independent() {
    for name in independent() {
        let system = system(&tree(name));
        let model = comparable(&system);
        let n = model.joints;
        let values = model.values();
        let free: Vec<usize> = (0..values.len())
            .filter(|k| !model.parameters[*k].fixed)
            .collect();
        let states = states(&model, 100);
        let torque_change = |k: usize| {
            let step = 1e-4 * model.parameters[k].scale;
            let changes = states.iter().flat_map(|state| {
                let at = |sign: f64| {
                    let mut point = state.clone();
                    point[3 * n + 1 + k] += sign * step;
                    model.program.eval(&point)[n..].to_vec()
                };
                let slopes: Vec<f64> = (at(1.0).iter().zip(at(-1.0))).map(|(a, b)| a - b).collect();
                // In torques, which are linear in the parameters.
                let mass = inverse_mass(&model, state).try_inverse().unwrap();
                (mass * nalgebra::DVector::from_vec(slopes))
                    .iter()
                    .copied()
                    .collect::<Vec<f64>>()
            });
            nalgebra::DVector::from_iterator(states.len() * n, changes).normalize()
        };
        let columns: Vec<_> = free.iter().map(|k| torque_change(*k)).collect();
        let singular = nalgebra::DMatrix::from_columns(&columns).singular_values();
        assert!(singular.min() > 1e-3, "{name}: {singular}");
    }
}

#[test]
fn a_planar_arm_has_the_parameters_of_a_textbook() {
    let tree = tree("planar_2r.urdf");
    let system = system(&tree);
    let names: Vec<&str> = system.parameters.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["zz_1", "mx_1", "zz_2", "mx_2", "g"]);
    let value = |k: usize| system.parameters[k].value;
    let (m_1, m_2, l) = (1.5, 0.8, 0.6);
    let wanted = [
        0.04 + m_1 * 0.25 * 0.25 + m_2 * l * l,
        -(m_1 * 0.25 + m_2 * l),
        0.02 + m_2 * 0.2 * 0.2,
        -m_2 * 0.2,
    ];
    for (k, wanted) in wanted.into_iter().enumerate() {
        assert!((value(k) - wanted).abs() < 1e-14, "{}", names[k]);
    }
    let text = model_text(&tree);
    assert!(
        text.contains("M11 = \"zz_1 + zz_2 - 1.2*mx_2*cos(q2)\""),
        "{text}"
    );
}

#[test]
fn properties_that_are_not_carried_are_noted() {
    let notes = tree("prr.xml").notes;
    assert_eq!(
        notes,
        [
            "line 20: `belt` has the gear 20: tau is the torque or force at `rail`, 20 times the control",
            "line 21: `ctrlrange` from -3 to 2 is not symmetric and is not carried",
        ]
    );
    let output = Scratch::new().run("new --from-mjcf $REPO/tests/fixtures/mechanisms/geoms.xml");
    let said = String::from_utf8(output.stderr).unwrap();
    says(&said, &["note: line 20: contacts are not carried\n"]);
}

#[test]
fn new_writes_a_model_file_that_other_commands_read() {
    let scratch = Scratch::new();
    let new = "new --from-urdf $REPO/tests/fixtures/mechanisms/planar_2r.urdf";
    let said = scratch.succeeds(&format!("{new} --out arm.toml"));
    let end = "arm.toml: model of planar_2r, joints: 2\n";
    assert!(said.ends_with(end), "{said}");
    let value = scratch.json(new);
    assert_eq!(value["joints"], 2);
    assert_eq!(value["model"], scratch.read("arm.toml"));
    assert_eq!(value["notes"].as_array().unwrap().len(), 2);
    scratch.succeeds("simulate --plant arm.toml --duration 3 --out log.csv");
    scratch.succeeds("evaluate --model arm.toml --test log.csv");
}

/// A fixture, one of its texts, what stands there instead, and words of the message.
const REFUSED: &str = r#"
planar_2r.urdf | type="continuous"       | type="planar"                      | planar_2r.urdf, line 20, column 29 ... `elbow` ... `planar` ... fix the joint
planar_2r.urdf | <limit lower            | <mimic joint="elbo"/><limit lower  | line 5, column 3 ... `shoulder` follows `elbo` ... fix the joint
planar_2r.urdf | <parent link="upper"/>  | <parent link="uper"/>              | line 21, column 19 ... no link `uper`
planar_2r.urdf | <child link="fore"/>    | <child link="upper"/>              | line 20, column 3 ... closes a loop ... open the loop
planar_2r.urdf | <child link="upper"/>   | <child link="base"/>               | loop
planar_2r.urdf | </robot>                | <link name="x"/></robot>           | line 34 ... second link
planar_2r.urdf | value="0.8"             | value="${m}"                       | line 30, column 20 ... not a number ... xacro
planar_2r.urdf | value="0.8"             | value="-0.8"                       | line 31 ... mass of `fore` ... above zero
planar_2r.urdf | izz="0.001"             | izz="0.1"                          | line 31 ... `fore` ... sum of the others
planar_2r.urdf | xyz="0 1 0"             | xyz="0 1"                          | line 9, column 16 ... takes 3 numbers, found 2
planar_2r.urdf | damping="0.02"          | damping="-1"                       | line 25, column 24 ... give zero or a positive number
planar_2r.urdf | </robot>                |                                    | not valid XML
prr.xml        | type="slide"            | type="ball"                        | prr.xml, line 7 ... `ball` ... hinge and slide
prr.xml        | armature="0.003"/>\n          <inertial pos="0 0 -0.2" mass="0.3" diaginertia="0.006 0.006 0.0004" xyaxes="1 0.1 0 0 1 0.3"/> | /> | line 13 ... `end` moves nothing that has inertia ... <inertial>
prr.xml        | stiffness="1.5"         | stiffness="1 2"                    | line 10 ... polynomial
prr.xml        | <actuator>              | <equality><joint joint1="end"/></equality><actuator> | line 19 ... closes a loop ... remove
geoms.xml      | type="ellipsoid"        | type="mesh"                        | line 29 ... mesh ... <inertial> in body `hand`
geoms.xml      | class="main"            | class="mein"                       | line 22 ... no default class `mein`
geoms.xml      | autolimits="true"       | boundmass="1"                      | line 3 ... `boundmass ... give the masses
geoms.xml      | <option                 | <option><flag damper="disable"/></option><option | line 4 ... `damper` is switched off
geoms.xml      | zaxis="0.1 0.2 1"       | zaxis="0.1 0.2 1" euler="0 0 1"    | line 21 ... second orientation
"#;

#[test]
fn floating_bases_are_fixed_with_a_note() {
    for (name, from, to, joints, note) in [
        (
            "planar_2r.urdf",
            "type=\"continuous\"",
            "type=\"floating\"",
            1,
            "line 20: `elbow` floats; its child is fixed where the file draws it",
        ),
        (
            "prr.xml",
            "<joint name=\"rail\"",
            "<freejoint/><joint name=\"rail\"",
            3,
            "line 7: this body is free to move in the file; it is fixed where the file draws it",
        ),
    ] {
        let scratch = Scratch::new();
        let contents = fs::read_to_string(fixture(name)).unwrap();
        scratch.file(name, replaced(&contents, from, to));
        let format = format_of(&fixture(name)).name;
        let value = scratch.json(&format!("new --from-{format} {name}"));
        let notes: Vec<&str> = value["notes"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|n| n.as_str())
            .collect();
        assert!(notes.contains(&note), "{notes:?}");
        let fixed = system(&read(&scratch.path(name)));
        assert_eq!(fixed.joints, joints, "{name}");
    }
}

#[test]
fn anything_but_a_tree_of_joints_is_refused_with_place_and_remedy() {
    for [name, from, to, words] in rows(REFUSED) {
        let scratch = Scratch::new();
        let contents = fs::read_to_string(fixture(&name)).unwrap();
        scratch.file(&name, replaced(&contents, &from, &to));
        let format = format_of(&fixture(&name)).name;
        let line = format!("new --from-{format} {name} --out model.toml");
        says_words(&scratch.refuses(&line), &words);
        assert!(!scratch.has("model.toml"), "a file was left behind");
    }
}

/// Commands, and words of their messages.
const COMMANDS: &str = "
new --from-urdf $REPO/tests/fixtures/mechanisms/rp.xml | this is MJCF, read it as mjcf
new --from-urdf nowhere.urdf                           | nowhere.urdf: cannot be read
new                                                    | --from-urdf ... --from-mjcf
";

#[test]
fn a_file_of_the_other_format_is_recognised() {
    for [line, words] in rows(COMMANDS) {
        says_words(&Scratch::new().refuses(&line), &words);
    }
}

#[test]
fn angles_that_were_rounded_are_taken_as_written_and_noted() {
    let notes = tree("rounded_2r.urdf").notes;
    let note = "line 23: `rpy`: 1.5708 is taken as written; if 1.5707963267948966 is meant, writing it so makes shorter equations";
    assert!(notes.contains(&note.to_owned()), "{notes:?}");
    let scratch = Scratch::new();
    let contents = fs::read_to_string(fixture("rounded_2r.urdf")).unwrap();
    scratch.file("exact.urdf", contents.replacen("1.5708", "1.5707963268", 1));
    let text = model_text(&read(&scratch.path("exact.urdf")));
    says(&text, &["M11 = \"zz_1 + zz_2 + 1.2*mx_2*sin(q2)\""]);
}

mod slow {
    use super::*;

    #[test]
    fn mujoco_finds_the_same_torques() {
        for name in independent() {
            mujoco_agrees(&fixture(name), &comparable(&system(&tree(name))));
        }
    }
}

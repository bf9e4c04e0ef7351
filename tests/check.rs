//! What `residyn check` finds in model files, and that it finds nothing in the shipped ones.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::with_effects_in;
use residyn::{Library, Model, rng};
use residyn_core::data::Joint;
use residyn_core::model::FittedEffect;
use residyn_core::model::check::{Check, Finding, Severity};
use serde_json::Value;

use crate::support::paths::ours;
use crate::support::tables::rows;
use crate::support::{Scratch, replaced, says, succeeds, text};

fn check(file: &str) -> Check {
    let library = Library::built_in();
    let model = Model::from_text(Path::new("broken.toml"), file, library.effects()).unwrap();
    model.check(&mut rng(0))
}

/// Every TOML file in a folder of the project that describes a system.
fn shipped(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(ours(folder)).unwrap();
    let files = entries.map(|entry| entry.unwrap().path());
    let is_model =
        |path: &PathBuf| path.is_file() && fs::read_to_string(path).unwrap().contains("[system]");
    files.filter(is_model).collect()
}

#[test]
fn shipped_models_are_clean() {
    let folders = ["models", "docs/rigs", "configs/bench"];
    let files: Vec<PathBuf> = folders.into_iter().flat_map(shipped).collect();
    assert!(files.len() >= 14, "{files:?}");
    let models: Vec<&str> = files.iter().map(|file| text(file)).collect();
    let said = succeeds(&[&["check"], models.as_slice()].concat());
    assert_eq!(said.matches("no findings").count(), files.len(), "{said}");
}

#[test]
fn models_made_from_a_robot_description_are_clean() {
    let scratch = Scratch::new();
    for (arm, format) in [
        ("spatial_3r.urdf", "urdf"),
        ("planar_2r.urdf", "urdf"),
        ("prr.xml", "mjcf"),
    ] {
        let file = format!("$REPO/tests/fixtures/mechanisms/{arm}");
        scratch.succeeds(&format!("new --from-{format} {file} --out {arm}.toml"));
        scratch.succeeds(&format!("check {arm}.toml"));
    }
}

#[test]
fn the_units_of_all_effects_fit() {
    let library = Library::built_in();
    let cartpole = library.model("cartpole").unwrap();
    for effect in library.effects() {
        let effects = vec![FittedEffect::absent(effect, Joint::at(0))];
        let found = cartpole.with_effects(effects).check(&mut rng(0)).findings;
        assert!(found.is_empty(), "{found:?}");
    }
}

/// A built-in model, one of its texts, what stands there instead, and the finding: kind, line, and words.
const BROKEN: &str = r#"
acrobot  | g = {             | h = { value = 1.0 }\ng = {          | Unused | 14 | no equation uses `h`
acrobot  | S2 =              | half = "0.5*d1"\nS2 =              | Unused | 19 | no equation uses `half`
drive    | "m"               | "1"                                | Unused | 8  | only [energy] uses `m`
pendulum | + C_i * tau1      |                                    | Input  | 11 | no acceleration uses `tau1`
servo    | (cmd1 - q1)       | (-q1)                              | Input  | 14 | no formula of [drive] uses `cmd1`
acrobot  | ["d2", "m2        | ["d1", "m2                         | Mass   | 23 | is not symmetric
acrobot  | "m2*lc2^2 + I2"]  | "m2*lc2^2 - I2"]                   | Mass   | 23 | is not positive definite: its smallest eigenvalue is -
acrobot  | ["d2", "m2*lc2^2 + I2"] | ["d2", "d2^2/d1"]            | Mass   | 23 | is singular: its smallest eigenvalue is
acrobot  | "m2*lc2^2 + I2"]  | "I2/(q1 + q2)"]                    | Mass   | 23 | has an entry that is not a number, at q1 = 0.0000, q2 = 0.0000
acrobot  | (qd2 + 2*qd1)     | (qd2 - 2*qd1)                      | Power  | 24 | the velocity-product terms of `bias` take
acrobot  | m1*lc1^2 +        | m1*lc1 +                           | Units  | 17 | `m1*lc1` [kg m] and `m2*(l1^2
servo    | G*sin(q1)"]       | G*sin(q1)/kd"]                     | Units  | 18 | entry 1 of `bias` is `G*sin(q1)/kd` [1/s], but should be in [N m]
pendulum | "1/(kg m^2)"      | "1/kg"                             | Units  | 11 | `C_g * sin(q1)` [1/s^2] and `C_i * tau1` [m^2/s^2] cannot be added or compared
drive    | "kg"              | "lb"                               | Units  | 8  | the unit `lb` of `m` is not
drive    | [dynamics]        | sign = { value = 1.0 }\n[dynamics] | Name   | 10 | `sign` is also a function
drive    | [dynamics]        | tau2 = { value = 1.0 }\n[dynamics] | Name   | 10 | `tau2` reads like a quantity of a joint
"#;

#[test]
fn what_is_broken_is_found_with_its_line() {
    for [model, from, to, kind, line, words] in rows(BROKEN) {
        let file = Library::system_text(&model).unwrap();
        let found = check(&replaced(file, &from, &to)).findings;
        let is_kind = |finding: &Finding| format!("{:?}", finding.kind) == kind;
        let mut of_kind = found.iter().filter(|finding| is_kind(finding));
        let finding = of_kind.find(|finding| finding.text.contains(&words));
        let finding = finding.unwrap_or_else(|| panic!("{words}: {found:?}"));
        assert_eq!(finding.line, Some(line.parse().unwrap()), "{finding:?}");
        let is_error = finding.severity == Severity::Error;
        assert_eq!(is_error, kind == "Mass", "{finding:?}");
    }
}

#[test]
fn parameters_of_effects_are_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let effect = "[effect]\nname = \"drag\"\nabout = \"drag\"\nforce = \"-c*qd*abs(qd)*sin(q)\"\n\
        [parameters]\nc = { unit = \"N m\", typical = 1 }\nq = { unit = \"1\", typical = 1 }\nd = { unit = \"1\", typical = 1 }\n";
    fs::write(folder.path().join("drag.toml"), effect).unwrap();
    let library = with_effects_in(folder.path(), Library::built_in()).unwrap();
    let drive = Library::system_text("drive").unwrap();
    let with = format!("{drive}\n[[effect]]\nname = \"drag\"\njoint = 1\nc = 1\nq = 1\nd = 1\n");
    let with = with.replace("[dynamics]", "c1 = { value = 1.0 }\n[dynamics]");
    let model = Model::from_text(Path::new("rig.toml"), &with, library.effects()).unwrap();
    let found = model.check(&mut rng(0)).findings;
    for words in [
        "the formula of drag does not use its parameter `d`",
        "the formula of drag is `-c*qd*abs(qd)*sin(q)` [kg m^2/s^4], but should be in [N m]",
        "the parameter `q` of drag hides the quantity that formulas know by that name",
        "`c1` is already declared, so this parameter of drag on joint 1 is called `drag_c1`",
    ] {
        let says = |finding: &Finding| finding.text.contains(words);
        assert!(found.iter().any(says), "{words}: {found:?}");
    }
}

#[test]
fn the_exit_status_says_whether_something_was_found() {
    let scratch = Scratch::new();
    let drive = Library::system_text("drive").unwrap();
    scratch.file("rig.toml", drive.replace("\"kg\"", "\"lb\""));
    let found = |line: &str| {
        let output = scratch.run(line);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stdout).unwrap()
    };
    let said = found("check pendulum rig.toml");
    let is_narrow = said.lines().all(|line| line.chars().count() <= 80);
    assert!(is_narrow, "{said}");
    says(&said, &["warning  line 8: the unit `lb`"]);
    let value: Value = serde_json::from_str(&found("check --json rig.toml")).unwrap();
    assert_eq!(value[0]["model"], "rig.toml");
    let finding = &value[0]["findings"][0];
    assert_eq!(finding["kind"], "units");
    assert_eq!(finding["severity"], "warning");
    scratch.file("rig.toml", drive.replace("value = 1.0", "value = -1.0"));
    let said = scratch.refuses("check rig.toml");
    says(&said, &["rig.toml, line 8", "outside its bounds"]);
}

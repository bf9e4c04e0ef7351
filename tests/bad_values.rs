//! No input breaks the program: input that is too deep, too large or endless is refused at once, with the limit and the
//! place, and numbers that cease to be finite are reported.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::support::exported_models::{CHECKPOINT, exported};
use crate::support::paths::ours;
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, copy_files, says, swinging, until_there};

/// A pendulum that gives a mass and a bias, so that its motion is compared through its torques.
const ROD: &str = include_str!("fixtures/rod.toml");

#[test]
fn logs_without_motion_get_an_answer() {
    let scratch = Scratch::new();
    scratch.log("zeros.csv", |_| [0.0; 3]);
    scratch.log("rest.csv", |_| [0.3, 0.0, 0.0]);
    scratch.log("pushed.csv", |time| [0.0, 0.0, 0.01 * time.sin()]);
    scratch.file("rod.toml", ROD);
    scratch.succeeds("new --from-urdf $REPO/tests/fixtures/rod.urdf --out chain.toml");
    for model in ["pendulum", "rod.toml", "chain.toml"] {
        for log in ["zeros.csv", "rest.csv", "pushed.csv"] {
            let line = format!("closeloop --model {model} --train {log} --out out");
            let said = scratch.answers(&line);
            assert!(said.contains("no joint moves visibly"), "{line}: {said}");
        }
    }
}

#[test]
fn a_model_of_more_parameters_than_can_be_fitted_is_refused() {
    let scratch = Scratch::new();
    let (mut bias, mut declared) = ("G * sin(q1)".to_owned(), String::new());
    for k in 1..=600 {
        write!(bias, " + b{k} * sin({k} * q1)").unwrap();
        writeln!(declared, "b{k} = {{ value = 0.01 }}").unwrap();
    }
    let text = ROD
        .replace("G * sin(q1)", &bias)
        .replace("[dynamics]", &format!("{declared}\n[dynamics]"));
    scratch.file("sines.toml", text);
    scratch.log("log.csv", swinging);
    let message = scratch.refuses("closeloop --model sines.toml --train log.csv --out out");
    says(
        &message,
        &[
            "note: ",
            "grows with the cube",
            "rod has 602 free parameters",
            "at most 500",
            "`fixed = true`",
        ],
    );
}

#[test]
fn a_log_in_which_one_joint_of_two_rests_gets_an_answer() {
    let scratch = Scratch::new();
    let mut log = "time,q1,q2,qd1,qd2,tau1,tau2\n".to_owned();
    for row in 0..300 {
        let time = 0.01 * f64::from(row);
        let [q, qd, tau] = swinging(time);
        writeln!(log, "{time:?},{q:?},0,{qd:?},0,{tau:?},0").unwrap();
    }
    scratch.file("log.csv", log);
    let line = "closeloop --budget 0s --model acrobot --train log.csv --out out";
    says(&scratch.answers(line), &["joint 2, 0.5 s ahead"]);
}

#[test]
fn a_reading_that_no_sensor_has_is_refused_with_its_place() {
    let scratch = Scratch::new();
    for (channel, name) in ["q1", "qd1", "tau1"].into_iter().enumerate() {
        scratch.log("log.csv", |time| {
            let mut row = swinging(time);
            if (time - 1.0).abs() < 0.001 {
                row[channel] = 1e300;
            }
            row
        });
        let message = scratch.refuses("evaluate --model pendulum --test log.csv");
        says(
            &message,
            &["log.csv, line 102", name, "1e300 is beyond 1e30"],
        );
    }
}

#[test]
#[cfg(unix)]
fn formulas_that_are_too_deep_or_too_long_are_refused() {
    let scratch = Scratch::new();
    let nested = |open: &str, times: usize, close: &str| {
        let (open, close) = (open.repeat(times), close.repeat(times));
        format!("{open}q1{close}")
    };
    let sum = vec!["sin(q1)"; 300].join(" + ");
    let product = vec![format!("({sum})"); 40].join(" * ");
    for (formula, words) in [
        (
            nested("(", 10_000, ")"),
            "column 8 ... more than 200 parentheses",
        ),
        (
            nested("-", 100_000, ""),
            "column 8 ... more than 200 parentheses",
        ),
        (
            nested("q1^", 20_000, ""),
            "column 8 ... more than 200 parentheses",
        ),
        (
            nested("sin(", 5_000, ")"),
            "column 8 ... more than 200 parentheses",
        ),
        (
            nested("+", 1_000_000, ""),
            "column 8 ... more than 200 parentheses",
        ),
        (
            nested("q1 + ", 200_000, ""),
            "column 8 ... more than 1000 operations",
        ),
        ("a".repeat(1_000_000), "column 8 ... unknown name `aaa"),
        (product, "more than 20000 numbers"),
    ] {
        scratch.moving_by("model.toml", &formula);
        let message = scratch.refuses_in_little_memory("check model.toml");
        says(&message, &["model.toml, line 11"]);
        says_words(&message, words);
    }
}

/// Files with too much of something, the command that reads each, and words of its message.
#[test]
#[cfg(unix)]
fn files_with_too_much_of_anything_are_refused() {
    let scratch = Scratch::new();
    let many = |line: fn(usize) -> String| (0..20_000).map(line).collect::<String>();
    let parameters = many(|k| format!("p{k} = {{ value = 1.0 }}\n"));
    let parameters = format!("[parameters]\n{parameters}");
    scratch.model("many.toml", "[parameters]", &parameters);
    let lets = many(|k| format!("x{k} = \"sin(q1)\"\n"));
    let lets = format!("[dynamics.let]\n{lets}\n[energy]");
    scratch.model("lets.toml", "[energy]", &lets);
    scratch.file("long.toml", vec![b'#'; 5 << 20]);
    let header = |count: usize, name: &str| {
        let names: Vec<String> = (0..count).map(|k| format!("{name}{k}")).collect();
        names.join(",") + "\n"
    };
    scratch.file("wide.csv", header(100_000, "q"));
    scratch.file("unknown.csv", header(4000, "column"));
    let bodies = "<body>".repeat(60_000) + &"</body>".repeat(60_000);
    let deep = format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
    scratch.file("deep.xml", deep);
    let defaults = "<geom size='1'/>".repeat(201);
    let defaults = format!("<mujoco><default>{defaults}</default></mujoco>");
    scratch.file("defaults.xml", defaults);
    // A schema of one column whose group claims 2^31 - 1 of them.
    let schema = b"\x15\x02\x19\x2c\x48\x01r\x15\xfe\xff\xff\xff\x0f\x00\x15\x0a\x38\x01q\x00";
    let footer = [&schema[..], b"\x16\x00\x19\x0c\x00"].concat();
    let length = u32::try_from(footer.len()).unwrap().to_le_bytes();
    let claims = [b"PAR1", &footer[..], &length, b"PAR1"].concat();
    scratch.file("claims.parquet", claims);
    for [line, words] in rows(
        "check many.toml             | line  ... entries; at most 1000 are read
         check lets.toml             | line  ... entries; at most 1000 are read
         check long.toml             | long.toml ... more than 4 MB
         audit wide.csv              | wide.csv ... 100000 columns; at most 4096
         audit claims.parquet        | claims.parquet ... claims 2147483647 columns and groups, and describes 2
         audit unknown.csv           | column39 and 3960 more
         new --from-mjcf deep.xml    | deep.xml, line 1 ... more than 200 elements
         new --from-mjcf defaults.xml | defaults.xml, line 1 ... more than 200 elements",
    ) {
        says_words(&scratch.refuses_in_little_memory(&line), &words);
    }
}

/// A text of a recipe, what stands there instead, and words of the message.
const RECIPES: &str = r#"
hidden = [16, 16, 16] | hidden = [1000000]              | train-pendulum.toml ... from 1 to 4096
hidden = [16, 16, 16] | hidden = [0]                    | from 1 to 4096
hidden = [16, 16, 16] | hidden = [4096, 4096, 4096]     | at most 20000000
trajectories = 100    | trajectories = 100000000000     | train-pendulum.toml ... at most 10000000 are sampled
epochs = 200          | epochs = 1000000000000          | at most 100000000
step_s = 0.02         | step_s = nan                    | train-pendulum.toml ... line ... nan
step_s = 0.02         | step_s = inf                    | train-pendulum.toml ... line ... inf
step_s = 0.02         | step_s = 1e999                  | train-pendulum.toml ... line ... 1e999
"#;

/// Commands, and words of their messages.
const COMMANDS: &str = r"
evaluate --model pendulum --test log.csv --horizon 1e-9     | --horizon 1e-9 ... a row every 1.00e-2 s
simulate --plant pendulum --out out --duration 1e9          | --duration ... two to 10000000 rows
simulate --plant pendulum --out out --duration 1e300        | --duration ... two to 10000000 rows
sweep --config $REPO/configs/smoke/train-pendulum.toml --out out --seeds 100000000000 | from 1 to 100000
closeloop --out out --calibrate 100000000000                | from 1 to 100000
closeloop --out out --calibrate 0                           | --calibrate
control --model pendulum --plant pendulum-sim --episodes 100000000000 | from 1 to 100000
evaluate --model pendulum --test - | -: ... standard input is not read ... write it to a file
";

#[test]
#[cfg(unix)]
fn more_than_any_machine_could_do_is_refused_before_it_is_begun() {
    let scratch = Scratch::new();
    scratch.log("log.csv", swinging);
    for [from, to, words] in rows(RECIPES) {
        scratch.changed("smoke/train-pendulum.toml", &from, &to);
        let line = "train --config train-pendulum.toml --out out";
        says_words(&scratch.refuses_in_little_memory(line), &words);
    }
    for [line, words] in rows(COMMANDS) {
        says_words(&scratch.refuses_in_little_memory(&line), &words);
    }
    assert!(!scratch.has("out"));
}

#[test]
fn a_training_that_leaves_the_finite_numbers_or_makes_it_worse_says_so() {
    let scratch = Scratch::new();
    for (rate, words) in [
        (
            "1e9",
            "the loss became ... in epoch ... C_g = ... lower the learning rates",
        ),
        (
            "100",
            "made the prediction error larger ... lower the learning rates",
        ),
    ] {
        let usual = "learning_rates = { physics = 0.01, residual = 0.01 }";
        let rates = format!("learning_rates = {{ physics = 0.01, residual = {rate} }}");
        scratch.changed("smoke/train-pendulum.toml", usual, &rates);
        let line = format!("train --config train-pendulum.toml --out {rate}");
        says_words(&scratch.ends_without(&line), words);
    }
}

/// A text of the pendulum's model file, what stands there instead, and words of the message.
const MODELS: &str = r#"
value = 15.0 | value = nan                                  | line 7, column 17 ... not a finite number
value = 15.0 | value = inf                                  | line 7, column 17 ... not a finite number
value = 15.0 | value = 1e999                                | line 7, column 17 ... not a finite number
value = 15.0 | value = 99999999999999999999                 | line 7 ... a decimal number
joints = 1   | joints = 50                                  | line 4 ... `joints` must be from 1 to 40, found 50
joints = 1   | joints = 1000000000                          | line 4 ... `joints` must be from 1 to 40, found 1000000000
sin(q1) + C_i * tau1 | 1e999 * tau1                         | line 11 ... `1e999` is not a number
[parameters] | [parameters]\n"a b" = { value = 1.0 }        | line 7 ... cannot be used in formulas
[parameters] | [parameters]\n"" = { value = 1.0 }           | line 7 ... cannot be used in formulas
[parameters] | [parameters]\n"(" = { value = 1.0 }          | line 7 ... cannot be used in formulas
[parameters] | [parameters]\n"1" = { value = 1.0 }          | line 7 ... cannot be used in formulas
[parameters] | [parameters]\n"a\u200b" = { value = 1.0 }    | line 7 ... cannot be used in formulas
[energy]     | [dynamics.let]\na = "2 * b"\nb = "c + q1"\nc = "sin(a)"\n\n[energy] | line 14 ... defined in terms of itself ... a -> b -> c -> a
[energy]     | [dynamics.let]\na = "a + q1"\n\n[energy]     | line 14 ... defined in terms of itself ... a -> a
"#;

#[test]
fn models_whose_numbers_names_or_definitions_cannot_be_used_are_refused_with_the_place() {
    let scratch = Scratch::new();
    for [from, to, words] in rows(MODELS) {
        scratch.model("model.toml", &from, &to);
        let message = scratch.refuses("check model.toml");
        says(&message, &["model.toml, line"]);
        says_words(&message, &words);
    }
}

#[test]
#[cfg(unix)]
fn a_description_names_no_file_but_the_one_beside_it() {
    use std::os::unix::fs::symlink;

    let scratch = Scratch::new();
    copy_files(exported(), scratch.folder());
    let said = scratch.read_json("model.json");
    fs::create_dir(scratch.path("sub")).unwrap();
    symlink("../model.safetensors", scratch.path("sub/link.safetensors")).unwrap();
    symlink("/dev/zero", scratch.path("sub/endless.safetensors")).unwrap();
    for weights in [
        "../model.safetensors",
        "/dev/zero",
        "link.safetensors",
        "endless.safetensors",
        "..",
        "",
    ] {
        let mut other = said.clone();
        other["weights"] = weights.into();
        scratch.file("sub/model.json", other.to_string());
        let message = scratch.refuses_in_little_memory("import --file sub/model.json --out out");
        says(&message, &["sub/model.json", "in another folder"]);
    }
    scratch.succeeds("import --file model.json --out out");
}

/// A path from the user may be a link, but it must be finite.
#[test]
#[cfg(unix)]
fn the_files_of_a_checkpoint_are_finite() {
    let scratch = Scratch::new();
    scratch.log("log.csv", swinging);
    copy_files(&ours(CHECKPOINT), &scratch.path("checkpoint"));
    for name in ["weights.safetensors", "model.toml", "checkpoint.json"] {
        let path = scratch.path("checkpoint").join(name);
        fs::rename(&path, scratch.path("kept")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
        let line = "evaluate --checkpoint checkpoint --test log.csv";
        let message = scratch.refuses_in_little_memory(line);
        says(&message, &[name, "a device or a pipe, not a regular file"]);
        fs::remove_file(&path).unwrap();
        fs::rename(scratch.path("kept"), &path).unwrap();
    }
}

#[test]
fn a_description_of_other_joints_is_refused() {
    let scratch = Scratch::new();
    copy_files(exported(), scratch.folder());
    let mut said = scratch.read_json("model.json");
    for joints in [50_u64, 1_000_000_000] {
        said["joints"] = joints.into();
        scratch.file("model.json", said.to_string());
        let message = scratch.refuses("import --file model.json --out out");
        let expected = format!("`joints` is {joints}, its model file has 1");
        says(&message, &["model.json", &expected]);
    }
}

#[test]
#[cfg(unix)]
fn what_never_begins_or_never_ends_is_no_input() {
    let scratch = Scratch::new();
    let made = Command::new("mkfifo")
        .arg(scratch.path("pipe.csv"))
        .status();
    assert!(made.unwrap().success());
    for file in ["pipe.csv", "/dev/zero"] {
        for command in [
            "audit FILE",
            "check FILE",
            "closeloop --model pendulum --train FILE --out out",
            "evaluate --model FILE --test FILE",
            "train --config FILE --out out",
            "new --from-urdf FILE",
            "import --file FILE --out out",
        ] {
            let message = scratch.refuses_in_little_memory(&command.replace("FILE", file));
            says(&message, &[file, "a device or a pipe, not a regular file"]);
        }
    }
}

/// A file with `part` repeated up to this many MB, packed with gzip after a header.
fn packed(header: &str, part: &str, megabytes: usize) -> Vec<u8> {
    let level = flate2::Compression::fast();
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), level);
    packer.write_all(header.as_bytes()).unwrap();
    let block = part.repeat((1 << 20) / part.len());
    (0..megabytes).for_each(|_| packer.write_all(block.as_bytes()).unwrap());
    packer.finish().unwrap()
}

/// An archive with arrays of this many MB, one byte per number.
fn archive_of_bytes(megabytes: usize) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let zeros = vec![0; 1 << 20];
    for name in ["q.npy", "time.npy"] {
        let described = format!(
            "{{'descr': '|u1', 'fortran_order': False, 'shape': ({},), }}",
            megabytes << 20
        );
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(b"\x93NUMPY\x01\0").unwrap();
        let length = u16::try_from(described.len()).unwrap().to_le_bytes();
        archive.write_all(&length).unwrap();
        archive.write_all(described.as_bytes()).unwrap();
        (0..megabytes).for_each(|_| archive.write_all(&zeros).unwrap());
    }
    archive.finish().unwrap().into_inner()
}

/// An archive of PyTorch whose description holds as many numbers as bytes.
fn archive_of_a_pickle(megabytes: usize) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("run/data.pkl", options).unwrap();
    let numbers = vec![b'N'; 1 << 20];
    (0..megabytes).for_each(|_| archive.write_all(&numbers).unwrap());
    archive.finish().unwrap().into_inner()
}

#[test]
#[cfg(unix)]
fn packed_files_hold_no_more_than_is_read() {
    let scratch = Scratch::new();
    let joints: String = (1..=12).map(|joint| format!(",q{joint}")).collect();
    let (wide, row) = (format!("time{joints}\n"), "1,2,3,4,5,6,7,8,9,8,7,6,5\n");
    for (name, bytes) in [
        ("line.csv.gz", packed("time,q1,qd1,tau1\n", "0", 100)),
        ("short.csv.gz", packed("time,q1\n", "0,0\n", 15)),
        ("wide.csv.gz", packed(&wide, row, 15)),
        ("large.npz", archive_of_bytes(100)),
        ("short.npz", archive_of_bytes(2)),
        ("large.pt", archive_of_a_pickle(100)),
    ] {
        scratch.file(name, bytes);
        let message = scratch.refuses_in_little_memory(&format!("audit {name}"));
        let limit = "more than 16 MB and 20 times its size";
        says(&message, &[name, limit, "unpack it first"]);
    }
}

/// The end of a description, and where it goes wrong.
const XML: &str = r#"
<link name="d>\n  </robot>          | line 4, column 3
<link name='c'>\n</robot>           | line 4, column 1
&no;\n</robot>                      | line 3, column 3
<link name='c' name='d'/>\n</robot> | line 3, column 18
<link name='c'/>\n                  | line 3, column 19
<link name='c'>                     | line 3, column 18
"#;

#[test]
fn malformed_xml_is_placed() {
    let scratch = Scratch::new();
    for [tail, place] in rows(XML) {
        let robot = format!("<robot name=\"a\">\n  <link name=\"b\"/>\n  {tail}");
        scratch.file("robot.urdf", robot);
        let message = scratch.refuses("new --from-urdf robot.urdf");
        says(&message, &["robot.urdf", &place, "not valid XML"]);
    }
}

#[test]
fn a_singular_mass_matrix_is_called_so_where_it_stops_the_motion() {
    let scratch = Scratch::new();
    let singular = ROD.replace("value = 0.3", "value = 0.0");
    scratch.file("arm.toml", singular.replace("G * sin(q1)", "0"));
    scratch.log("log.csv", swinging);
    let words = "diverges at 0.000 s ... the mass matrix is singular ... residyn check";
    says_words(
        &scratch.ends_without("simulate --plant arm.toml --out out"),
        words,
    );
    assert!(!scratch.has("out"));
    let evaluated = scratch.run("evaluate --model arm.toml --test log.csv");
    let message = String::from_utf8_lossy(&evaluated.stderr);
    says(&message, &["the mass matrix is singular"]);
}

#[test]
#[cfg(unix)]
fn descriptions_of_very_many_parts_are_refused_at_once() {
    let scratch = Scratch::new();
    let links: String = (0..9000)
        .map(|k| format!("<link name=\"l{k}\"/>\n"))
        .collect();
    let robot = |parent_of: fn(usize) -> usize| {
        let joint = |k: usize| {
            let (parent, child) = (parent_of(k), k + 1);
            format!(
                "<joint name=\"j{k}\" type=\"fixed\"><parent link=\"l{parent}\"/><child link=\"l{child}\"/></joint>\n"
            )
        };
        let joints: String = (0..8999).map(joint).collect();
        format!("<robot name=\"r\">\n{links}{joints}</robot>")
    };
    let wide = |name: &str| {
        let attributes: String = (0..100_000).map(|k| format!(" {name}{k}=\"b\"")).collect();
        format!("<robot{attributes}/>")
    };
    for (text, words) in [
        (
            robot(|k| k),
            "robot.urdf, line 203 ... behind more than 200 joints",
        ),
        (robot(|_| 0), "no joint moves"),
        (
            wide("a"),
            "robot.urdf, line 1, column 1 ... more than 200 attributes",
        ),
        (
            wide("xmlns:a"),
            "robot.urdf, line 1, column 1 ... more than 200 attributes",
        ),
    ] {
        scratch.file("robot.urdf", text);
        let message = scratch.refuses_in_little_memory("new --from-urdf robot.urdf");
        says_words(&message, words);
    }
}

#[test]
fn a_bag_whose_messages_are_computed_is_refused() {
    let scratch = Scratch::new();
    let endless =
        "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT);
        INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr');
        CREATE VIEW messages AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n)
            SELECT 1 AS topic_id, k AS timestamp, x'00' AS data FROM n;";
    let bag = rusqlite::Connection::open(scratch.path("run.db3")).unwrap();
    bag.execute_batch(endless).unwrap();
    says(
        &scratch.refuses("audit run.db3"),
        &["run.db3", "`messages` is not a plain table"],
    );
}

#[test]
fn a_log_of_more_joints_than_any_rig_has_is_refused() {
    let scratch = Scratch::new();
    let header: String = (1..=101).map(|joint| format!(",q{joint}")).collect();
    let row = ",0".repeat(101);
    scratch.file("log.csv", format!("time{header}\n0{row}\n1{row}\n"));
    says(
        &scratch.refuses("audit log.csv"),
        &["log.csv", "has 101 joints; at most 100 are read"],
    );
}

#[test]
fn a_simulation_that_would_not_end_is_refused() {
    let scratch = Scratch::new();
    let slow = include_str!("../configs/plants/pendulum-sim.toml")
        .replace("rate_hz = 50", "rate_hz = 1e-6")
        .replace("duration_s = 10", "duration_s = 1e7");
    scratch.file("slow.toml", slow);
    says(
        &scratch.refuses("simulate --plant slow.toml --out out"),
        &["slow.toml", "`recording.duration_s` must be at most 1e5 s"],
    );
}

mod slow {
    use super::*;

    #[test]
    fn a_model_that_the_log_cannot_tell_anything_of_gets_an_answer() {
        let scratch = Scratch::new();
        scratch.log("log.csv", swinging);
        let terms: Vec<String> = (0..300).map(|k| format!("C_g * {k} * q1")).collect();
        scratch.moving_by("terms.toml", &(terms.join(" + ") + " + C_i * tau1"));
        scratch.model("stiff.toml", "value = 15.0", "value = 1e12");
        for model in ["terms.toml", "stiff.toml"] {
            let given = format!("--model {model} --train log.csv --out out");
            scratch.answers(&format!("closeloop --budget 0s {given}"));
        }
    }

    #[test]
    fn two_runs_do_not_share_a_folder() {
        let scratch = Scratch::new();
        let mut first = scratch.command("closeloop --calibrate 1000 --out out");
        let quiet = first.stdout(Stdio::null()).stderr(Stdio::null());
        let mut first = quiet.spawn().unwrap();
        until_there(&scratch.path("out/report.json"), &mut first);
        let process = format!("process {},", first.id());
        let train = "train --config $REPO/configs/smoke/train-pendulum.toml";
        for second in ["closeloop", train] {
            let message = scratch.refuses(&format!("{second} --out out"));
            says(&message, &["out", &process, "is working there", "--out"]);
        }
        first.kill().unwrap();
        first.wait().unwrap();
    }
}

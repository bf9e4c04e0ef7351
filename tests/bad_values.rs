//! No input breaks the program: input that is too deep, too large or endless is refused at once, with the limit and the
//! place, and numbers that cease to be finite are reported.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::paths::config;
use crate::support::{
    Scratch, answers, ends_without, refuses, residyn, residyn_within, says, succeeds, swinging,
    text, until_there,
};

/// The message with which the program refuses its arguments, run in limited memory.
#[cfg(unix)]
fn refuses_in_little_memory(arguments: &[&str]) -> String {
    let output = residyn_within(200_000, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}:\n{message}");
    assert!(message.len() < 3000, "{} bytes", message.len());
    message
}

/// A model of one joint that gives a mass and a bias, so that its motion is compared through its torques.
const MASS_AND_BIAS: &str = r#"
[system]
name = "arm"
joints = 1

[parameters]
J = { value = 0.1, unit = "kg m^2", positive = true }
m = { value = 2.0, unit = "N m" }

[dynamics]
mass = [["J"]]
bias = ["m * sin(q1)"]
"#;

/// A robot description of one link, which becomes a chain of bodies.
const ONE_LINK: &str = r#"<robot name="link">
<link name="base"/>
<link name="link"><inertial><origin xyz="0 0 -0.3"/><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="joint" type="continuous"><parent link="base"/><child link="link"/><axis xyz="0 1 0"/></joint>
</robot>"#;

#[test]
fn logs_without_motion_get_an_answer() {
    let scratch = Scratch::new();
    let logs = [
        scratch.log("zeros.csv", |_| [0.0; 3]),
        scratch.log("rest.csv", |_| [0.3, 0.0, 0.0]),
        scratch.log("pushed.csv", |time| [0.0, 0.0, 0.01 * time.sin()]),
    ];
    let (urdf, chain) = (
        scratch.file("link.urdf", ONE_LINK),
        scratch.path("link.toml"),
    );
    succeeds(&["new", "--from-urdf", &urdf, "--out", text(&chain)]);
    let models = [
        "pendulum",
        &scratch.file("arm.toml", MASS_AND_BIAS),
        text(&chain),
    ];
    let each = models
        .into_iter()
        .flat_map(|model| logs.iter().map(move |log| (model, log)));
    for (model, log) in each {
        let out = scratch.out();
        let message = answers(&["closeloop", "--model", model, "--train", log, "--out", &out]);
        assert!(
            message.contains("no joint moves visibly"),
            "{model}: {message}"
        );
    }
}

#[test]
fn a_model_of_more_parameters_than_can_be_fitted_is_refused() {
    let scratch = Scratch::new();
    let names: Vec<String> = (1..=600).map(|k| format!("b{k}")).collect();
    let terms = names
        .iter()
        .enumerate()
        .map(|(k, name)| format!("{name} * sin({} * q1)", k + 1));
    let bias = terms.collect::<Vec<_>>().join(" + ");
    let declared: String = names
        .iter()
        .map(|name| format!("{name} = {{ value = 0.01 }}\n"))
        .collect();
    let text = MASS_AND_BIAS
        .replace("m * sin(q1)", &bias)
        .replace("[dynamics]", &format!("{declared}\n[dynamics]"));
    let (model, log) = (
        scratch.file("sines.toml", text),
        scratch.log("log.csv", swinging),
    );
    let message = refuses(&[
        "closeloop",
        "--model",
        &model,
        "--train",
        &log,
        "--out",
        &scratch.out(),
    ]);
    says(
        &message,
        &[
            "note: ",
            "grows with the cube",
            "arm has 602 free parameters",
            "at most 500",
            "`fixed = true`",
        ],
    );
}

#[test]
fn a_log_in_which_one_joint_of_two_rests_gets_an_answer() {
    let scratch = Scratch::new();
    let mut log = "time,q1,q2,qd1,qd2,tau1,tau2\n".to_owned();
    for row in 0..600 {
        let time = 0.01 * f64::from(row);
        let [q, qd, tau] = swinging(time);
        writeln!(log, "{time:?},{q:?},0,{qd:?},0,{tau:?},0").unwrap();
    }
    let (log, out) = (scratch.file("log.csv", log), scratch.out());
    let message = answers(&[
        "closeloop",
        "--budget",
        "0s",
        "--model",
        "acrobot",
        "--train",
        &log,
        "--out",
        &out,
    ]);
    assert!(message.contains("joint 2, 0.5 s ahead"), "{message}");
}

#[test]
fn a_reading_that_no_sensor_has_is_refused_with_its_place() {
    let scratch = Scratch::new();
    for (channel, name) in ["q1", "qd1", "tau1"].into_iter().enumerate() {
        let log = scratch.log("log.csv", |time| {
            let mut row = swinging(time);
            if (time - 1.0).abs() < 0.001 {
                row[channel] = 1e300;
            }
            row
        });
        let message = refuses(&["evaluate", "--model", "pendulum", "--test", &log]);
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
    let cases = [
        (nested("(", 10_000, ")"), "more than 200 parentheses"),
        (nested("-", 100_000, ""), "more than 200 parentheses"),
        (nested("q1^", 20_000, ""), "more than 200 parentheses"),
        (nested("sin(", 5_000, ")"), "more than 200 parentheses"),
        (nested("+", 1_000_000, ""), "more than 200 parentheses"),
        (nested("q1 + ", 200_000, ""), "more than 1000 operations"),
        ("a".repeat(1_000_000), "unknown name `aaa"),
    ];
    for (formula, limit) in cases {
        let model = scratch.moving_by("model.toml", &formula);
        let message = refuses_in_little_memory(&["check", &model]);
        says(&message, &["model.toml, line 11, column 8", limit]);
    }
    let sum = vec!["sin(q1)"; 300].join(" + ");
    let model = scratch.moving_by("model.toml", &vec![format!("({sum})"); 40].join(" * "));
    says(
        &refuses_in_little_memory(&["check", &model]),
        &["line 11", "more than 20000 numbers"],
    );
}

#[test]
#[cfg(unix)]
fn files_with_too_much_of_anything_are_refused() {
    let scratch = Scratch::new();
    let many = |line: fn(usize) -> String| (0..20_000).map(line).collect::<String>();
    let parameters = many(|k| format!("p{k} = {{ value = 1.0 }}\n"));
    let parameters = scratch.model(
        "many.toml",
        "[parameters]",
        &format!("[parameters]\n{parameters}"),
    );
    let lets = many(|k| format!("x{k} = \"sin(q1)\"\n"));
    let lets = scratch.model(
        "lets.toml",
        "[energy]",
        &format!("[dynamics.let]\n{lets}\n[energy]"),
    );
    for model in [parameters, lets] {
        let message = refuses_in_little_memory(&["check", &model]);
        says(&message, &["line ", "entries; at most 1000 are read"]);
    }
    let long = scratch.file("long.toml", vec![b'#'; 5 << 20]);
    says(
        &refuses_in_little_memory(&["check", &long]),
        &["long.toml", "more than 4 MB"],
    );
    let header: Vec<String> = (0..100_000).map(|k| format!("q{k}")).collect();
    let wide = scratch.file("wide.csv", header.join(",") + "\n");
    let message = refuses_in_little_memory(&["audit", &wide]);
    says(&message, &["wide.csv", "100000 columns; at most 4096"]);
    let unknown: Vec<String> = (0..4000).map(|k| format!("column{k}")).collect();
    let unknown = scratch.file("unknown.csv", unknown.join(",") + "\n");
    says(
        &refuses_in_little_memory(&["audit", &unknown]),
        &["column39 and 3960 more"],
    );
    let bodies = "<body>".repeat(60_000) + &"</body>".repeat(60_000);
    let deep = format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
    let deep = scratch.file("deep.xml", deep);
    let message = refuses_in_little_memory(&["new", "--from-mjcf", &deep]);
    says(&message, &["deep.xml, line 1", "more than 200 elements"]);
}

#[test]
#[cfg(unix)]
fn more_than_any_machine_could_do_is_refused_before_it_is_begun() {
    let scratch = Scratch::new();
    let (log, out) = (scratch.log("log.csv", swinging), scratch.out());
    let usual = config("smoke/train-pendulum.toml");
    let of_recipe = |from: &str, to: &str| {
        let recipe = scratch.changed("smoke/train-pendulum.toml", from, to);
        refuses_in_little_memory(&["train", "--config", &recipe, "--out", &out])
    };
    let hidden = "hidden = [16, 16, 16]";
    says(
        &of_recipe(hidden, "hidden = [1000000]"),
        &["train-pendulum.toml", "from 1 to 4096"],
    );
    says(&of_recipe(hidden, "hidden = [0]"), &["from 1 to 4096"]);
    says(
        &of_recipe(hidden, "hidden = [4096, 4096, 4096]"),
        &["at most 20000000"],
    );
    says(
        &of_recipe("trajectories = 100", "trajectories = 100000000000"),
        &["train-pendulum.toml", "at most 10000000 are sampled"],
    );
    says(
        &of_recipe("epochs = 200", "epochs = 1000000000000"),
        &["at most 100000000"],
    );
    let horizon = [
        "evaluate",
        "--model",
        "pendulum",
        "--test",
        &log,
        "--horizon",
        "1e-9",
    ];
    says(
        &refuses_in_little_memory(&horizon),
        &["--horizon 1e-9", "a row every 1.00e-2 s"],
    );
    for duration in ["1e9", "1e300"] {
        let simulate = [
            "simulate",
            "--plant",
            "pendulum",
            "--out",
            &out,
            "--duration",
            duration,
        ];
        says(
            &refuses_in_little_memory(&simulate),
            &["--duration", "two to 10000000 rows"],
        );
    }
    let much = "100000000000";
    let sweep = ["sweep", "--config", &usual, "--out", &out, "--seeds", much];
    let calibrate = ["closeloop", "--out", &out, "--calibrate", much];
    let plant = ["control", "--model", "pendulum", "--plant", "pendulum-sim"];
    let episodes = [&plant[..], &["--episodes", much]].concat();
    for command in [&sweep[..], &calibrate, &episodes] {
        says(&refuses_in_little_memory(command), &["from 1 to 100000"]);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn a_training_that_leaves_the_finite_numbers_or_makes_it_worse_says_so() {
    let scratch = Scratch::new();
    let ends_in = |rate: &str| {
        let rates = format!("learning_rates = {{ physics = 0.01, residual = {rate} }}");
        let usual = "learning_rates = { physics = 0.01, residual = 0.01 }";
        let recipe = scratch.changed("smoke/train-pendulum.toml", usual, &rates);
        ends_without(&[
            "train",
            "--config",
            &recipe,
            "--out",
            text(&scratch.path(rate)),
        ])
    };
    says(
        &ends_in("1e9"),
        &[
            "the loss became",
            "in epoch ",
            "C_g = ",
            "lower the learning rates",
        ],
    );
    says(
        &ends_in("100"),
        &[
            "made the prediction error larger",
            "lower the learning rates",
        ],
    );
}

#[test]
fn numbers_in_files_are_finite() {
    let scratch = Scratch::new();
    for number in ["nan", "inf", "1e999"] {
        let model = scratch.model("model.toml", "value = 15.0", &format!("value = {number}"));
        says(
            &refuses(&["check", &model]),
            &["model.toml, line 7, column 17", "not a finite number"],
        );
        let recipe = scratch.changed(
            "smoke/train-pendulum.toml",
            "step_s = 0.02",
            &format!("step_s = {number}"),
        );
        let message = refuses(&["train", "--config", &recipe, "--out", &scratch.out()]);
        says(&message, &["train-pendulum.toml", "line ", number]);
    }
    let model = scratch.moving_by("model.toml", "1e999 * tau1");
    says(
        &refuses(&["check", &model]),
        &["line 11", "`1e999` is not a number"],
    );
    let model = scratch.model("model.toml", "value = 15.0", "value = 99999999999999999999");
    says(
        &refuses(&["check", &model]),
        &["line 7", "a decimal number"],
    );
}

#[test]
fn names_are_those_that_formulas_can_use() {
    let scratch = Scratch::new();
    for name in ["a b", "", "(", "1", "a\u{200b}"] {
        let named = format!("[parameters]\n\"{name}\" = {{ value = 1.0 }}");
        let model = scratch.model("model.toml", "[parameters]", &named);
        says(
            &refuses(&["check", &model]),
            &["model.toml, line 7", "cannot be used in formulas"],
        );
    }
}

/// A checkpoint, exported as JSON with its weights in a separate file, and the contents of the JSON.
fn exported(scratch: &Scratch) -> (String, Value) {
    let checkpoint = text(&scratch.path("checkpoint")).to_owned();
    let json = text(&scratch.path("model.json")).to_owned();
    succeeds(&[
        "train",
        "--config",
        &config("smoke/train-pendulum.toml"),
        "--out",
        &checkpoint,
    ]);
    succeeds(&[
        "export",
        "--checkpoint",
        &checkpoint,
        "--format",
        "json",
        "--out",
        &json,
    ]);
    let said = serde_json::from_str(&fs::read_to_string(&json).unwrap()).unwrap();
    (json, said)
}

#[test]
#[cfg(unix)]
fn a_description_names_no_file_but_the_one_beside_it() {
    use std::os::unix::fs::symlink;

    let scratch = Scratch::new();
    let (json, said) = exported(&scratch);
    let import =
        |file: &str| refuses_in_little_memory(&["import", "--file", file, "--out", &scratch.out()]);
    fs::create_dir(scratch.path("sub")).unwrap();
    symlink("../model.safetensors", scratch.path("sub/link.safetensors")).unwrap();
    symlink("/dev/zero", scratch.path("sub/endless.safetensors")).unwrap();
    let others = [
        "../model.safetensors",
        "/dev/zero",
        "link.safetensors",
        "endless.safetensors",
        "..",
        "",
    ];
    for weights in others {
        let mut other = said.clone();
        other["weights"] = weights.into();
        let file = scratch.file("sub/model.json", other.to_string());
        says(&import(&file), &["sub/model.json", "in another folder"]);
    }
    // A path from the user may be a link, but it must be finite.
    for name in ["weights.safetensors", "model.toml", "checkpoint.json"] {
        let path = scratch.path("checkpoint").join(name);
        fs::rename(&path, scratch.path("kept")).unwrap();
        symlink("/dev/zero", &path).unwrap();
        let checkpoint = scratch.path("checkpoint");
        let log = scratch.log("log.csv", swinging);
        let message = refuses_in_little_memory(&[
            "evaluate",
            "--checkpoint",
            text(&checkpoint),
            "--test",
            &log,
        ]);
        says(&message, &[name, "a device or a pipe, not a regular file"]);
        fs::remove_file(&path).unwrap();
        fs::rename(scratch.path("kept"), &path).unwrap();
    }
    succeeds(&["import", "--file", &json, "--out", &scratch.out()]);
}

#[test]
fn a_description_of_other_joints_is_refused() {
    let scratch = Scratch::new();
    let (json, mut said) = exported(&scratch);
    for joints in [50_u64, 1_000_000_000] {
        said["joints"] = joints.into();
        fs::write(&json, said.to_string()).unwrap();
        let message = refuses(&["import", "--file", &json, "--out", &scratch.out()]);
        says(
            &message,
            &[
                "model.json",
                &format!("`joints` is {joints}, its model file has 1"),
            ],
        );
        let model = scratch.model("model.toml", "joints = 1", &format!("joints = {joints}"));
        let message = refuses(&["check", &model]);
        says(
            &message,
            &[
                "line 4",
                &format!("`joints` must be from 1 to 12, found {joints}"),
            ],
        );
    }
}

#[test]
#[cfg(unix)]
fn what_never_begins_or_never_ends_is_no_input() {
    let scratch = Scratch::new();
    let (pipe, out) = (scratch.path("pipe.csv"), scratch.out());
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    for file in [text(&pipe), "/dev/zero"] {
        let commands = [
            &["audit", file][..],
            &["check", file],
            &[
                "closeloop",
                "--model",
                "pendulum",
                "--train",
                file,
                "--out",
                &out,
            ],
            &["evaluate", "--model", file, "--test", file],
            &["train", "--config", file, "--out", &out],
            &["new", "--from-urdf", file],
            &["import", "--file", file, "--out", &out],
        ];
        for command in commands {
            let message = refuses_in_little_memory(command);
            says(&message, &[file, "a device or a pipe, not a regular file"]);
        }
    }
    says(
        &refuses(&["evaluate", "--model", "pendulum", "--test", "-"]),
        &["-: ", "standard input is not read", "write it to a file"],
    );
}

/// A file with `part` repeated this many times, packed with gzip after a header.
fn packed(scratch: &Scratch, name: &str, header: &str, part: &str, times: usize) -> String {
    let level = flate2::Compression::fast();
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), level);
    packer.write_all(header.as_bytes()).unwrap();
    let block = part.repeat((1 << 20) / part.len());
    (0..times).for_each(|_| packer.write_all(block.as_bytes()).unwrap());
    scratch.file(name, packer.finish().unwrap())
}

/// An archive with arrays of this many bytes, one byte per number.
fn archive_of_bytes(scratch: &Scratch, name: &str, megabytes: usize) -> String {
    let path = scratch.path(name);
    let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
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
    archive.finish().unwrap();
    text(&path).to_owned()
}

#[test]
#[cfg(unix)]
fn packed_files_hold_no_more_than_is_read() {
    let scratch = Scratch::new();
    let joints: String = (1..=12).map(|joint| format!(",q{joint}")).collect();
    let files = [
        packed(&scratch, "line.csv.gz", "time,q1,qd1,tau1\n", "0", 100),
        packed(&scratch, "short.csv.gz", "time,q1\n", "0,0\n", 15),
        packed(
            &scratch,
            "wide.csv.gz",
            &format!("time{joints}\n"),
            "1,2,3,4,5,6,7,8,9,8,7,6,5\n",
            15,
        ),
        archive_of_bytes(&scratch, "large.npz", 100),
        archive_of_bytes(&scratch, "short.npz", 2),
    ];
    for file in files {
        let message = refuses_in_little_memory(&["audit", &file]);
        says(
            &message,
            &[
                &file,
                "more than 16 MB and 20 times its size",
                "unpack it first",
            ],
        );
    }
}

#[test]
fn malformed_xml_is_placed() {
    let scratch = Scratch::new();
    let head = "<robot name=\"a\">\n  <link name=\"b\"/>\n";
    for (tail, place) in [
        ("  <link name=\"d>\n  </robot>", "line 4, column 3"),
        ("  <link name='c'>\n</robot>", "line 4, column 1"),
        ("  &no;\n</robot>", "line 3, column 3"),
        ("  <link name='c' name='d'/>\n</robot>", "line 3, column 18"),
        ("  <link name='c'/>\n", "line 3, column 19"),
        ("  <link name='c'>", "line 3, column 18"),
    ] {
        let file = scratch.file("robot.urdf", format!("{head}{tail}"));
        let message = refuses(&["new", "--from-urdf", &file]);
        says(&message, &["robot.urdf", place, "not valid XML"]);
    }
}

#[test]
fn definitions_in_a_circle_are_shown_as_one() {
    let scratch = Scratch::new();
    for (lets, circle) in [
        (
            "a = \"2 * b\"\nb = \"c + q1\"\nc = \"sin(a)\"",
            "a -> b -> c -> a",
        ),
        ("a = \"a + q1\"", "a -> a"),
    ] {
        let lets = format!("[dynamics.let]\n{lets}\n\n[energy]");
        let model = scratch.model("model.toml", "[energy]", &lets);
        let message = refuses(&["check", &model]);
        says(
            &message,
            &["model.toml, line 14", "defined in terms of itself", circle],
        );
    }
}

#[test]
fn a_singular_mass_matrix_is_called_so_where_it_stops_the_motion() {
    let scratch = Scratch::new();
    let model = scratch.file(
        "arm.toml",
        "[system]\nname = \"arm\"\njoints = 1\n\n[parameters]\nI = { value = 0.0, unit = \"kg m^2\" }\n\n\
         [dynamics]\nmass = [[\"I\"]]\nbias = [\"0\"]\n",
    );
    let out = scratch.out();
    let message = ends_without(&["simulate", "--plant", &model, "--out", &out]);
    says(
        &message,
        &[
            "diverges at 0.000 s",
            "the mass matrix is singular",
            "residyn check",
        ],
    );
    assert!(!Path::new(&out).exists());
    let log = scratch.log("log.csv", swinging);
    let output = residyn(&["evaluate", "--model", &model, "--test", &log]);
    says(
        &String::from_utf8_lossy(&output.stderr),
        &["the mass matrix is singular"],
    );
}

#[test]
#[cfg(unix)]
fn descriptions_of_very_many_parts_are_refused_at_once() {
    let scratch = Scratch::new();
    let new = |name: &str, text: String| {
        refuses_in_little_memory(&["new", "--from-urdf", &scratch.file(name, text)])
    };
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
    says(
        &new("chain.urdf", robot(|k| k)),
        &["chain.urdf, line 203", "behind more than 200 joints"],
    );
    says(&new("star.urdf", robot(|_| 0)), &["no joint moves"]);
    for name in ["a", "xmlns:a"] {
        let attributes: String = (0..100_000).map(|k| format!(" {name}{k}=\"b\"")).collect();
        says(
            &new("wide.urdf", format!("<robot{attributes}/>")),
            &["wide.urdf, line 1, column 1", "more than 200 attributes"],
        );
    }
    let defaults = "<geom size='1'/>".repeat(201);
    let text = format!("<mujoco><default>{defaults}</default></mujoco>");
    let file = scratch.file("defaults.xml", text);
    says(
        &refuses_in_little_memory(&["new", "--from-mjcf", &file]),
        &["defaults.xml, line 1", "more than 200 elements"],
    );
}

#[test]
fn a_bag_whose_messages_are_computed_is_refused() {
    let scratch = Scratch::new();
    let path = scratch.path("run.db3");
    let endless =
        "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT);
        INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr');
        CREATE VIEW messages AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n)
            SELECT 1 AS topic_id, k AS timestamp, x'00' AS data FROM n;";
    let bag = rusqlite::Connection::open(&path).unwrap();
    bag.execute_batch(endless).unwrap();
    says(
        &refuses(&["audit", text(&path)]),
        &["run.db3", "`messages` is not a plain table"],
    );
}

#[test]
fn a_log_of_more_joints_than_any_rig_has_is_refused() {
    let scratch = Scratch::new();
    let header: String = (1..=101).map(|joint| format!(",q{joint}")).collect();
    let row = ",0".repeat(101);
    let log = format!("time{header}\n0{row}\n1{row}\n");
    let message = refuses(&["audit", &scratch.file("log.csv", log)]);
    says(
        &message,
        &["log.csv", "has 101 joints; at most 100 are read"],
    );
}

#[test]
fn a_simulation_that_would_not_end_is_refused() {
    let scratch = Scratch::new();
    let plant = fs::read_to_string(config("plants/pendulum-sim.toml")).unwrap();
    let line = |key: &str| plant.lines().find(|line| line.starts_with(key)).unwrap();
    let slow = plant
        .replace(line("rate_hz"), "rate_hz = 1e-6")
        .replace(line("duration_s"), "duration_s = 1e7");
    let plant = scratch.file("slow.toml", slow);
    let message = refuses(&["simulate", "--plant", &plant, "--out", &scratch.out()]);
    says(
        &message,
        &["slow.toml", "`recording.duration_s` must be at most 1e5 s"],
    );
}

mod slow {
    use super::*;

    #[test]
    fn a_model_that_the_log_cannot_tell_anything_of_gets_an_answer() {
        let scratch = Scratch::new();
        let (log, out) = (scratch.log("log.csv", swinging), scratch.out());
        let terms: Vec<String> = (0..300).map(|k| format!("C_g * {k} * q1")).collect();
        let models = [
            scratch.moving_by("terms.toml", &(terms.join(" + ") + " + C_i * tau1")),
            scratch.model("stiff.toml", "value = 15.0", "value = 1e12"),
        ];
        for model in models {
            let paths = ["--model", &model, "--train", &log, "--out", &out];
            answers(&[&["closeloop", "--budget", "0s"], &paths[..]].concat());
        }
    }

    #[test]
    fn two_runs_do_not_share_a_folder() {
        let scratch = Scratch::new();
        let out = scratch.out();
        let first = Command::new(env!("CARGO_BIN_EXE_residyn"))
            .args(["closeloop", "--calibrate", "1000", "--out", &out])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        let mut first = first.unwrap();
        until_there(&scratch.path("out/report.json"), &mut first);
        let process = format!("process {},", first.id());
        let train = ["train", "--config", &config("smoke/train-pendulum.toml")];
        for second in [&["closeloop"][..], &train] {
            let message = refuses(&[second, &["--out", &out]].concat());
            says(&message, &[&out, &process, "is working there", "--out"]);
        }
        first.kill().unwrap();
        first.wait().unwrap();
    }
}

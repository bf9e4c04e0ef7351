//! One trajectory in every log format, written by the libraries that people use.

use std::fs;
use std::path::Path;

use residyn_core::data::{Columns, Log, Quantity};
use residyn_io::read_rig_log;

use crate::support::log_files::{formats, recordings};
use crate::support::says;
use crate::support::tables::says_words;

fn read(path: &Path) -> Result<Log, String> {
    read_rig_log(path, 2, &Columns::default()).map_err(|error| error.to_string())
}

#[test]
fn files_that_are_not_read_get_the_line_that_converts_them() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&[u8], &str); 6] = [
        (b"#ROSBAG V2.0\n", "rosbags-convert"),
        (b"\x89HDF\r\n\x1a\n", "is not a complete HDF5 file"),
        (b"MATLAB 5.0 MAT-file", "save('run.mat'"),
        (b"\x28\xb5\x2f\xfd", "zstd -d"),
        (b"PAR1\x15\x04", "is not a complete Parquet file"),
        (b"PK\x03\x04 and no more", "numpy.savez"),
    ];
    for (begin, remedy) in cases {
        let path = folder.path().join("run.log");
        fs::write(&path, begin).unwrap();
        let said = read(&path).unwrap_err();
        assert!(said.contains("run.log") && said.contains(remedy), "{said}");
    }
}

mod slow {
    use super::*;

    #[test]
    fn every_format_holds_the_same_trajectory() {
        let Some(folder) = formats() else { return };
        let wanted = read(&folder.join("run.csv")).unwrap();
        for name in [
            "packed.csv.gz",
            "german.csv",
            "tabs.tsv",
            "matrices.npz",
            "columns.npz",
            "fortran.npz",
            "plain.mat",
            "packed.mat",
            "columns.mat",
            "snappy.parquet",
            "gzip.parquet",
            "zstd.parquet",
            "lz4.parquet",
            "none.parquet",
            "lists.parquet",
            "double.pt",
            "plain.h5",
            "chunked.h5",
            "big_endian.h5",
            "latest.h5",
            "seven.mat",
        ] {
            let found = read(&folder.join(name)).unwrap();
            let channels = |log: &Log| {
                (
                    log.time.clone(),
                    log.q.clone(),
                    log.qd.clone(),
                    log.tau.clone(),
                )
            };
            assert!(channels(&found) == channels(&wanted), "{name}");
        }
        for name in ["integers.npz", "integers.mat", "integers.h5"] {
            let counts = read(&folder.join(name)).unwrap();
            assert_eq!((counts.time[7], counts.q[0][1]), (7.0, 4.0), "{name}");
        }
        for (name, wanted) in [
            ("short.npz", "short.npz, row 48, column \"tau1\": is empty"),
            ("gap.npz", "row 5, column \"q2\": \"NaN\" is not a finite"),
            ("gap.mat", "row 5, column \"q2\": \"NaN\" is not a finite"),
            ("gap.h5", "row 5, column \"q2\": \"NaN\" is not a finite"),
            (
                "gap.parquet",
                "row 5, column \"q2\": \"NaN\" is not a finite",
            ),
            (
                "ragged.parquet",
                "row 50 of \"q\" has 1 number(s) but the first has 2",
            ),
            (
                "pickled.npz",
                "array \"q\" holds pickled objects, which are never read",
            ),
        ] {
            let said = read(&folder.join(name)).unwrap_err();
            assert!(said.contains(wanted), "{said}");
        }
    }

    #[test]
    fn numbers_of_the_whole_run_come_with_its_log() {
        let wanted = [("kp".to_owned(), 40.0), ("gain".to_owned(), 0.5)];
        let Some(folder) = formats() else { return };
        for name in ["values.npz", "values.pt", "values.h5"] {
            let log = read(&folder.join(name)).unwrap();
            assert!(
                wanted.iter().all(|value| log.values.contains(value)),
                "{name}"
            );
            assert_eq!(log.values.len(), 2, "{name}");
        }
        let Some(folder) = recordings() else { return };
        let named = Columns {
            joint_names: vec!["elbow".into(), "wrist".into()],
            ..Columns::default()
        };
        let log = read_rig_log(folder.join("ros_json.mcap"), 2, &named).unwrap();
        assert_eq!(log.values, wanted[..1]);
    }

    #[test]
    fn torques_on_a_clock_of_their_own_hold_until_the_next() {
        let Some(folder) = formats() else { return };
        let wanted = read(&folder.join("run.csv")).unwrap();
        for name in ["clocks.npz", "clocks.pt", "clocks.h5"] {
            let log = read(&folder.join(name)).unwrap();
            assert!(
                log.time == wanted.time[2..] && log.q[0] == wanted.q[0][2..],
                "{name}"
            );
            let held = |row: usize| wanted.tau[1][2 + 3 * (row / 3)];
            let held: Vec<f64> = (0..log.rows()).map(held).collect();
            assert_eq!(log.tau[1], held, "{name}");
            says_words(
                &log.notes.join("\n"),
                "tau is on the clock tau_time ... 2 rows before its first are left out",
            );
        }
    }

    /// Tensors in the names of PACE and of legged_gym: in single precision, by columns, as views of wider ones.
    #[test]
    fn a_dictionary_of_tensors_is_a_log() {
        let Some(folder) = formats() else { return };
        let rig = |names: &[&str], driven_by| Columns {
            joint_names: names.iter().map(|name| (*name).to_owned()).collect(),
            driven_by,
            ..Columns::default()
        };
        let read = |name: &str, columns: &Columns| {
            let log = read_rig_log(folder.join(name), 2, columns);
            log.map_err(|error| error.to_string())
        };
        let wanted = self::read(&folder.join("run.csv")).unwrap();
        let is_near = |found: &[f64], wanted: &[f64]| {
            let mut pairs = found.iter().zip(wanted);
            found.len() == wanted.len() && pairs.all(|(a, b)| (a - b).abs() < 1e-7)
        };
        let pace = rig(&["elbow", "wrist"], Quantity::Command);
        let log = read("pace.pt", &pace).unwrap();
        assert!(is_near(&log.time, &wanted.time));
        for joint in 0..2 {
            assert!(is_near(&log.q[joint], &wanted.q[joint]), "q{joint}");
            assert!(is_near(&log.tau[joint], &wanted.tau[joint]), "cmd{joint}");
        }
        says(
            &log.notes.join("\n"),
            &["names no joints", "velocities come from the angles"],
        );
        // Joints with names may stand in any order.
        let turned = rig(&["wrist_joint", "elbow_joint"], Quantity::Command);
        let log = read("named.pt", &turned).unwrap();
        assert!(is_near(&log.q[0], &wanted.q[1]) && is_near(&log.tau[1], &wanted.tau[0]));
        assert!(!log.notes.join("\n").contains("names no joints"));
        let log = read("legged.pt", &rig(&[], Quantity::Torque)).unwrap();
        assert_eq!((&log.qd, &log.tau), (&wanted.qd, &wanted.tau));
        assert_eq!(read("ticks.pt", &pace).unwrap().time[7], 7.0);
        let notes = read("numpy.pt", &pace).unwrap().notes.join("\n");
        says(
            &notes,
            &["\"dt\" is left out: it is not a tensor, but numpy."],
        );
        for (name, words) in [
            (
                "robots.pt",
                "robots.pt: array \"dof_pos\" has the shape [3, 50, 2]; save one row per sample",
            ),
            ("wrong_names.pt", "has 2 columns, and 1 joints have names"),
            (
                "object.pt",
                "entry \"config\" holds a pickled object, pathlib.PurePosixPath, which is never built",
            ),
            (
                "hostile.pt",
                "entry \"config\" holds a pickled object, posix.system, which is never built",
            ),
        ] {
            says(&read(name, &pace).unwrap_err(), &[words]);
        }
        assert!(!folder.join("executed").exists());
    }

    /// Arrays in groups, by the names that recorders of demonstrations give them, and one run of a file of several.
    #[test]
    fn a_file_of_arrays_in_groups_is_a_log() {
        let Some(folder) = formats() else { return };
        let rig = Columns {
            joint_names: vec!["elbow".into(), "wrist".into()],
            driven_by: Quantity::Command,
            ..Columns::default()
        };
        let read = |name: &str, columns: &Columns| {
            let log = read_rig_log(folder.join(name), 2, columns);
            log.map_err(|error| error.to_string())
        };
        let wanted = self::read(&folder.join("run.csv")).unwrap();
        for name in ["episode.hdf5", "named.hdf5"] {
            let log = read(name, &rig).unwrap();
            assert!(log.q == wanted.q && log.tau == wanted.tau, "{name}");
        }
        let unnamed = Columns {
            driven_by: Quantity::Command,
            ..Columns::default()
        };
        let log = read("demos.hdf5#demo_3", &unnamed).unwrap();
        assert!(log.q[0] == wanted.q[1] && log.q[1] == wanted.q[0]);
        says(&log.notes.join("\n"), &["names no joints"]);
        for (name, words) in [
            (
                "demos.hdf5",
                "in demo_0, demo_1, demo_2 and 2 more; name one: ",
            ),
            ("demos.hdf5", "demos.hdf5#demo_0\""),
            ("demos.hdf5#demo_9", "has no arrays in \"demo_9\""),
        ] {
            says(&read(name, &unnamed).unwrap_err(), &[words]);
        }
    }

    /// Positions and commands of an episode, by the names of the joints.
    #[test]
    fn an_episode_of_a_data_set_of_lerobot_is_a_log() {
        let Some(folder) = formats() else { return };
        let rig = Columns {
            joint_names: vec!["wrist".into(), "elbow".into()],
            driven_by: Quantity::Command,
            ..Columns::default()
        };
        let read = |name: &str| {
            let log = read_rig_log(folder.join(name), 2, &rig);
            log.map_err(|error| error.to_string())
        };
        let wanted = self::read(&folder.join("run.csv")).unwrap();
        for (name, rows) in [
            ("set_v2#0", 50),
            ("set_v2#1", 30),
            ("set_v2/data/chunk-000/episode_000001.parquet", 30),
            ("set_v3#0", 50),
            ("set_v3#1", 30),
            ("single", 50),
        ] {
            let log = read(name).unwrap();
            assert_eq!(log.rows(), rows, "{name}");
            // Data sets are in single precision.
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-7);
            assert!(near(&log.time, &wanted.time) && near(&log.q[0], &wanted.q[1]));
            assert!(near(&log.q[1], &wanted.q[0]) && near(&log.tau[0], &wanted.tau[1]));
        }
        for (name, wanted) in [
            ("set_v3", "holds several episodes, up to 1"),
            ("set_v3", "set_v3#1"),
            ("set_v2#7", "there is no episode 7"),
        ] {
            let said = read(name).unwrap_err();
            assert!(said.contains(wanted), "{said}");
        }
    }

    /// Cut anywhere, and each with a bit flipped: read or refused.
    #[test]
    fn damaged_files_are_no_panic() {
        let Some(folder) = formats() else { return };
        let scratch = tempfile::tempdir().unwrap();
        for name in [
            "plain.mat",
            "packed.mat",
            "matrices.npz",
            "named.pt",
            "plain.h5",
            "chunked.h5",
            "latest.h5",
            "seven.mat",
            "snappy.parquet",
            "none.parquet",
            "lists.parquet",
        ] {
            let whole = fs::read(folder.join(name)).unwrap();
            let damaged = scratch.path().join(name);
            for k in 0..150 {
                fs::write(&damaged, &whole[..whole.len() * k / 150]).unwrap();
                let _ = read(&damaged);
                let mut flipped = whole.clone();
                flipped[k * 7919 % whole.len()] ^= 1 << (k % 8);
                fs::write(&damaged, &flipped).unwrap();
                let _ = read(&damaged);
            }
        }
    }
}

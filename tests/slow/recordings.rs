//! Robot recordings, rosbag2 and MCAP, written by the libraries that people use.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::read_standard_log;
use residyn_core::data::{Column, Columns, Log};
use residyn_io::read_rig_log;

use crate::support::log_files::recordings;
use crate::support::measured;

/// The messages name the joints in the other order.
fn rig() -> Columns {
    Columns {
        joint_names: vec!["elbow".into(), "wrist".into()],
        ..Columns::default()
    }
}

fn read(path: &Path, columns: &Columns) -> Result<Log, String> {
    read_rig_log(path, 2, columns).map_err(|error| error.to_string())
}

/// The error message for a recording that is refused.
fn refused(name: &str, columns: &Columns) -> Option<String> {
    Some(read(&recordings()?.join(name), columns).unwrap_err())
}

fn channels(log: &Log) -> [&[Vec<f64>]; 4] {
    [std::slice::from_ref(&log.time), &log.q, &log.qd, &log.tau]
}

#[test]
fn every_recording_holds_the_same_trajectory() {
    let Some(folder) = recordings() else { return };
    let wanted = read(&folder.join("run.csv"), &rig()).unwrap();
    for name in [
        "sqlite",
        "alone.db3",
        "without_metadata",
        "messages_packed",
        "rosbag_mcap",
        "zstd.mcap",
        "lz4.mcap",
        "plain.mcap",
        "loose.mcap",
        "ros_json.mcap",
        "foxglove.mcap",
        "unstamped.mcap",
        "gripper.mcap",
        "shared_topic.mcap",
    ] {
        let found = read(&folder.join(name), &rig()).unwrap();
        assert!(channels(&found) == channels(&wanted), "{name}");
        let times = match name {
            "unstamped.mcap" => "by when they were recorded",
            _ => "by the stamps in their headers",
        };
        assert!(
            found.notes[0].ends_with(times) || found.notes[0].contains(times),
            "{name}: {:?}",
            found.notes
        );
    }
}

#[test]
fn joints_without_a_model_are_those_of_the_messages() {
    let Some(folder) = recordings() else { return };
    let wanted = read(&folder.join("run.csv"), &rig()).unwrap();
    let found = read_standard_log(folder.join("zstd.mcap")).unwrap();
    assert_eq!((&found.q[0], &found.q[1]), (&wanted.q[1], &wanted.q[0]));
}

#[test]
fn publishers_of_other_joints_may_share_the_topic() {
    let Some(folder) = recordings() else { return };
    let log = read(&folder.join("shared_topic.mcap"), &rig()).unwrap();
    let said = "10 of 60 messages of /joint_states hold other joints and are left out";
    assert!(log.notes.iter().any(|note| note == said), "{:?}", log.notes);
}

#[test]
fn messages_may_lack_velocity_and_effort() {
    let Some(folder) = recordings() else { return };
    let log = read(&folder.join("angles.mcap"), &rig()).unwrap();
    let said = |what: &str| log.notes.iter().any(|note| note.contains(what));
    assert!(said("velocities come from the angles") && said("read as a passive rig"));
    assert!((log.qd[0][20] - log.time[20].cos()).abs() < 1e-4);
}

#[test]
fn a_recording_that_is_cut_off_is_read_up_to_there() {
    let Some(folder) = recordings() else { return };
    let wanted = read(&folder.join("run.csv"), &rig()).unwrap();
    let log = read(&folder.join("cut.mcap"), &rig()).unwrap();
    assert!((2..40).contains(&log.rows()), "{}", log.rows());
    assert_eq!(log.q[1], wanted.q[1][..log.rows()]);
    assert!(log.notes[0].ends_with("cut.mcap is cut off: only the part before the cut is read"));
}

#[test]
fn the_model_file_says_which_of_several_topics_it_is() {
    let said = refused("two_arms.mcap", &rig());
    let Some(said) = said else { return };
    for part in [
        "several topics have the joints; say which under [columns] in the model file: topic = \"/left/joint_states\"",
        "/right/joint_states (sensor_msgs/msg/JointState in cdr, 30 messages: elbow, wrist)",
        "/said (std_msgs/msg/String in cdr, 1 messages)",
    ] {
        assert!(said.contains(part), "{said}");
    }
    let right = Columns {
        topic: Some("/right/joint_states".into()),
        ..rig()
    };
    let log = read(&recordings().unwrap().join("two_arms.mcap"), &right).unwrap();
    assert_eq!(log.rows(), 30);
}

/// Torques on another topic: at other times, numbered, and only from the third row on.
#[test]
fn torques_of_another_topic_are_held_at_the_times_of_the_joints() {
    let Some(folder) = recordings() else { return };
    let path = folder.join("commands.mcap");
    let unnamed = read(&path, &rig()).unwrap_err();
    assert!(
        unnamed.contains("there is no column \"tau1\"")
            && unnamed.contains("/effort_controller/commands/1"),
        "{unnamed}"
    );
    let command = |joint: usize| Column::named(format!("/effort_controller/commands/{joint}"));
    let columns = Columns {
        tau: vec![command(1), command(2)],
        ..rig()
    };
    let log = read(&path, &columns).unwrap();
    let whole = read(&folder.join("run.csv"), &rig()).unwrap();
    assert_eq!(
        (log.rows(), &log.q[0][..], &log.time[..]),
        (48, &whole.q[0][2..], &whole.time[2..])
    );
    let held = |row: usize| whole.tau[1][2 + row / 3 * 3];
    assert!((0..48).all(|row| log.tau[1][row] == held(row)));
    for said in [
        "by when they were recorded, since not all messages have a stamp",
        "/effort_controller/commands is held from one message to the next, for 0.008 s at most",
        "2 of 50 messages of /joint_states are earlier than the first of the other topics and are left out",
    ] {
        assert!(
            log.notes.iter().any(|note| note.contains(said)),
            "{:?}",
            log.notes
        );
    }
}

#[test]
fn recordings_that_do_not_fit_say_what_to_do() {
    let elsewhere = Columns {
        topic: Some("/arm".into()),
        ..rig()
    };
    let unknown = Columns {
        joint_names: vec!["hip".into(), "knee".into()],
        ..Columns::default()
    };
    for (name, columns, parts) in [
        ("file_packed", &rig(), ["is packed file by file", "zstd -d"]),
        (
            "text.mcap",
            &rig(),
            [
                "there is no topic with joint states",
                "/said (std_msgs/msg/String in cdr, 1 messages)",
            ],
        ),
        (
            "zstd.mcap",
            &elsewhere,
            [
                "there is no topic \"/arm\" with joint states",
                "/joint_states (sensor_msgs",
            ],
        ),
        (
            "zstd.mcap",
            &unknown,
            [
                "there is no column \"q1\"; the log has the joints wrist, elbow",
                "joint_names = [",
            ],
        ),
        (
            "zstd.mcap",
            &Columns::default(),
            ["there is no column \"q1\"", "joint_names = ["],
        ),
        (
            "two_arms.mcap",
            &unknown,
            [
                "no topic has all joints of the model",
                "topic = \"/left/joint_states\"",
            ],
        ),
        (
            "lengths.mcap",
            &rig(),
            [
                "message 21 of /joint_states has 2 of `position` for 3 joint(s)",
                "cut the recording",
            ],
        ),
        (
            "no_cdr.mcap",
            &rig(),
            [
                "message 1 of /joint_states invalid type",
                "/joint_states (sensor_msgs",
            ],
        ),
    ] {
        let Some(said) = refused(name, columns) else {
            return;
        };
        assert!(
            said.contains(name) && parts.iter().all(|part| said.contains(part)),
            "{name}: {said}"
        );
    }
}

#[test]
fn folders_without_a_recording_say_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let said = read(folder.path(), &rig()).unwrap_err();
    assert!(
        said.contains("rosbag2 has .db3 or .mcap files there"),
        "{said}"
    );
}

/// Cut anywhere, and each with a bit flipped: read or refused.
#[test]
fn damaged_recordings_are_no_panic() {
    let Some(folder) = recordings() else { return };
    let scratch = tempfile::tempdir().unwrap();
    for name in [
        "alone.db3",
        "zstd.mcap",
        "lz4.mcap",
        "plain.mcap",
        "loose.mcap",
        "foxglove.mcap",
    ] {
        let whole = fs::read(folder.join(name)).unwrap();
        let damaged: PathBuf = scratch.path().join(name);
        for k in 0..150 {
            fs::write(&damaged, &whole[..whole.len() * k / 150]).unwrap();
            let _ = read(&damaged, &rig());
            let mut flipped = whole.clone();
            flipped[k * 7919 % whole.len()] ^= 1 << (k % 8);
            fs::write(&damaged, &flipped).unwrap();
            let _ = read(&damaged, &rig());
        }
    }
}

#[test]
fn a_bag_of_a_real_arm_holds_what_its_csv_does() {
    let Some(folder) = measured("ur10") else {
        return;
    };
    let names = [
        "shoulder_pan",
        "shoulder_lift",
        "elbow",
        "wrist_1",
        "wrist_2",
        "wrist_3",
    ];
    let columns = Columns {
        joint_names: names.map(|name| format!("{name}_joint")).to_vec(),
        ..Columns::default()
    };
    let at = |name: &str| read_rig_log(folder.join(name), 6, &columns).unwrap();
    let (bag, csv) = (
        at("ur10_exciting_trajectory.db3"),
        at("ur10_exciting_trajectory.csv"),
    );
    assert_eq!(bag.rows(), csv.rows());
    // The CSV has seven digits.
    for (bag, csv) in channels(&bag)
        .into_iter()
        .flatten()
        .zip(channels(&csv).into_iter().flatten())
    {
        assert!(
            bag.iter()
                .zip(csv)
                .all(|(bag, csv)| (bag - csv).abs() <= 1e-6 * csv.abs().max(1e-3))
        );
    }
}

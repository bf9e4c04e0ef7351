use residyn_core::data::Joint;
use residyn_core::model::Library;

use super::{Alarm, Kind, Monitor, MonitorError, Rows, Settings};

#[path = "../examples/watch/machines.rs"]
#[allow(dead_code)] // shared with the example, which uses all of it
mod machines;

use machines::{joint, model, piece, servo_arm, with_effect};

fn short() -> Settings {
    Settings {
        healthy_s: 60.0,
        ..Settings::default()
    }
}

/// The alarms of a machine that changes after two minutes.
fn alarms(healthy: &residyn_core::plant::Plant, then: &residyn_core::plant::Plant) -> Vec<Alarm> {
    let mut monitor = Monitor::new(&model(healthy), short()).unwrap();
    let before = monitor.update(&piece(healthy, 0.0, 120.0, 1)).unwrap();
    assert_eq!(before, [], "nothing has changed yet");
    monitor.update(&piece(then, 121.0, 60.0, 2)).unwrap()
}

#[test]
fn friction_that_grew_is_named_with_its_joint_size_and_time() {
    let healthy = servo_arm(2);
    let worn = with_effect(healthy.clone(), "coulomb_friction", 1, |level| 1.3 * level);
    let alarms = alarms(&healthy, &worn);
    let alarm = &alarms[0];
    let cause = alarm.cause();
    assert_eq!(
        (cause.kind, cause.joint, cause.name.as_str()),
        (Kind::Parameter, Joint::at(1), "F_c2"),
        "{alarm}"
    );
    let estimate = cause.estimate.as_ref().unwrap();
    let [low, high] = estimate.ci95;
    assert!(
        estimate.is_relative && low < 0.3 && 0.3 < high && high - low < 0.1,
        "{alarm}"
    );
    assert!(
        (alarm.since_s - 121.0).abs() < 5.0 && alarm.time_s < 140.0,
        "{alarm:?}"
    );
    let told: serde_json::Value = serde_json::to_value(alarm).unwrap();
    assert_eq!(
        (&told["joint"], &told["kind"]),
        (&2.into(), &"parameter".into())
    );
    assert!(
        told["message"]
            .as_str()
            .unwrap()
            .starts_with("coulomb friction of joint 2")
    );
}

#[test]
fn what_the_motion_does_not_show_has_no_limit() {
    let healthy = servo_arm(2);
    let mut monitor = Monitor::new(&model(&healthy), short()).unwrap();
    let mut still = healthy.clone();
    still.excitation.amplitude[1] = 0.0;
    monitor.update(&piece(&still, 0.0, 100.0, 1)).unwrap();
    let summary = monitor.summary();
    let limit = |name: &str| {
        summary
            .limits
            .iter()
            .find(|limit| limit.name == name)
            .unwrap()
            .within_an_hour
    };
    assert!(limit("F_c1").is_some_and(|limit| limit < 0.2));
    assert_eq!(limit("F_c2"), None, "joint 2 hardly moves");
}

#[test]
fn one_row_at_a_time_says_the_same_as_all_at_once() {
    let plant = joint();
    let rows = piece(&plant, 0.0, 70.0, 3);
    let mut whole = Monitor::new(&model(&plant), short()).unwrap();
    whole.update(&rows).unwrap();
    let mut single = Monitor::new(&model(&plant), short()).unwrap();
    for at in 0..rows.time.len() {
        let of = |columns: &[Vec<f64>]| columns.iter().map(|column| vec![column[at]]).collect();
        let row = Rows {
            time: vec![rows.time[at]],
            q: of(&rows.q),
            driven: of(&rows.driven),
            measured: Vec::new(),
        };
        single.update(&row).unwrap();
    }
    assert_eq!(whole.summary(), single.summary());
    assert!(whole.summary().is_calibrated);
}

#[test]
fn rows_that_cannot_be_read_are_refused_with_row_and_column() {
    let plant = joint();
    let good = piece(&plant, 0.0, 2.0, 3);
    let said = |spoil: &dyn Fn(&mut Rows)| {
        let mut monitor = Monitor::new(&model(&plant), short()).unwrap();
        monitor.update(&good).unwrap();
        let mut rows = piece(&plant, 3.0, 2.0, 4);
        spoil(&mut rows);
        monitor.update(&rows).unwrap_err().to_string()
    };
    type Case<'c> = (&'c dyn Fn(&mut Rows), &'c str);
    let cases: [Case<'_>; 5] = [
        (
            &|rows| rows.q[0][4] = f64::NAN,
            "row 206, column \"q1\": NaN is not a number",
        ),
        (
            &|rows| rows.driven[0][0] = f64::INFINITY,
            "row 202, column \"tau1\": inf is not a number",
        ),
        (
            &|rows| rows.time[2] = rows.time[1],
            "row 204, column \"time\": 3.01 s does not come after 3.01 s",
        ),
        (
            &|rows| rows.q.push(Vec::new()),
            "2 column(s) of angles for 1 joint(s)",
        ),
        (
            &|rows| rows.q[0].truncate(7),
            "row 209: column \"q1\" ends at row 7",
        ),
    ];
    for (spoil, words) in cases {
        let message = said(spoil);
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn gaps_jumps_and_repeated_rows_are_counted() {
    let plant = joint();
    let mut monitor = Monitor::new(&model(&plant), short()).unwrap();
    let mut rows = piece(&plant, 0.0, 100.0, 5);
    rows.q[0][9001] = rows.q[0][9000];
    rows.q[0][9500..].iter_mut().for_each(|q| *q += 3.0);
    monitor.update(&rows).unwrap();
    monitor.update(&piece(&plant, 101.0, 5.0, 6)).unwrap();
    let summary = monitor.summary();
    assert_eq!(
        (summary.gaps, summary.jumps, summary.repeated_rows),
        (1, 1, 1)
    );
}

#[test]
fn settings_and_models_that_cannot_be_watched_are_refused() {
    let declared = model(&joint());
    let settings = Settings {
        healthy_s: 5.0,
        ..Settings::default()
    };
    let refused = Monitor::new(&declared, settings).err().unwrap();
    assert!(
        refused.to_string().contains("the healthy stretch is 5"),
        "{refused}"
    );
    let text = "[system]\nname = \"wheel\"\njoints = 1\n[parameters]\nJ = { value = 1.0, fixed = true }\n\
        [dynamics]\nmass = [[\"J\"]]\nbias = [\"0\"]\n";
    let bare = Library::built_in()
        .model_from_text("wheel.toml", text)
        .unwrap();
    let refused = Monitor::new(&bare, Settings::default()).err();
    assert_eq!(
        refused,
        Some(MonitorError::NothingFree {
            model: "wheel".to_owned()
        })
    );
}

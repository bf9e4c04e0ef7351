//! Logs as files.

use std::io::Read;
use std::path::Path;

use residyn_core::data::{Columns, Log, LogError, Table};
use residyn_core::model::Model;
use thiserror::Error;

use crate::files::{OutputError, write_with};
use crate::table::{open, open_reader};

/// Reads a log of the rig that a model describes from a file, or a folder, in any supported format.
///
/// # Errors
/// As [`read_rig_log`].
pub fn read_log(path: impl AsRef<Path>, model: &Model) -> Result<Log, LogError> {
    read_rig_log(path, model.joints, &model.columns)
}

/// Reads several logs of the rig that a model describes.
///
/// # Errors
/// As [`read_rig_log`].
pub fn read_logs<P: AsRef<Path>>(
    paths: impl IntoIterator<Item = P>,
    model: &Model,
) -> Result<Vec<Log>, LogError> {
    let logs = paths.into_iter().map(|path| read_log(path, model));
    logs.collect()
}

/// Reads a log of the rig that a model describes from anything that can be read, such as standard input or a download;
/// `name` is for messages and the report.
///
/// It is held in memory, up to 1 GB. It may be a text or a MATLAB file, packed with gzip or not; other formats are read
/// from files only.
///
/// ```
/// use residyn_core::model::Library;
/// use residyn_io::read_log_from;
///
/// let model = Library::built_in().model("pendulum")?;
/// let text = "time,q1,qd1,tau1\n0,0.1,0,0\n0.01,0.1,0,0.2\n"; // or std::io::stdin().lock()
/// let log = read_log_from(text.as_bytes(), "swing", &model)?;
/// assert_eq!((log.name(), log.rows()), ("swing".to_owned(), 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A reader that fails or has more, and what [`Log::of_table`] refuses.
pub fn read_log_from(reader: impl Read, name: &str, model: &Model) -> Result<Log, LogError> {
    let path = Path::new(name);
    let table = |columns: &Columns| open_reader(path, reader, columns);
    rig_log(path, model.joints, &model.columns, table)
}

/// Reads one trajectory of a rig with `joints` joints: see [`Log::of_table`].
///
/// # Errors
/// A file that cannot be read, and what [`Log::of_table`] refuses.
pub fn read_rig_log(
    path: impl AsRef<Path>,
    joints: usize,
    columns: &Columns,
) -> Result<Log, LogError> {
    let path = path.as_ref();
    rig_log(path, joints, columns, |columns| open(path, columns))
}

/// One trajectory from the table that `open` finds for the columns.
fn rig_log(
    path: &Path,
    joints: usize,
    columns: &Columns,
    open: impl FnOnce(&Columns) -> Result<Box<dyn Table>, LogError>,
) -> Result<Log, LogError> {
    let columns = columns.completed(joints, path)?;
    Log::of_table(path, open(&columns)?.as_mut(), joints, &columns)
}

/// Reads a file with the standard columns, with as many joints as its header has, in the header's order if they have
/// names.
///
/// # Errors
/// As [`read_rig_log`].
pub fn read_standard_log(path: impl AsRef<Path>) -> Result<Log, LogError> {
    let path = path.as_ref();
    Log::of_standard_table(path, open(path, &Columns::default())?.as_mut())
}

/// Reads what a reader has as [`read_standard_log`] reads a file, under the conditions of [`read_log_from`].
///
/// # Errors
/// As [`read_log_from`].
pub fn read_standard_log_from(reader: impl Read, name: &str) -> Result<Log, LogError> {
    let path = Path::new(name);
    Log::of_standard_table(
        path,
        open_reader(path, reader, &Columns::default())?.as_mut(),
    )
}

/// Why a log could not be written.
#[derive(Debug, Error)]
pub enum WriteLogError {
    /// It has a number that no reader would accept.
    #[error("{0}")]
    Reading(#[from] LogError),
    /// The folder or the file cannot be written.
    #[error("{0}")]
    Output(#[from] OutputError),
}

/// Writes a log as CSV: see [`Log::write_csv`]. The text goes to a temporary name in the same folder that is renamed when
/// complete, so `path` never holds half a log.
///
/// # Errors
/// A number that no reader would accept; a folder or a file that cannot be written.
pub fn write_log(log: &Log, path: impl AsRef<Path>) -> Result<(), WriteLogError> {
    let path = path.as_ref();
    log.check_readings(path)?;
    Ok(write_with(path, |out| log.write_csv(out))?)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::Write;

    use residyn_core::data::{Column, Quantity, TorqueColumn};

    use super::*;

    fn read(text: &str, joints: usize) -> Result<Log, LogError> {
        read_as(text, joints, &Columns::default())
    }

    fn read_as(text: &str, joints: usize, columns: &Columns) -> Result<Log, LogError> {
        let path = Path::new("rig.csv");
        let table = |columns: &Columns| open_reader(path, text.as_bytes(), columns);
        rig_log(path, joints, columns, table)
    }

    fn message(text: &str) -> String {
        read(text, 1).unwrap_err().to_string()
    }

    #[test]
    fn spreadsheet_habits_are_accepted() {
        let text = " time , \"q1\",qd1, tau1 ,mode\r\n\r\n0, 1 ,\"2\", \"3\" ,run\r\n0.1,4,5,6,stop\r\n \r\n\r\n";
        let log = read(text, 1).unwrap();
        assert_eq!(log.time, [0.0, 0.1]);
        assert_eq!((&log.q[0], &log.qd[0]), (&vec![1.0, 4.0], &vec![2.0, 5.0]));
        assert_eq!(log.tau[0], [3.0, 6.0]);
        assert_eq!(log.notes, ["columns ignored: \"mode\""]);
    }

    #[test]
    fn a_reader_has_a_log_packed_or_not_but_no_archive() {
        let text = b"time,q1,qd1,tau1\n0,1,2,3\n1,1,2,3\n";
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(text).unwrap();
        let log = read_standard_log_from(&*packer.finish().unwrap(), "rig.csv.gz").unwrap();
        assert_eq!(log.time, [0.0, 1.0]);
        let archive: &[u8] = b"PK\x03\x04";
        let refused = read_standard_log_from(archive, "-")
            .unwrap_err()
            .to_string();
        assert_eq!(
            refused,
            "-: its format is read from files only; write it to a file"
        );
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_first_name() {
        let text = "\u{feff}time,q1,qd1,tau1\n0,1,2,3\n1,1,2,3\n";
        assert_eq!(read(text, 1).unwrap().rows(), 2);
    }

    #[test]
    fn a_log_without_torque_is_a_passive_rig_with_a_note() {
        let log = read("time,q1,qd1\n0,1,2\n1,1,2\n", 1).unwrap();
        assert_eq!(log.tau, [[0.0, 0.0]]);
        assert!(log.notes[0].contains("passive"));
    }

    #[test]
    fn a_log_without_velocity_takes_it_from_the_angles_with_a_note() {
        let rows: Vec<String> = (0..50)
            .map(|i| f64::from(i) * 0.01)
            .map(|t| format!("{t},{},0", 3.0 * t * t))
            .collect();
        let log = read(&format!("time,q1,tau1\n{}\n", rows.join("\n")), 1).unwrap();
        let off = |row: usize| (log.qd[0][row] - 6.0 * log.time[row]).abs();
        // At the ends a difference of neighbours is half a step late: 6 rad/s^2 * 5 ms.
        assert!((4..46).all(|row| off(row) < 1e-9) && (0..50).all(|row| off(row) < 0.031));
        assert!(log.notes[0].contains("velocities come from the angles"));
    }

    #[test]
    fn units_factors_and_turns_are_read() {
        let columns = Columns {
            time: Column {
                unit: Some("us"),
                ..Column::named("time")
            },
            q: vec![Column {
                unit: Some("deg"),
                wrapped: true,
                ..Column::named("q1")
            }],
            tau: vec![Column {
                factor: -2.0,
                ..Column::named("tau1")
            }],
            ..Columns::default()
        };
        let text = "time,q1,qd1,tau1\n0,170,1,5\n1e4,-170,1,6\n";
        let log = read_as(text, 1, &columns).unwrap();
        assert!((log.time[1] - 0.01).abs() < 1e-15);
        assert!((log.q[0][1].to_degrees() - 190.0).abs() < 1e-9);
        assert_eq!((log.qd[0][1], log.tau[0][1]), (1.0, -12.0));
    }

    #[test]
    fn a_late_column_is_moved_and_rows_without_a_value_are_dropped() {
        let columns = Columns {
            tau: vec![Column {
                late_s: 0.5,
                ..Column::named("tau1")
            }],
            ..Columns::default()
        };
        let text = "time,q1,qd1,tau1\n0,1,0,0\n1,2,0,10\n2,3,0,20\n3,4,0,30\n";
        let log = read_as(text, 1, &columns).unwrap();
        assert_eq!(log.time, [0.0, 1.0, 2.0]);
        assert_eq!(
            (&log.q[0], &log.tau[0]),
            (&vec![1.0, 2.0, 3.0], &vec![5.0, 15.0, 25.0])
        );
        let columns = Columns {
            tau: vec![Column {
                late_s: 2.5,
                ..Column::named("tau1")
            }],
            ..columns
        };
        let few = read_as(text, 1, &columns).unwrap_err().to_string();
        assert!(few.contains("has 1 row(s)"), "{few}");
    }

    #[test]
    fn a_wrong_cell_is_shown_with_its_place() {
        let head = "time,q1,qd1,tau1\r\n0,0,0,0\r\n\r\n";
        assert_eq!(
            message(&format!("{head}1,abc,0,0\r\n")),
            "rig.csv, line 4, column \"q1\": \"abc\" is not a number; write a decimal number such as 0.25"
        );
        assert!(message(&format!("{head}1,0,,0\r\n")).contains("line 4, column \"qd1\": is empty"));
        let finite = message(&format!("{head}1,0,0,-inf\r\n"));
        assert!(
            finite.contains("column \"tau1\": \"-inf\" is not a finite"),
            "{finite}"
        );
        let width = message(&format!("{head}1,0,0\r\n"));
        assert!(
            width.contains("line 4: has 3 cell(s) where the header has 4"),
            "{width}"
        );
    }

    #[test]
    fn a_file_without_a_header_is_read_by_the_numbers_of_its_columns() {
        let columns = Columns {
            time: "1".into(),
            q: vec!["3".into()],
            qd: None,
            tau: vec!["2".into()],
            ..Columns::default()
        };
        for text in [
            "0,5,1\n1,6,2\n",
            "  0  5 1\n  1  6 2 \n",
            "0\t5\t1\n1\t6\t2\n",
        ] {
            let log = read_as(text, 1, &columns).unwrap();
            assert_eq!((&log.time, &log.q[0]), (&vec![0.0, 1.0], &vec![1.0, 2.0]));
            assert_eq!(log.tau[0], [5.0, 6.0]);
        }
        let wrong = read_as("0,5,1\n1,x,2\n", 1, &columns).unwrap_err();
        assert!(
            wrong.to_string().contains("line 2, column \"2\": \"x\""),
            "{wrong}"
        );
        // What is missing in the first row is said, not taken for a name.
        let empty = read_as("0,5,\n1,6,2\n", 1, &columns).unwrap_err();
        assert!(
            empty.to_string().contains("line 1, column \"3\""),
            "{empty}"
        );
        assert!(message("0,5,1\n1,6,2\n").contains("time = 1, q = [2]"));
    }

    /// The angles and commands of a table with columns time, q1 and cmd1.
    fn commanded(text: &str) -> Result<Log, LogError> {
        let columns = Columns {
            driven_by: Quantity::Command,
            ..Columns::default()
        };
        read_as(text, 1, &columns)
    }

    #[test]
    fn commands_on_another_clock_hold_until_the_next() {
        let merged = "time,q1,cmd1\n0,1,\n0.1,,5\n0.2,2,\n0.25,,6\n0.3,,7\n0.4,3,\n0.6,4,nan\n";
        let log = commanded(merged).unwrap();
        assert_eq!(log.time, [0.2, 0.4, 0.6]);
        assert_eq!(
            (&log.q[0], &log.tau[0]),
            (&vec![2.0, 3.0, 4.0], &vec![5.0, 7.0, 7.0])
        );
        let said = log.notes.join("\n");
        assert!(
            said.contains("another clock") && said.contains("for 0.300 s at most"),
            "{said}"
        );
        // At fewer times than angles, in the same rows.
        let slow = "time,q1,cmd1\n0,1,5\n1,2,\n2,3,\n3,4,6\n4,5,\n";
        assert_eq!(commanded(slow).unwrap().tau[0], [5.0, 5.0, 5.0, 6.0, 6.0]);
        // Angles at fewer times than commands.
        let fast = "time,q1,cmd1\n0,1,5\n1,,6\n2,,7\n2.5,,7\n3,4,8\n";
        assert_eq!(commanded(fast).unwrap().tau[0], [5.0, 8.0]);
    }

    #[test]
    fn a_missing_cell_is_no_clock() {
        for (text, wanted) in [
            (
                "time,q1,cmd1\n0,1,5\n1,2,\n2,3,6\n3,4,7\n",
                "line 3, column \"cmd1\": is empty",
            ),
            (
                "time,q1,cmd1\n0,1,\n1,2,\n2,3,\n",
                "line 2, column \"cmd1\": is empty",
            ),
            (
                "time,q1,qd1,cmd1\n0,1,2,3\n1,,2,\n2,1,2,3\n",
                "line 3, column \"q1\": is empty",
            ),
            (
                "time,q1,cmd1\n0,1,5\n1,,x\n2,3,\n",
                "line 3, column \"q1\": is empty",
            ),
            (
                "time,q1,cmd1\n0,1,5\n,,6\n2,3,6\n",
                "line 3, column \"time\": is empty",
            ),
        ] {
            let said = commanded(text).unwrap_err().to_string();
            assert!(said.contains(wanted), "{said}");
        }
        let readings = Columns {
            torque: Some(TorqueColumn::Sampled),
            ..Columns::default()
        };
        let sampled = read_as("time,q1,tau1\n0,1,5\n1,2,\n2,3,\n", 1, &readings);
        let said = sampled.unwrap_err().to_string();
        assert!(said.contains("line 3, column \"tau1\": is empty"), "{said}");
    }

    #[test]
    fn time_has_to_increase() {
        let error = message("time,q1,qd1,tau1\n0.5,0,0,0\n0.5,0,0,0\n");
        assert!(
            error.starts_with(
                "rig.csv, line 3, column \"time\": time 0.5 s does not come after 0.5 s in line 2"
            ),
            "{error}"
        );
    }

    #[test]
    fn files_without_a_trajectory_say_so() {
        assert!(message("").contains("rig.csv: is empty"));
        assert!(message("\n \n").contains("is empty"));
        assert!(message("time,q1,qd1,tau1\n").contains("has 0 row(s)"));
        assert!(message("time,q1,qd1,tau1\n0,0,0,0\n").contains("has 1 row(s)"));
        let missing = read_rig_log("/no/such/rig.csv", 1, &Columns::default()).unwrap_err();
        assert!(missing.to_string().contains("cannot be read"), "{missing}");
    }

    #[test]
    fn bytes_that_are_not_text_are_placed() {
        let bytes: &[u8] = b"time,q1,qd1,tau1\n0,0,0,\xff\n";
        let error = read_standard_log_from(bytes, "rig.csv").unwrap_err();
        assert!(error.to_string().contains("line 2: not UTF-8"), "{error}");
    }

    #[test]
    fn other_separators_and_decimal_commas_are_found() {
        for text in [
            "time;q1;qd1;tau1\n0;1,5;2;3\n0,1;4;5;6\n",
            "time\tq1\tqd1\ttau1\n0\t1,5\t2\t3\n0,1\t4\t5\t6\n",
            "time|q1|qd1|tau1\n0|1.5|2|3\n0.1|4|5|6\n",
        ] {
            let log = read(text, 1).unwrap();
            assert_eq!((log.time[1], log.q[0][0]), (0.1, 1.5), "{text}");
        }
        let both = message("time;q1;qd1;tau1\n0;1.234,5;2;3\n1;1;1;1\n");
        assert!(both.contains("\"1.234,5\" is not a number"), "{both}");
    }

    fn log() -> Log {
        Log {
            path: "rig.csv".into(),
            time: vec![0.0, 0.1, 0.30000000000000004],
            q: vec![vec![1.0, -1e-300, 3.5], vec![0.1, 0.2, 1.0 / 3.0]],
            qd: vec![vec![0.0; 3], vec![1e22, 0.0, -7.25]],
            tau: vec![vec![0.0; 3], vec![0.5; 3]],
            ..Log::empty(2)
        }
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rig.csv");
        write_log(&log(), &path).unwrap();
        let back = read_rig_log(&path, 2, &Columns::default()).unwrap();
        assert_eq!(
            back,
            Log {
                path: path.clone(),
                ..log()
            }
        );
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_number_that_no_reader_accepts_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rig.csv");
        let mut log = log();
        log.qd[1][2] = f64::NAN;
        let message = write_log(&log, &path).unwrap_err().to_string();
        assert!(
            message.contains("line 4, column \"qd2\": \"NaN\""),
            "{message}"
        );
        assert!(!path.exists());
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let message = write_log(&log(), "/no/such/folder/rig.csv")
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("/no/such/folder/rig.csv: cannot be written"));
    }
}

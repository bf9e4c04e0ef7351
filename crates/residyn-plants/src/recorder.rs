use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use super::description::Description;
use super::message::Row;

/// Writes the rows of an episode as they arrive, as a log: whatever dies, the file holds all rows but the newest.
pub struct Recorder {
    file: File,
    names: Vec<String>,
    /// The newest row, whose command is known once the next row says what acted.
    newest: Option<Row>,
}

impl Recorder {
    /// A new log at `path`.
    ///
    /// # Errors
    /// A file that cannot be made.
    pub fn create(path: &Path, description: &Description) -> io::Result<Self> {
        let mut file = File::create(path)?;
        let commanded = match description.command {
            super::Commanded::Torque => "tau",
            super::Commanded::Position => "cmd",
        };
        let joints = description.joints.len();
        let of_joints = ["q", "qd", commanded];
        let of_joints = of_joints
            .iter()
            .flat_map(|name| (1..=joints).map(move |joint| format!("{name}{joint}")));
        let columns = (["time".to_owned()].into_iter())
            .chain(of_joints)
            .chain(description.measured.iter().map(|name| format!("u_{name}")));
        writeln!(file, "{}", columns.collect::<Vec<_>>().join(","))?;
        Ok(Self {
            file,
            names: description.measured.clone(),
            newest: None,
        })
    }

    /// A row with its velocities, and the command that acted up to it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn row(&mut self, row: &Row, acted: &[f64]) -> io::Result<()> {
        self.write_newest(acted)?;
        self.newest = Some(row.clone());
        Ok(())
    }

    /// The last row, in which `held` acts.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn end(&mut self, held: &[f64]) -> io::Result<()> {
        self.write_newest(held)?;
        self.file.sync_data()
    }

    fn write_newest(&mut self, command: &[f64]) -> io::Result<()> {
        let Some(row) = self.newest.take() else {
            return Ok(());
        };
        let missing = f64::NAN;
        let measured = self.names.iter();
        let measured = measured.map(|name| row.measured.get(name).unwrap_or(&missing));
        let values = row.q.iter().chain(row.qd.iter().flatten()).chain(command);
        let mut line = row.time.to_string();
        for value in values.chain(measured) {
            let _ = match value.is_nan() {
                true => write!(line, ","),
                false => write!(line, ",{value}"),
            };
        }
        line.push('\n');
        // In one call, so that no death of this process leaves half a line.
        self.file.write_all(line.as_bytes())
    }
}

//! A robot and its logs, without flags: the model of a robot description is made on the way.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Value, json};

use crate::cli::gains::Gains;
use crate::cli::notes;
use residyn_core::model::{Library, Model};
use residyn_formats::{RobotReader, model_of, robot_reader};
use residyn_io::files::write_whole;
use residyn_io::read_model;

/// The file of the model that was made, in the folder of the report.
const MADE: &str = "declared.toml";

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Robot description (URDF or MJCF), of which a model of all its joints is made as `new` does, or a model file
    #[arg(value_name = "ROBOT", requires = "logs", conflicts_with_all = ["model", "train"])]
    pub robot: Option<PathBuf>,
    /// Its logs: files, or folders of them
    #[arg(value_name = "LOGS", group = "learned")]
    pub logs: Vec<PathBuf>,
    #[command(flatten)]
    pub gains: Gains,
}

impl Arguments {
    /// Robot and gains as the report has them; null without a robot.
    pub fn as_json(&self) -> Value {
        let Gains { kp, kd } = &self.gains;
        let of = |robot: &PathBuf| json!({"file": robot.display().to_string(), "kp": kp, "kd": kd});
        self.robot.as_ref().map_or(Value::Null, of)
    }
}

/// The model that is declared for a rig.
pub(super) struct Declared {
    /// Where it is, or is going to be.
    pub path: PathBuf,
    pub model: Model,
    /// Its text, if it is still to be written.
    made: Option<String>,
}

impl Declared {
    /// The model of a call with this robot or this model file, to be written into the folder `out` if it is made of a
    /// description; `None` without either.
    pub fn of(
        call: &Arguments,
        model: Option<&Path>,
        out: &Path,
        library: &Library,
    ) -> Result<Option<Self>> {
        let robot = call.robot.as_deref();
        let reader = robot.map(robot_reader).transpose()?.flatten();
        if let (Some(robot), Some(reader)) = (robot, reader) {
            return Self::made(robot, reader, &call.gains, out).map(Some);
        }
        let file = |path: &Path| Self::of_file(path, library);
        let declared = robot.or(model).map(file).transpose()?;
        if call.gains.are_given() {
            bail!(
                "--kp and --kd are gains of a robot description, URDF or MJCF: residyn closeloop robot.urdf logs/ --kp 20 \
                 --kd 1; those of a model file are in its [parameters]"
            );
        }
        Ok(declared)
    }

    fn of_file(path: &Path, library: &Library) -> Result<Self> {
        Ok(Self {
            path: path.to_owned(),
            model: read_model(path, library)?,
            made: None,
        })
    }

    fn made(robot: &Path, reader: &RobotReader, gains: &Gains, out: &Path) -> Result<Self> {
        let tree = gains.on(reader.tree(robot, None, None)?)?;
        notes::say(&tree.notes);
        let model = model_of(&tree)?;
        Ok(Self {
            path: out.join(MADE),
            made: Some(model.text.clone()),
            model,
        })
    }

    /// Write the model file if it was made here.
    pub fn keep(&self) -> Result<()> {
        let Some(text) = &self.made else {
            return Ok(());
        };
        Ok(write_whole(&self.path, text.as_bytes())?)
    }
}

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use include_dir::{Dir, include_dir};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Excitation;
use crate::data::Joint;
use crate::expr::suggestion;
use crate::limits::{LOG_ROWS, RUNS, SIMULATED_S, TONES, check_readings};
use crate::model::{FileError, FittedEffect, Library, Model, ModelError};
use crate::toml_text::from_toml;

/// Why a plant cannot be simulated.
#[derive(Debug, Error)]
pub enum PlantError {
    #[error(transparent)]
    Model(#[from] FileError),
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
    #[error(transparent)]
    Effect(#[from] ModelError),
    #[error("effect `{effect}`: `joint` must be from 1 to {joints}, found {found}")]
    Joint {
        effect: String,
        joints: usize,
        found: Joint,
    },
    #[error("unknown parameter `{name}` of {system}{near}")]
    Parameter {
        system: String,
        name: String,
        /// A similar known name, as the end of a sentence; empty without one.
        near: String,
    },
    #[error("effect `{effect}` has no parameter `{name}`{near}; it has {known}")]
    EffectParameter {
        effect: String,
        name: String,
        /// A similar known name, as the end of a sentence; empty without one.
        near: String,
        known: String,
    },
    #[error("{0}")]
    Sampling(String),
    #[error(
        "the simulated rig diverges at {time_s:.3} s; give it less torque, or realistic parameters"
    )]
    Diverged { time_s: f64 },
    #[error(
        "the simulated rig diverges at {time_s:.3} s: {fault}; `residyn check` shows what to fix"
    )]
    Mass { time_s: f64, fault: String },
}

/// A rig to simulate: its model, true parameters, hidden effects, excitation and sensors.
#[derive(Debug, Clone)]
pub struct Plant {
    pub system: Model,
    /// True values of the declared parameters, in their order.
    pub parameters: Vec<f64>,
    pub effects: Vec<FittedEffect>,
    pub sensor: Sensor,
    pub excitation: Excitation,
    pub recording: Recording,
}

/// The sensors of the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Sampling rate in Hz.
    pub rate_hz: f64,
    /// Standard deviation of the noise on the angles, in rad (or m).
    pub position_noise: f64,
    /// Resolution of the encoder in rad (or m); 0 for continuous measurements.
    pub position_step: f64,
}

/// What is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    pub logs: usize,
    pub duration_s: f64,
    /// Angles, then velocities at the start of each log.
    pub start: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    model: PathBuf,
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
    #[serde(default)]
    effect: Vec<HiddenEffect>,
    sensor: Sensor,
    excitation: Excitation,
    recording: Recording,
}

/// An effect of a rig: `{ name = "coulomb_friction", joint = 1, F_c = 0.4 }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HiddenEffect {
    pub name: String,
    pub joint: Joint,
    /// Values of its parameters; the others have their typical values.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

/// Sensors, excitation and recording of a desktop rig, for a plant that is given as a model file alone.
const USUAL_SENSOR: Sensor = Sensor {
    rate_hz: 100.0,
    position_noise: 1e-3,
    position_step: 0.0,
};

/// The embedded plants.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../configs/plants");

impl Plant {
    /// The model without the hidden effects: the equations with the rig's true parameters.
    pub fn declared(&self) -> Model {
        let mut system = self.system.clone();
        for (parameter, value) in system.parameters.iter_mut().zip(&self.parameters) {
            *parameter = parameter.with_value(*value);
        }
        system
    }

    /// Names of the embedded plants.
    pub fn names() -> Vec<&'static str> {
        let stem = |file: &include_dir::File<'static>| file.path().file_stem()?.to_str();
        BUILT_IN.files().filter_map(stem).collect()
    }

    /// The text of the embedded plant of this name.
    pub fn embedded(name: &str) -> Option<&'static str> {
        BUILT_IN.get_file(format!("{name}.toml"))?.contents_utf8()
    }

    /// The plant in `text`; `model` returns the model that the text names; `path` is for messages.
    ///
    /// # Errors
    /// Unknown key, parameter or effect; messages name place and remedy.
    pub fn from_text(
        path: &Path,
        text: &str,
        library: &Library,
        model: impl FnOnce(&Path) -> Result<Model, FileError>,
    ) -> Result<Self, PlantError> {
        let wrong = |message: String| PlantError::File {
            path: path.to_owned(),
            message,
        };
        let file: File = from_toml(text).map_err(|error| wrong(error.to_string()))?;
        let mut plant = Self::of_system(model(&file.model)?);
        let parameters = plant.set_parameters(&file.parameters);
        parameters.map_err(|error| wrong(error.to_string()))?;
        plant.hide(library, &file.effect)?;
        plant.sensor = file.sensor;
        plant.excitation = file.excitation;
        plant.recording = file.recording;
        plant.check().map_err(wrong)?;
        Ok(plant)
    }

    /// Whether a text describes a plant rather than a model.
    pub fn is_one(text: &str) -> bool {
        from_toml::<toml::Table>(text).is_ok_and(|table| table.contains_key("model"))
    }

    /// The rig that a model declares, with the sensors and excitation of a desktop rig.
    pub fn of_system(system: Model) -> Self {
        let joints = system.joints;
        Self {
            parameters: system.parameters.iter().map(|p| p.value).collect(),
            effects: system.effects.clone(),
            sensor: USUAL_SENSOR,
            excitation: Excitation::usual(joints),
            recording: Recording {
                logs: 1,
                duration_s: 20.0,
                start: vec![0.0; 2 * joints],
            },
            system,
        }
    }

    fn check(&self) -> Result<(), String> {
        let n = self.system.joints;
        let one_each = |what: &str, found: usize, wanted: usize| match found == wanted {
            true => Ok(()),
            false => Err(format!("`{what}` needs {wanted} numbers, found {found}")),
        };
        one_each("excitation.amplitude", self.excitation.amplitude.len(), n)?;
        one_each("recording.start", self.recording.start.len(), 2 * n)?;
        let [low, high] = self.excitation.band_hz;
        if !(low > 0.0 && high > low) {
            return Err(
                "`excitation.band_hz` must be two increasing frequencies above zero".into(),
            );
        }
        let noise = [self.sensor.position_noise, self.sensor.position_step];
        if !noise.iter().all(|number| *number >= 0.0) {
            return Err("sensor noise and resolution must not be negative".into());
        }
        check_readings("sensor", noise)?;
        check_readings("excitation.band_hz", [high])?;
        let amplitude = self.excitation.amplitude.iter().copied();
        check_readings("excitation.amplitude", amplitude)?;
        check_readings("recording.start", self.recording.start.iter().copied())?;
        let counts = [
            ("excitation.tones", self.excitation.tones, TONES),
            ("recording.logs", self.recording.logs, RUNS),
        ];
        if let Some((what, found, most)) = counts.iter().find(|(_, found, most)| found > most) {
            return Err(format!("`{what}` must be at most {most}, found {found}"));
        }
        let [rate, duration] = [self.sensor.rate_hz, self.recording.duration_s];
        if !(rate > 0.0 && (2.0..LOG_ROWS as f64).contains(&(rate * duration))) {
            return Err(format!(
                "`sensor.rate_hz` times `recording.duration_s` must give from two to {LOG_ROWS} rows; {rate:?} Hz \
                 for {duration:?} s does not"
            ));
        }
        if duration > SIMULATED_S {
            return Err(format!(
                "`recording.duration_s` must be at most {SIMULATED_S:e} s, found {duration:?}"
            ));
        }
        Ok(())
    }

    /// The same plant, recorded for `duration_s`.
    ///
    /// # Errors
    /// A duration with fewer than two rows, or with more than any log has.
    pub fn lasting(mut self, duration_s: f64) -> Result<Self, PlantError> {
        self.recording.duration_s = duration_s;
        self.check().map_err(PlantError::Sampling)?;
        Ok(self)
    }

    /// Give declared parameters their true values.
    ///
    /// # Errors
    /// Unknown parameter, with a similar known one.
    pub fn set_parameters(&mut self, values: &BTreeMap<String, f64>) -> Result<(), PlantError> {
        let known = self.system.parameters.iter().map(|p| p.name.as_str());
        for (name, value) in values {
            let Some(k) = known.clone().position(|known| known == name) else {
                return Err(PlantError::Parameter {
                    system: self.system.name.clone(),
                    name: name.clone(),
                    near: suggestion(name, known),
                });
            };
            self.parameters[k] = *value;
        }
        Ok(())
    }

    /// Add effects.
    ///
    /// # Errors
    /// As [`Plant::add_effect`].
    pub fn hide(&mut self, library: &Library, effects: &[HiddenEffect]) -> Result<(), PlantError> {
        for effect in effects {
            let values: Vec<(String, f64)> = effect.values.clone().into_iter().collect();
            self.add_effect(library, &effect.name, effect.joint, &values)?;
        }
        Ok(())
    }

    /// Add an effect on a joint. Parameters that are not given have their typical values.
    ///
    /// # Errors
    /// Unknown effect, joint or parameter, with what is known.
    pub fn add_effect(
        &mut self,
        library: &Library,
        name: &str,
        joint: Joint,
        values: &[(String, f64)],
    ) -> Result<(), PlantError> {
        let effect = library.effect(name)?;
        if !joint.is_of(self.system.joints) {
            return Err(PlantError::Joint {
                effect: name.to_owned(),
                joints: self.system.joints,
                found: joint,
            });
        }
        let mut new = FittedEffect::typical(effect, joint);
        let known: Vec<&str> = effect.parameters.iter().map(|p| p.name.as_str()).collect();
        for (key, value) in values {
            let Some(k) = known.iter().position(|known| known == key) else {
                return Err(PlantError::EffectParameter {
                    effect: name.to_owned(),
                    name: key.clone(),
                    near: suggestion(key, known.iter().copied()),
                    known: known.join(", "),
                });
            };
            new.values[k].0 = *value;
        }
        self.system.check_effect(&new, &self.effects)?;
        self.effects.push(new);
        Ok(())
    }
}

//! The shape of `report.json`: its types, from which `docs/report.schema.json` is derived.
//!
//! The comment of a field is its description in the schema.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Value, json};

use super::by_log::{OfLogEntry, RangeEntry};
use super::calibration::CalibrationEntry;
use super::overview::{DifferenceEntry, OfJointEntry};
use super::plot_data::PlotData;
use residyn_core::closeloop::{
    Curve, ErrorModel, NetworkCheck, Proposal, Separation, Settings, SplitMethod, TestLog,
    TorqueErrors, Unexplained, Verdict,
};
use residyn_core::data::{Finding as AuditFinding, Joint, Severity};
use residyn_core::model::Call;

/// Version of the names in `report.json`.
pub(super) const SCHEMA: u32 = 2;

/// The JSON schema (draft 2020-12) of [`Report`].
pub fn schema() -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let mut schema = settings.into_generator().into_root_schema_for::<Report>();
    schema.insert(
        "title".into(),
        format!("report.json of residyn closeloop, schema {SCHEMA}").into(),
    );
    schema.into()
}

/// Fields listed here keep their names and meaning; further fields may be added.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// version of these names
    #[schemars(range(min = SCHEMA, max = SCHEMA))]
    pub(super) schema: u32,
    /// version of the program
    pub(super) version: String,
    pub(super) seed: u64,
    /// the command with its arguments as resolved; for a program that calls the library, what it gives
    pub(super) configuration: Value,
    /// how the program was called; null for a program that calls the library. Everything else is the same each time
    pub(super) call: Option<Call>,
    /// every tuning constant of closing the loop
    pub(super) settings: Settings,
    /// name of the declared system
    pub(super) system: String,
    #[schemars(range(min = 1))]
    pub(super) joints: usize,
    /// names of the joints in the model file or URDF, in order; q1, q2 .. if they have none
    pub(super) joint_names: Vec<String>,
    /// groups of joints that are built alike, by their names
    #[serde(default)]
    pub(super) like_joints: Vec<Vec<Joint>>,
    /// for each joint whether it slides (m, N) rather than turns (rad, N m)
    pub(super) prismatic: Vec<bool>,
    /// the quantity by which logs command the joints: `tau`, or `cmd` of a drive
    pub(super) driven_by: String,
    pub(super) verdict: Verdict,
    /// the answer in a sentence
    pub(super) headline: String,
    /// why, in a sentence
    pub(super) reason: String,
    /// what the model lacks: established effects
    pub(super) effects: Vec<EffectEntry>,
    /// other explanations that these logs do not rule out
    pub(super) alternatives: Vec<AlternativeEntry>,
    /// effects that lower the error on logs left out of the fit without being established: the model has them, but do
    /// not rely on their names
    pub(super) supported: Vec<EffectEntry>,
    /// where joints that are built alike differ, the largest difference first
    #[serde(default)]
    pub(super) differences: Vec<DifferenceEntry>,
    pub(super) unexplained: UnexplainedEntry,
    /// the declared equations in LaTeX, one per line; for a chain of bodies, their form
    pub(super) equations: Vec<String>,
    /// parameters of the declared equations, as refitted
    pub(super) parameters: Vec<RefittedEntry>,
    /// free values of the model file that belong to one joint: of its drive, and of the effects that the file declares
    #[serde(default)]
    pub(super) of_joints: Vec<OfJointEntry>,
    /// the model with effects, fitted to each training log alone; empty for a single log and for more than 32
    pub(super) by_log: Vec<OfLogEntry>,
    /// ranges of this rig's values from run to run; also in ranges.json
    pub(super) ranges: Vec<RangeEntry>,
    /// values in the model file that lie outside the 95 % interval of the final fit
    pub(super) contradicted: Vec<ContradictedEntry>,
    pub(super) identifiability: IdentifiabilityEntry,
    /// how the fits ended on which the errors and the verdict rest
    pub(super) fits: FitsEntry,
    /// speeds over which the sign of each joint's velocity is smoothed in fits and predictions, rad/s or m/s
    pub(super) smoothing_velocities: Vec<f64>,
    /// the errors that fits minimise, effects are selected by, and `error_reduction` refers to
    pub(super) compared: ErrorModel,
    pub(super) error: ErrorEntry,
    /// error of the torques that the logged motion needs, low-passed; null for a model that gives accelerations
    pub(super) torque: Option<TorqueErrors>,
    /// residual generalised force, root mean square over blocks of 0.15 s, N m or N
    pub(super) residual_norm: NormEntry,
    pub(super) logs: LogsEntry,
    /// what the audit found, log by log
    pub(super) audit: Vec<AuditEntry>,
    /// sets of effects that were fitted, one list per round of the search
    pub(super) tried: Vec<Vec<TriedEntry>>,
    /// number of candidates in each round
    pub(super) candidates: Vec<usize>,
    /// whether the search was stopped because its time was spent
    pub(super) stopped: bool,
    /// errors that decide whether the residual network is used; null if none is trained
    pub(super) network: Option<NetworkCheck>,
    /// what the training logs could show, by simulations of the accepted model; null if it was not requested
    pub(super) calibration: Option<CalibrationEntry>,
    pub(super) plots: PlotData,
    /// paths in the folder of this report
    pub(super) files: FilesEntry,
}

impl Report {
    /// Findings that make results wrong unless they are fixed, each with its log.
    pub(super) fn serious(&self) -> impl Iterator<Item = (&str, &AuditFinding)> {
        self.audit
            .iter()
            .flat_map(|audit| {
                let findings = audit.findings.iter();
                findings.map(|finding| (audit.log.as_str(), finding))
            })
            .filter(|(_, finding)| finding.severity == Severity::Serious)
    }

    /// A joint for people: its number, with its name if it has one.
    pub(super) fn label(&self, joint: Joint) -> String {
        let name = Some(self.joint_names[joint.index()].as_str());
        joint.called(name.filter(|name| *name != joint.name("q")))
    }
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct EffectEntry {
    pub name: String,
    pub joint: Joint,
    /// both joints, if the effect couples two
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<Joint>>,
    /// the name for people
    pub title: String,
    /// the joint or joints for people, with their names
    pub place: String,
    /// what is added, with the names of this model's parameters; for a shift, the new value
    pub expression: String,
    /// the expression in LaTeX; null for a shift
    pub latex: Option<String>,
    /// how it enters the equations
    pub enters: String,
    #[schemars(length(min = 1))]
    pub parameters: Vec<ParameterEntry>,
    #[schemars(range(min = 0, max = 1))]
    pub p_value: f64,
    /// share of the compared error that this effect alone removes; negative if it adds error; null if the refit without
    /// the effect failed
    #[schemars(range(max = 1))]
    pub error_reduction: Option<f64>,
    /// why that refit failed
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_reduction_failure: Option<String>,
    /// share of the loss of the motion under the commands that this effect removes on the training logs, if the torques
    /// of the drives' law do not show it and the motion does
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 1))]
    pub motion_reduction: Option<f64>,
    /// for an effect that is only supported: what evidence is missing
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_established: Option<String>,
}

impl EffectEntry {
    /// `coulomb_friction on joint 2 (elbow)`
    pub fn named(&self) -> String {
        format!("{} on joint {}", self.title, self.place)
    }
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ParameterEntry {
    pub name: String,
    /// for a parameter with one value per log: the log in which this value holds
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log: Option<String>,
    pub value: f64,
    /// 95 % interval, lower end first; null for a parameter that was held; an end is null if the logs do not bound it
    #[serde(deserialize_with = "some_ends")]
    #[schemars(with = "Option<Ends>")]
    pub ci95: Option<[f64; 2]>,
    pub unit: String,
    /// whether the interval is narrower than the parameter's magnitude
    pub identifiable: bool,
    /// whether the fit ended at a bound of the parameter's range: the logs ask for a value beyond it
    pub at_bound: bool,
}

/// value and ci95 are those of the final fit
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct RefittedEntry {
    #[serde(flatten)]
    pub fitted: ParameterEntry,
    /// the value in the model file
    pub declared: f64,
    /// the value fitted without the effects
    pub before: f64,
}

/// value and ci95 are the fitted ones
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ContradictedEntry {
    /// the value in the model file
    pub declared: f64,
    /// how the two compare, in words
    pub comparison: String,
    #[serde(flatten)]
    pub fitted: ParameterEntry,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct EffectName {
    pub name: String,
    pub joint: Joint,
    /// both joints, if the effect couples two
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<Joint>>,
    /// for people, with the joint
    pub label: String,
    /// for a parameter_shift: the parameter that has another value
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct AlternativeEntry {
    #[schemars(length(min = 1))]
    pub effects: Vec<EffectName>,
    /// the name of the effect that the others do without, and its joint or joints, for people
    pub title: String,
    pub place: String,
    pub reason: String,
    /// the experiment that would decide, in a sentence
    pub experiment: String,
    /// its figures, from simulation; null for lower-ranked alternatives
    pub separation: Option<Separation>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct UnexplainedEntry {
    #[serde(flatten)]
    pub left: Unexplained,
    /// residual generalised force as a function of each variable alone, with a pointwise 95 % band
    pub curves: Vec<Curve>,
    /// null if nothing is left or nothing fits it
    pub proposal: Option<Proposal>,
}

/// the fit of the declared model, and the final one with the effects
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct FitsEntry {
    /// values that the fit of the declared parameters began with, as pairs of parameter and value, if the model
    /// diverges with the values in its file; else empty
    pub moved_to: Vec<(String, f64)>,
    pub before: FitEntry,
    pub after: FitEntry,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct FitEntry {
    pub converged: bool,
    /// why the fit ended
    pub termination: String,
    /// steps that were taken
    pub steps: usize,
    /// loss after each step, in units of the sensors' noise
    pub trace: Vec<f64>,
    /// condition number of the normal equations, as they are and scaled so that each value alone has the same
    /// information; null if they are singular
    pub condition: [Option<f64>; 2],
}

/// what the logs determine of the declared parameters
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct IdentifiabilityEntry {
    /// number of parameters that are not fixed
    pub free: usize,
    /// number of their combinations that the logs determine
    pub determined: usize,
    /// combinations that the logs do not determine, as pairs of parameter and weight
    pub undetermined: Vec<Vec<(String, f64)>>,
    /// parameters held for that reason
    pub held: Vec<String>,
    /// what the logs determine about the bodies of a chain, if torques were compared
    pub bodies: Vec<CombinationEntry>,
    /// number of sums of the bodies' parameters that any motion could determine
    pub identifiable_at_most: usize,
}

/// a sum of bodies' parameters that the logs determine
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct CombinationEntry {
    /// number of its first body, 1 next to the base
    pub body: usize,
    /// parameters with their weights
    pub sum: Vec<(String, f64)>,
    /// its value with the values in the model file
    pub declared: f64,
    pub value: f64,
    /// 95 % interval, lower end first; an end is null if the logs do not bound it
    #[serde(deserialize_with = "ends")]
    #[schemars(with = "Ends")]
    pub ci95: [f64; 2],
    pub unit: String,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ErrorEntry {
    #[schemars(extend("const" = "test"))]
    pub logs: String,
    /// test logs that repeat training logs: they were fitted, and their errors test nothing; left out if there are none
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fitted_logs: Vec<String>,
    #[schemars(length(min = 1), extend("items" = json!({"type": "number", "exclusiveMinimum": 0})))]
    pub horizons_s: Vec<f64>,
    /// horizons that were requested, but are longer than any segment of the test logs
    pub unscored_s: Vec<f64>,
    /// the declared model with the values in its file, before any fit
    pub declared: ModelError,
    /// the declared model with its own parameters fitted
    pub before: ModelError,
    /// the declared model with Coulomb and viscous friction on every joint, fitted: what most would try first; null if
    /// the declared model has both
    pub with_friction: Option<ModelError>,
    /// the declared model with the effects added, refitted
    pub after: ModelError,
    /// as after, with the zeros of each test log's sensors estimated on its first second, scored on the rest; null if
    /// no zero differs from log to log
    pub zeroed: Option<ModelError>,
    /// with effects and a network trained on what is left; null if none was trained
    pub hybrid: Option<ModelError>,
    /// the models given for comparison, as they are
    pub against: Vec<ContenderEntry>,
    /// 95 % interval of the relative reduction of the position error, before to after; null if there are too few logs
    pub reduction_ci95: Option<[f64; 2]>,
    /// the position error of all joints together at the middle horizon that the noise of the position sensors accounts
    /// for, in the rows and in the states from which predictions start; null if torques are compared
    pub noise_floor: Option<f64>,
    /// the errors that are compared, on each test log; empty for a single log
    pub by_log: Vec<TestLog>,
    /// the shorter of the integrator steps of the declared model and the model with effects, s
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub integrator_step_s: f64,
}

impl ErrorEntry {
    /// Place of the middle horizon, and the horizon in s.
    pub fn middle(&self) -> (usize, f64) {
        let place = self.horizons_s.len() / 2;
        (place, self.horizons_s[place])
    }
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ContenderEntry {
    /// as given on the command line
    pub name: String,
    #[serde(flatten)]
    pub error: ModelError,
}

/// open-loop errors; one inner list per horizon, one number per joint
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct ModelError {
    /// root mean square over all rows of all windows, rad or m
    #[schemars(length(min = 1), inner(length(min = 1), inner(range(min = 0))))]
    pub position_rmse: Vec<Vec<f64>>,
    /// median over the windows of each window's root mean square, rad or m
    #[schemars(length(min = 1), inner(length(min = 1), inner(range(min = 0))))]
    pub position_median: Vec<Vec<f64>>,
    /// as position_rmse, rad/s or m/s
    #[schemars(length(min = 1), inner(length(min = 1), inner(range(min = 0))))]
    pub velocity_rmse: Vec<Vec<f64>>,
    /// windows scored, one number per horizon
    #[schemars(length(min = 1))]
    pub windows: Vec<usize>,
    /// windows in which the model diverged, one number per horizon; they count in the errors
    #[schemars(length(min = 1))]
    pub diverged: Vec<usize>,
}

impl ModelError {
    /// Position error of all joints together at a horizon: root of the mean over rows of the sum over joints, rad (or m).
    pub fn of_all(&self, horizon: usize) -> f64 {
        let squares = self.position_rmse[horizon].iter().map(|rmse| rmse * rmse);
        squares.sum::<f64>().sqrt()
    }

    /// As above, but the root of the mean over joints: the size of the error of one joint.
    #[allow(clippy::cast_precision_loss)] // few joints
    pub fn of_a_joint(&self, horizon: usize) -> f64 {
        self.of_all(horizon) / (self.position_rmse[horizon].len() as f64).sqrt()
    }
}

/// null if the fit of the force failed
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct NormEntry {
    /// of the declared model, fitted
    #[schemars(range(min = 0))]
    pub before: Option<f64>,
    /// of the model with the effects
    #[schemars(range(min = 0))]
    pub after: Option<f64>,
    /// why the first of them that is null was not computed
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct LogsEntry {
    pub train: Vec<LogEntry>,
    pub test: Vec<LogEntry>,
    pub split: SplitMethod,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct LogEntry {
    pub name: String,
    pub rows: usize,
    pub start_s: f64,
    pub end_s: f64,
    /// intervals left out, start and end in s
    pub leave_out: Vec<[f64; 2]>,
    /// angles that jump for a single row, one number per joint: masked in fits, scored in test logs
    pub jumps: Vec<usize>,
    /// rows that the logger dropped: put in or left out in fits; in test logs the torque is held over them
    pub dropped_rows: usize,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct AuditEntry {
    pub log: String,
    pub findings: Vec<AuditFinding>,
    /// the log whose motion this one repeats
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeats: Option<String>,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct TriedEntry {
    pub effects: Vec<EffectName>,
    /// relative drop of the loss on held-out blocks, from the set with which the round began
    #[schemars(range(max = 1))]
    pub gain: f64,
    /// whether the next round begins with it
    pub chosen: bool,
}

#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct FilesEntry {
    pub model: String,
    pub report: String,
    /// the report for a browser, in one file
    pub page: String,
    pub checkpoint: Option<String>,
    pub plots: Vec<String>,
}

/// An interval in JSON, which has no infinite numbers.
pub(super) type Ends = [Option<f64>; 2];

pub(super) fn ends<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    Ends::deserialize(from).map(infinite_where_null)
}

fn some_ends<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f64; 2]>, D::Error> {
    Ok(Option::<Ends>::deserialize(from)?.map(infinite_where_null))
}

fn infinite_where_null([low, high]: Ends) -> [f64; 2] {
    [
        low.unwrap_or(f64::NEG_INFINITY),
        high.unwrap_or(f64::INFINITY),
    ]
}

#[cfg(test)]
mod tests {
    use super::schema;

    #[test]
    fn the_published_schema_is_that_of_the_types() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
        let derived = serde_json::to_string_pretty(&schema()).unwrap() + "\n";
        let published = std::fs::read_to_string(format!("{root}docs/report.schema.json")).unwrap();
        if derived != published {
            let fresh = format!("{root}target/report.schema.json");
            std::fs::write(&fresh, &derived).unwrap();
            panic!(
                "docs/report.schema.json is not the schema of the types; put {fresh} in its place"
            );
        }
    }
}

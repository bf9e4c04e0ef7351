//! Closing the loop: from logs and a declared model to the effects that the model lacks.
//!
//! [`close_loop`] goes through the stages of `docs/method.md`, each a function from one type to the next: [`prepare`]
//! the logs, [`fit`] the declared model, [`screen`] the effects that it may lack, [`select`] a set of them,
//! [`establish`] each, [`diagnose`] what remains, [`discriminate`] between explanations, [`refine`], [`learn`] and
//! [`score`]. They work on a [`Problem`], which none of them changes.

mod alike;
mod bodies_off;
mod by_log;
mod by_motion;
mod calibrate;
mod command_path;
mod diagnostics;
mod discriminate;
mod drive_gain;
mod drive_limits;
mod error;
mod error_model;
mod error_model_choice;
mod establish;
mod every_log;
mod excess;
mod external_force;
mod fit;
mod fitted;
mod free_swing;
mod friction_by_motion;
mod gravity;
mod imposed;
mod judge;
mod learn;
mod limbs;
mod loss;
mod names_by_motion;
mod notes;
mod one_way;
mod outcome;
mod payload;
mod pipeline;
mod plainer;
mod prepare;
mod problem;
mod refine;
mod request;
mod scale_of_gains;
mod scale_told;
mod scaled_bodies;
mod score;
mod searched;
mod select;
mod settings;
mod smoothing;
mod split;
mod spread;
mod stage;
mod start;
#[cfg(test)]
mod tests;
mod tie;
mod torque_column;
mod torque_sign;
mod torques_first;
mod verdict;

pub use by_log::OfLog;
pub use calibrate::{
    Calibration, Calibrator, DetectionLimit, Named, Searched, Simulation, Smallest,
};
pub use diagnostics::{
    Curve, ForceSample, Omnibus, Probed, Proposal, ResidualForce, UNKNOWN, Unexplained, diagnose,
    proposal, unexplained,
};
pub use discriminate::{Alternative, NotSimulated, Separation, discriminate};
pub use error::StudyError;
pub use error_model::ErrorModel;
pub use establish::{Chosen, Standing, establish};
pub use fit::{Declared, fit};
pub use fitted::Fitted;
pub use judge::Found;
pub use learn::{
    LearnError, Learned, LearnedResidual, NetworkCheck, ResidualLearner, ResidualTask, learn,
};
pub use outcome::{Diagnostics, Effects, Given, Models, Outcome};
pub use pipeline::{close_loop, find, solve};
pub use prepare::{Prepared, ReadyLogs, prepare};
pub use problem::{Problem, Sample};
pub use refine::{Refined, refine, with_intervals};
pub use request::{Logs, Reference, Request};
pub use scale_told::SCALE_OF;
pub use score::{
    Contradicted, Errors, Finding, Needed, Predicted, Predictions, Scores, TestLog, TorqueErrors,
    score,
};
pub use select::{Rival, Round, Selected, Tried, candidates, screen, select};
pub use settings::{
    CalibrateSettings, CurveSettings, DiagnosticsSettings, DiscriminateSettings, EstablishSettings,
    FitSettings, LearnSettings, NoteSettings, ProposalSettings, RefineSettings, ScoreSettings,
    SelectSettings, Settings, SplitSettings, VerdictSettings,
};
pub use split::between;
pub use split::{Split, SplitMethod};
pub use stage::{Fits, Progress, Stage, StageTimes, Watch};
pub use verdict::Verdict;

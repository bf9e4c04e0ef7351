//! Closing the loop: from logs and a declared model to the effects that the model lacks.
//!
//! [`close_loop`] goes through the stages of `docs/method.md`, each a function from one type to the next: [`prepare`] the logs,
//! [`fit`] the declared model, [`screen`] the effects that it may lack, [`select`] a set of them, [`establish`] each, [`diagnose`]
//! what remains, [`discriminate`] between explanations, [`refine`], [`learn`] and [`score`]. What they work on is a [`Problem`], which
//! none of them changes.

mod by_log;
mod calibrate;
mod choose;
mod discriminate;
mod error;
mod establish;
mod every_log;
mod fit;
mod fitted;
mod gravity;
mod judge;
mod learn;
mod loss;
mod notes;
mod outcome;
mod payload;
mod pipeline;
mod prepare;
mod problem;
mod pushes;
mod refine;
mod remainder;
mod request;
mod reversal;
mod reversed;
mod score;
mod select;
mod settings;
mod space;
mod split;
mod stage;
mod start;
#[cfg(test)]
mod tests;
mod verdict;

pub use by_log::OfLog;
pub use calibrate::{
    Calibration, Calibrator, DetectionLimit, Named, Searched, Simulation, Smallest,
};
pub use discriminate::{Alternative, NotSimulated, Separation, discriminate};
pub use error::StudyError;
pub use establish::{Chosen, Standing, establish};
pub use fit::{Declared, fit};
pub use fitted::Fitted;
pub use judge::Found;
pub use learn::{
    LearnError, Learned, LearnedResidual, NetworkCheck, ResidualLearner, ResidualTask, learn,
};
pub use outcome::{Effects, Given, Models, Outcome, Remainder};
pub use pipeline::{close_loop, find, solve};
pub use prepare::{Prepared, ReadyLogs, prepare};
pub use problem::{Problem, Sample};
pub use refine::{Refined, refine, with_intervals};
pub use remainder::{
    Curve, ForceSample, Omnibus, Probed, Proposal, ResidualForce, UNKNOWN, Unexplained, diagnose,
    proposal, unexplained,
};
pub use request::{Logs, Reference, Request};
pub use score::{
    Contradicted, Errors, Finding, Needed, Predicted, Predictions, Scores, TestLog, TorqueErrors,
    score,
};
pub use select::{Rival, Round, Selected, Tried, candidates, screen, select};
pub use settings::{
    CalibrateSettings, CurveSettings, DiscriminateSettings, EstablishSettings, FitSettings,
    LearnSettings, NoteSettings, ProposalSettings, RefineSettings, RemainderSettings,
    ScoreSettings, SelectSettings, Settings, SplitSettings, VerdictSettings,
};
pub use space::Space;
pub use split::between;
pub use split::{Split, SplitMethod};
pub use stage::{Fits, Progress, Stage, StageTimes, Watch};
pub use verdict::Verdict;

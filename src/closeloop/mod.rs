//! Closing the loop: from logs and a declared model to the effects that the model lacks.
//!
//! Stages in the order of `docs/method.md`, one file or folder each: [`split`](Split) and audit, fit, select and
//! establish, test what remains, tell alternatives apart, refine, learn, score, calibrate. [`close_loop`] goes
//! through all of them.

mod by_log;
mod calibrate;
mod choose;
mod discriminate;
mod error;
mod establish;
mod every_log;
mod find;
mod fit;
mod fitted;
mod gravity;
mod learn;
mod outcome;
mod payload;
mod pushes;
mod refine;
mod remainder;
mod request;
mod reversal;
mod reversed;
mod run;
mod score;
mod select;
mod settings;
mod space;
mod split;
mod stage;
mod start;
mod study;
#[cfg(test)]
mod tests;
mod verdict;

pub use by_log::OfLog;
pub use calibrate::{
    Calibration, Calibrator, DetectionLimit, Named, Searched, Simulation, Smallest,
};
pub use discriminate::{Alternative, NotSimulated, Separation};
pub use error::StudyError;
pub use establish::Standing;
pub use find::{Chosen, Found, find};
pub use fitted::Fitted;
pub use learn::{
    LearnError, Learned, LearnedResidual, NetworkCheck, ResidualLearner, ResidualTask,
};
pub use outcome::{Effects, Given, Models, Outcome, Remainder};
pub use refine::with_intervals;
pub use remainder::{
    Curve, ForceSample, Omnibus, Probed, Proposal, ResidualForce, UNKNOWN, Unexplained, proposal,
    unexplained,
};
pub use request::{Logs, Reference, Request};
pub use run::close_loop;
pub use score::{Contradicted, Errors, Finding, TestLog, TorqueErrors};
pub use select::{Rival, Round, Tried};
pub use settings::{
    CalibrateSettings, CurveSettings, DiscriminateSettings, EstablishSettings, FitSettings,
    LearnSettings, ProposalSettings, RefineSettings, RemainderSettings, ScoreSettings,
    SelectSettings, Settings, SplitSettings, VerdictSettings,
};
pub use space::Space;
pub(crate) use split::between;
pub use split::{Split, SplitMethod};
pub use stage::{Fits, Observer, Progress, Stage};
pub use study::Study;
pub use verdict::Verdict;

//! mujoco.sysid, the identification toolbox of MuJoCo, on a fold: it fits the exported model with its given structure,
//! and MuJoCo simulates the windows of the test logs, which are scored here.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::errors::{LogErrors, Squares};
use residyn_core::closeloop::Settings;
use residyn_core::data::{Log, half_width_s};
use residyn_core::model::Model;
use residyn_core::sim::metric::windows;
use residyn_core::sim::{Integrator, initial_state};
use residyn_formats::{ExportModel, PythonClient, find};
use residyn_io::files::content_id;

const CLIENT: PythonClient = PythonClient {
    name: "mujoco_sysid.py",
    script: include_str!("mujoco_sysid.py"),
    packages: "'mujoco[sysid]>=4'",
};
/// Training logs are cut into pieces of this length \[s\], each with its own start state: the longest horizon of the
/// scores.
const PIECE_S: f64 = 1.0;

/// Logs to fit the model to and logs to simulate with it.
#[derive(Debug, Serialize)]
struct Question<'a> {
    train: Vec<Recorded<'a>>,
    test: Vec<Recorded<'a>>,
}

/// A log and the windows that are simulated, by horizon.
#[derive(Debug, Serialize)]
struct Recorded<'a> {
    time: &'a [f64],
    q: &'a [Vec<f64>],
    tau: &'a [Vec<f64>],
    windows: Vec<Vec<Start>>,
}

/// Rows of a window, and angles and velocities at its first row.
#[derive(Debug, Serialize)]
struct Start {
    first: usize,
    last: usize,
    state: Vec<f64>,
}

#[derive(Debug, Deserialize)]
struct Reply {
    /// `[log][horizon][window][joint][row]`: angles at the rows of each window after its first \[rad\].
    predicted: Vec<Vec<Vec<Vec<Vec<f64>>>>>,
}

/// A MuJoCo prediction that reaches this angle has diverged \[rad\], as in the script.
const SENSIBLE: f64 = 1e4;

/// The input of the toolbox.
pub struct Task<'a> {
    /// The declared model in MuJoCo's format.
    mjcf: Vec<u8>,
    question: Question<'a>,
}

impl<'a> Task<'a> {
    /// Fit `model` to the training logs; without training logs it is simulated as it is.
    ///
    /// # Errors
    /// A model that MuJoCo's format cannot carry.
    pub fn new(model: &Model, train: &'a [Log], test: &'a [Log]) -> anyhow::Result<Self> {
        let origin = serde_json::Value::Null;
        let exported = ExportModel::of_system(model, Integrator::RK4, PIECE_S, origin);
        let format = find("mjcf").expect("the format is known");
        let mut files = (format.files)(&exported, Path::new("model.xml"))?;
        let horizons_s = Settings::default().score.horizons_s;
        Ok(Self {
            mjcf: files.swap_remove(0).bytes,
            question: Question {
                // Windows overlap by half: every second one covers the log once.
                train: train
                    .iter()
                    .map(|log| Recorded::of(log, &[PIECE_S], 2))
                    .collect(),
                test: test
                    .iter()
                    .map(|log| Recorded::of(log, &horizons_s, 1))
                    .collect(),
            },
        })
    }

    /// Changes with everything that the result depends on, except the versions of the Python packages.
    pub fn fingerprint(&self) -> String {
        let mut bytes = serde_json::to_vec(&self.question).expect("logs are finite numbers");
        bytes.extend(&self.mjcf);
        bytes.extend(CLIENT.script.as_bytes());
        content_id(&bytes)
    }

    /// Fit and simulate; the errors on each test log.
    ///
    /// # Errors
    /// No Python with the toolbox, or one that fails.
    pub fn run(&self) -> anyhow::Result<Vec<LogErrors>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("model.xml");
        std::fs::write(&path, &self.mjcf)?;
        let reply: Reply = CLIENT.ask(&path, &self.question)?;
        let logs = self.question.test.iter().zip(&reply.predicted);
        Ok(logs.map(|(log, predicted)| log.errors(predicted)).collect())
    }
}

impl<'a> Recorded<'a> {
    /// A log with every `stride`-th window of each horizon.
    fn of(log: &'a Log, horizons_s: &[f64], stride: usize) -> Self {
        let half_width = half_width_s(log.median_step());
        let start = |first| initial_state(log, half_width, first).expect("windows() checks this");
        let of_horizon = |&horizon_s: &f64| {
            let windows = windows(0, log, horizon_s).into_iter().step_by(stride);
            let starts = windows.map(|window| Start {
                first: window.first,
                last: window.last,
                state: start(window.first),
            });
            starts.collect()
        };
        Self {
            time: &log.time,
            q: &log.q,
            tau: &log.tau,
            windows: horizons_s.iter().map(of_horizon).collect(),
        }
    }

    fn errors(&self, predicted: &[Vec<Vec<Vec<f64>>>]) -> LogErrors {
        let of_horizon = |(starts, predicted): (&Vec<Start>, &Vec<Vec<Vec<f64>>>)| {
            let windows = starts.iter().zip(predicted);
            let squares: Vec<Squares> = windows
                .map(|(start, predicted)| self.squares(start, predicted))
                .collect();
            Squares::pooled(&squares)
        };
        self.windows.iter().zip(predicted).map(of_horizon).collect()
    }

    fn squares(&self, start: &Start, predicted: &[Vec<f64>]) -> Squares {
        let logged = self.q.iter().map(|q| &q[start.first + 1..=start.last]);
        let pairs = logged
            .zip(predicted)
            .flat_map(|(q, predicted)| q.iter().zip(predicted));
        let diverged = predicted
            .iter()
            .flatten()
            .any(|angle| angle.abs() >= SENSIBLE);
        let count = (start.last - start.first) * self.q.len();
        Squares::of_window(pairs.map(|(q, p)| (q - p).powi(2)).sum(), count, diverged)
    }
}

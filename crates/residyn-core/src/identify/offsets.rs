use thiserror::Error;

use super::{FitError, Shooting, fit};
use crate::data::{Interval, Joint, Log};
use crate::expr::Graph;
use crate::model::{Dynamics, InternalStates, Parameter, PerLogValue};
use crate::sim::cut;

/// A model with an unknown sensor offset per joint and log.
#[derive(Debug, Clone)]
pub struct Offsets {
    /// Each log's offsets are per-log values.
    pub dynamics: Dynamics,
    /// The sensor offsets in rad (or m), `[log][joint]`.
    pub offsets: Vec<Vec<f64>>,
}

/// Why offsets could not be estimated.
#[derive(Debug, Error)]
pub enum CalibrateError {
    #[error(
        "a calibration on the fraction {0} of each log is not possible; give a number above 0 and below 1"
    )]
    Fraction(f64),
    #[error("{log}: its first {seconds:.2} s do not determine its sensor offsets: {source}")]
    Fit {
        log: String,
        seconds: f64,
        source: FitError,
    },
}

/// Length in s of the windows over which offsets are estimated.
const WINDOW_S: f64 = 0.5;

/// Estimate the sensor offsets of each log on its first `fraction`, which is then left out of the log.
///
/// # Errors
/// A fraction outside 0 to 1, or a beginning that is too short.
pub fn calibrate(
    dynamics: &Dynamics,
    logs: &mut [Log],
    fraction: f64,
) -> Result<Offsets, CalibrateError> {
    if !(fraction > 0.0 && fraction < 1.0) {
        return Err(CalibrateError::Fraction(fraction));
    }
    calibrate_on(dynamics, logs, |log| fraction * log.duration())
}

/// The same on the first `seconds` of each log.
///
/// # Errors
/// A beginning that is too short.
pub fn calibrate_first(
    dynamics: &Dynamics,
    logs: &mut [Log],
    seconds: f64,
) -> Result<Offsets, CalibrateError> {
    calibrate_on(dynamics, logs, |_| seconds)
}

fn calibrate_on(
    dynamics: &Dynamics,
    logs: &mut [Log],
    seconds_of: impl Fn(&Log) -> f64,
) -> Result<Offsets, CalibrateError> {
    let mut found = Offsets {
        dynamics: with_offsets(dynamics),
        offsets: Vec::new(),
    };
    for log in logs {
        let seconds = seconds_of(log);
        let start_s = log.time[0];
        let rest = Interval {
            start_s: start_s + seconds,
            end_s: f64::INFINITY,
        };
        let mut beginning = log.clone();
        beginning.leave_out.push(rest);
        let first = dynamics.parameters.len();
        let offsets =
            estimate(&found.dynamics, first, beginning).map_err(|source| CalibrateError::Fit {
                log: log.name(),
                seconds,
                source,
            })?;
        let own = |(parameter, &value): (usize, &f64)| PerLogValue {
            log: log.path.display().to_string(),
            parameter,
            value,
            ci95: None,
        };
        found.dynamics.own.extend((first..).zip(&offsets).map(own));
        found.offsets.push(offsets);
        log.leave_out.push(Interval {
            start_s,
            end_s: start_s + seconds,
        });
    }
    Ok(found)
}

/// The offsets on a log, which are the parameters from `first` on.
fn estimate(dynamics: &Dynamics, first: usize, log: Log) -> Result<Vec<f64>, FitError> {
    let logs = [log];
    let noise = vec![1e-3; dynamics.joints];
    let shooting = Shooting::new(&logs, cut(&logs, WINDOW_S), &noise);
    let active: Vec<usize> = (first..dynamics.parameters.len()).collect();
    let start_states = shooting.initial_start_states(0);
    let (found, _) = fit(&shooting, dynamics, &active, start_states, None)?;
    Ok(found.common[first..].to_vec())
}

/// The same equations in logged angles: the true angle is the logged one minus the offset.
fn with_offsets(dynamics: &Dynamics) -> Dynamics {
    let n = dynamics.joints;
    let mut graph = Graph::new();
    let mut inputs: Vec<_> = dynamics
        .program
        .inputs()
        .iter()
        .map(|name| graph.input(name))
        .collect();
    let mut parameters = dynamics.parameters.clone();
    let logged = inputs[..n].to_vec();
    for (joint, input) in Joint::all(n).zip(&mut inputs[..n]) {
        // Names with spaces cannot occur in formulas, so this name is free.
        let name = format!("offset of q{joint}");
        let offset = graph.input(&name);
        *input = graph.sub(*input, offset);
        parameters.push(Parameter {
            name,
            value: 0.0,
            unit: "rad".into(),
            bounds: [-1.0, 1.0],
            fixed: false,
            per_log: false,
            per_group: false,
            ci95: None,
            scale: 0.01,
        });
    }
    let internal = dynamics.internal.as_ref().map(|internal| {
        let (mut of_rates, mut of_starts) = (graph.clone(), Graph::new());
        let names = parameters.iter().map(|parameter| &parameter.name);
        let values: Vec<_> = names.map(|name| of_starts.input(name)).collect();
        let rates = of_rates.append(&internal.rates, &inputs);
        let starts = of_starts.append(&internal.starts, &values[..dynamics.parameters.len()]);
        InternalStates {
            rates: of_rates.finish(&rates),
            starts: of_starts.finish(&starts),
            ..internal.clone()
        }
    });
    let outputs = graph.append(&dynamics.program, &inputs);
    let reading = dynamics.reading.as_ref().map(|reading| {
        let mut graph = graph.clone();
        let shown = graph.append(reading, &inputs);
        let with_offset: Vec<_> = (shown.into_iter().zip(&logged).zip(&inputs))
            .map(|((shown, logged), own)| {
                let offset = graph.sub(*logged, *own);
                graph.add(shown, offset)
            })
            .collect();
        graph.finish(&with_offset)
    });
    Dynamics {
        name: dynamics.name.clone(),
        joints: n,
        measured: dynamics.measured.clone(),
        parameters,
        program: graph.finish(&outputs),
        internal,
        filters: dynamics.filters.clone(),
        reading,
        // The offsets replace what differs between single logs.
        own: (dynamics.own.iter())
            .filter(|own| dynamics.parameters[own.parameter].per_group)
            .cloned()
            .collect(),
        configurations: dynamics.configurations.clone(),
    }
}

//! What tells the scale of forces on a rig whose drives' gains are sought: twice the gain moves bodies of twice the mass, with
//! twice the friction, in the same way.

use nalgebra::{DMatrix, DVector};

use super::bodies_off::BodiesOff;
use super::drive_gain::LEAST;
use super::fitted::Fitted;
use super::problem::Problem;
use crate::data::{Audit, Finding, Joint, Log, Severity};
use crate::decomposition::eigen;
use crate::identify::with_unit_diagonal;
use crate::model::Model;

/// How a finding on what tells the scale of some gains begins.
pub const SCALE_OF: &str = "the scale of ";

/// By how much wider an interval is without what tells its value.
const WIDER: f64 = 2.0;

/// A direction in which a share of the information this small is left is not known at all.
const NOTHING: f64 = 1e-12;

/// Report in the first log's audit what tells each gain of a drive, found or free, if the law of the drives gives the
/// torques.
pub(super) fn report_scale(problem: &Problem<'_>, fitted: &Fitted, audits: &mut [Audit]) {
    let gains = gains(&fitted.model);
    if !problem.is_by_law() || gains.is_empty() {
        return;
    }
    let variances = Variances::of(problem, fitted);
    let source = |parameter: usize| {
        let columns = fitted.fit.columns_of(|own| own == parameter);
        Some(variances.source(*columns.first()?))
    };
    let told: Vec<(String, Source)> = (gains.into_iter())
        .filter_map(|(name, parameter)| Some((name, source(parameter)?)))
        .collect();
    for (source, text) in SOURCES {
        let own = told.iter().filter(|(_, of)| *of == source);
        let names: Vec<&str> = own.map(|(name, _)| name.as_str()).collect();
        if let (false, Some(audit)) = (names.is_empty(), audits.first_mut()) {
            let text = format!("{SCALE_OF}{}: {text}", names.join(", "));
            audit.add(Finding::new(Severity::Info, text));
        }
    }
}

/// Report in the first log's audit the limbs whose bodies are all off the declared ones by one factor, if nothing tells it
/// from one of the gains of all their drives.
pub(super) fn report_scaled_limbs(problem: &Problem<'_>, fitted: &Model, audits: &mut [Audit]) {
    let mut logs = problem.logs.iter();
    if !problem.is_by_law() || logs.any(|log| problem.declared.has_known_load(log)) {
        return;
    }
    for joints in problem.declared.limbs() {
        let bodies = BodiesOff::of(&problem.declared.limb(&joints), fitted);
        let common = bodies.common();
        let p_value = bodies.p_of_nearer(bodies.beside(common), bodies.beside(0.0), 1);
        let is_shown = p_value < problem.settings.establish.uncorrected_false_alarm;
        if !is_shown || common.abs() < LEAST.ln_1p() {
            continue;
        }
        let (factor, joints) = (common.exp(), joints.iter().map(Joint::to_string));
        let text = format!(
            "the bodies that joints {} move are all about {factor:.2} times as heavy as declared: if they are as declared, the \
             gains of all these drives are {:.2} times those in the file. A known load in some of the logs would tell which",
            joints.collect::<Vec<_>>().join(", "),
            1.0 / factor,
        );
        if let Some(audit) = audits.first_mut() {
            audit.add(Finding::new(Severity::Warning, text));
        }
    }
}

/// The gains that a fit of the model finds, and their places among its parameters.
fn gains(model: &Model) -> Vec<(String, usize)> {
    let of_law = model.free_of_law().into_iter();
    let of_law = of_law.map(|k| (model.parameters[k].name.clone(), k));
    let effects = model.effects.iter().enumerate();
    let of_effects = effects.filter_map(|(k, own)| {
        let is_gain = !own.fixed && own.gain().is_some();
        let name = || format!("{} on joint {}", own.effect.name, own.joint);
        is_gain.then(|| (name(), model.place_of(k).start))
    });
    of_law.chain(of_effects).collect()
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Load,
    Bodies,
    Drives,
}

/// What is said of the gains that each tells.
const SOURCES: [(Source, &str); 3] = [
    (Source::Load, "the logs with a known load tell it"),
    (
        Source::Bodies,
        "only the declared bodies tell it: with others all forces would have another scale. A known load in some of the \
         logs would tell it",
    ),
    (
        Source::Drives,
        "the logs tell it, by the drives whose gains are held",
    ),
];

/// Variances of the free values of a fit, with and without what may tell the scale.
struct Variances {
    all: DVector<f64>,
    /// None if no log has a known load.
    without_load: Option<DVector<f64>>,
    without_bodies: DVector<f64>,
}

impl Variances {
    fn of(problem: &Problem<'_>, fitted: &Fitted) -> Self {
        let is_loaded = |log: &Log| usize::from(problem.declared.has_known_load(log));
        let loaded: Vec<usize> = problem.logs.iter().map(is_loaded).collect();
        let windows = problem.shooting.windows.iter();
        let groups: Vec<usize> = windows.map(|window| loaded[window.log]).collect();
        let by_load = fitted.fit.equations_by(&groups);
        let logs = fitted.fit.equations().hessian;
        let all = fitted.fit.information();
        let bodies = &all - &logs;
        let without_load = (by_load.len() == 2).then(|| &by_load[0].hessian + &bodies);
        Self {
            all: variances(&all),
            without_load: without_load.as_ref().map(variances),
            without_bodies: variances(&logs),
        }
    }

    /// What tells a free value.
    fn source(&self, column: usize) -> Source {
        let is_wider = |without: &DVector<f64>| without[column] > WIDER * WIDER * self.all[column];
        if self.without_load.as_ref().is_some_and(is_wider) {
            Source::Load
        } else if is_wider(&self.without_bodies) {
            Source::Bodies
        } else {
            Source::Drives
        }
    }
}

/// The variance of each free value, the others unknown, huge where this information does not tell it.
fn variances(information: &DMatrix<f64>) -> DVector<f64> {
    let (scaled, unit) = with_unit_diagonal(information);
    let Some(eigen) = eigen(scaled) else {
        return DVector::from_element(unit.len(), f64::INFINITY);
    };
    let known = eigen.eigenvalues.map(|value| 1.0 / value.max(NOTHING));
    let squares = eigen.eigenvectors.map(|part| part * part);
    (squares * known).component_mul(&unit.map(|unit| unit * unit))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{Source, Variances, variances};

    /// A gain and a mass of which the logs show the ratio alone.
    fn ratio() -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 2, &[100.0, -100.0, -100.0, 100.0])
    }

    fn knowing(gain: f64, mass: f64) -> DMatrix<f64> {
        DMatrix::from_diagonal(&vec![gain, mass].into())
    }

    #[test]
    fn what_is_wide_without_it_tells_the_scale() {
        let bodies = knowing(0.0, 1.0);
        let told = |by_logs: DMatrix<f64>, without_load: Option<DMatrix<f64>>| {
            let known = Variances {
                all: variances(&(&by_logs + &bodies)),
                without_load: without_load.map(|logs| variances(&(logs + &bodies))),
                without_bodies: variances(&by_logs),
            };
            known.source(0)
        };
        assert_eq!(told(ratio(), None), Source::Bodies);
        let loaded = ratio() + knowing(0.0, 50.0);
        assert_eq!(told(loaded.clone(), Some(ratio())), Source::Load);
        // A load that adds nothing, on logs that know the gain already.
        assert_eq!(told(loaded.clone(), Some(loaded)), Source::Drives);
        assert_eq!(told(ratio() + knowing(50.0, 0.0), None), Source::Drives);
    }
}

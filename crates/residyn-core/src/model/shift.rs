//! Declared parameters that are held fixed although the rig may have another value.

use super::Parameter;
use super::effect::{ActsOn, AlikeOn, Effect, EffectParameter, Entry, Hold, Measure, ShowsIn};
use super::fitted::FittedEffect;
use super::reader::Located;
use super::system::{Model, Motion};
use crate::data::Joint;
use crate::expr::{Formula, parse};

/// The name of the effect.
const NAME: &str = "parameter_shift";
/// Gravity is the same on every rig: parameters in this unit are not shifted.
const UNIT_OF_GRAVITY: &str = "m/s^2";
/// A positive parameter keeps at least this share of its declared value.
const LEAST: f64 = 1e-3;

impl Model {
    /// For each parameter that the file declares fixed, the effect that gives it another value: on the outermost joint
    /// whose equation it enters, still at zero.
    pub fn shifts(&self) -> Vec<FittedEffect> {
        // A value that is known to differ between logs is not in doubt.
        let fixed = |(k, p): &(usize, &Parameter)| {
            p.fixed && p.unit != UNIT_OF_GRAVITY && !self.differs(*k)
        };
        let all = self.parameters.iter().enumerate();
        all.filter(fixed)
            .filter_map(|(k, p)| {
                let joint = self.outermost_joint(&p.name)?;
                Some(FittedEffect::absent(&shift(k, p), joint))
            })
            .collect()
    }

    /// The last joint in whose equation a parameter appears, directly or through intermediates.
    fn outermost_joint(&self, parameter: &str) -> Option<Joint> {
        let mut carriers = vec![parameter];
        let carries = |formula: &Formula, carriers: &[&str]| {
            formula
                .names()
                .iter()
                .any(|name| carriers.contains(&&**name))
        };
        for (name, formula) in &self.equations.lets {
            if carries(&formula.value, &carriers) {
                carriers.push(name);
            }
        }
        let enters = |formula: &Located<Formula>| carries(&formula.value, &carriers);
        let last = |enters: &dyn Fn(&Joint) -> bool| Joint::all(self.joints).rev().find(enters);
        match &self.equations.motion {
            Motion::Accelerations(formulas) => last(&|joint| enters(&formulas[*joint])),
            Motion::MassAndBias { mass, bias } => last(&|joint| {
                let mut row = mass[*joint].iter().chain([&bias[*joint]]);
                row.any(enters)
            }),
            Motion::Tree(bodies) => bodies.outermost(enters),
        }
    }
}

fn shift(k: usize, declared: &Parameter) -> Effect {
    let formula = parse(&declared.name).expect("a parameter's name is a formula");
    let [low, high] = declared.bounds;
    let least = if low == 0.0 {
        LEAST * declared.value
    } else {
        low
    };
    Effect {
        name: NAME.into(),
        about: format!("`{}` differs from its declared value", declared.name),
        entry: Entry::Shift(k, formula),
        parameters: vec![EffectParameter {
            name: declared.name.clone(),
            unit: declared.unit.clone(),
            about: "actual value minus the declared one".into(),
            typical: 0.1 * declared.scale,
            bounds: [least - declared.value, high - declared.value],
            starts: vec![0.0],
            measure: Measure::One,
            whole: false,
            per_log: false,
            hold: Hold::Never,
        }],
        states: Vec::new(),
        valid_if: None,
        contains: Vec::new(),
        refines: false,
        confused_with: vec!["actuator_gain".into(), "rotor_inertia".into()],
        shown_by: format!(
            "a measurement of `{}` itself, or motion after it has been changed by a known amount",
            declared.name
        ),
        acts_on: ActsOn::All,
        shows_in: ShowsIn::Any,
        alike_on: AlikeOn::None,
        baseline: None,
    }
}

impl FittedEffect {
    /// The declared parameter that the effect shifts, if it is a shift.
    pub fn shifted(&self) -> Option<usize> {
        match self.effect.entry {
            Entry::Shift(k, _) => Some(k),
            _ => None,
        }
    }

    /// The effect's name, with the name of the parameter that it shifts.
    pub fn title(&self) -> String {
        match self.shifted() {
            Some(_) => format!("{NAME} of {}", self.effect.parameters[0].name),
            None => self.effect.name.clone(),
        }
    }
}

impl Model {
    /// The same model with each shift added to the declared value that it shifts.
    #[must_use]
    pub fn absorbed(&self) -> Self {
        let all = self.all_parameters();
        let mut absorbed = self.clone();
        absorbed.effects.retain(|effect| effect.shifted().is_none());
        for (effect, place) in self.placed() {
            if let Some(k) = effect.shifted() {
                absorbed.parameters[k] = self.parameters[k].shifted_by(&all[place.start]);
            }
        }
        absorbed
    }
}

impl Parameter {
    /// A declared parameter with its actual value, given its fitted `shift`.
    #[must_use]
    pub fn shifted_by(&self, shift: &Self) -> Self {
        let moved = |[low, high]: [f64; 2]| [self.value + low, self.value + high];
        Self {
            value: self.value + shift.value,
            ci95: shift.ci95.map(moved),
            ..self.clone()
        }
    }

    /// `m2 = 0.62 (declared 0.5)`
    pub fn expression_of_shift(&self, actual: f64) -> String {
        let digits: f64 = format!("{actual:.3e}").parse().unwrap_or(actual);
        format!("{} = {digits} (declared {})", self.name, self.value)
    }
}

//! One rig drawn at random.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::rules::{Kind, Rules, StandIn};
use super::size::Size;
use crate::condition::{Condition, Driving};
use crate::grid::Simulation;
use crate::hidden::Hidden;
use crate::machine::Machine;
use crate::mechanics::Mechanics;
use crate::sensors::Flaws;
use residyn_core::data::Joint;
use residyn_core::model::Model;
use residyn_core::rng;

/// The recipe that a rig is drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    pub mechanics: Mechanics,
    pub driving: Driving,
    /// Typical top speed of each joint \[rad/s\].
    pub speed: Vec<f64>,
    pub rules: Rules,
    /// Number of library effects, and of effects that the library lacks.
    pub effects: usize,
    pub outside: usize,
}

/// A rig as it was drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    pub simulation: Simulation,
    /// Library effects come first.
    pub effects: Vec<Hidden>,
    /// For each effect that the library lacks, the effects that are fitted in its place.
    pub stand_ins: Vec<Vec<Hidden>>,
}

impl Recipe {
    /// Whether a rig can be drawn.
    ///
    /// # Errors
    /// Why not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let joints = self.mechanics.joints();
        if self.speed.len() != joints {
            return Err(format!(
                "the plant needs {joints} numbers in `speed`, one per joint"
            ));
        }
        let rng = &mut rng(0);
        let drawn = self.draw(rng)?;
        let all = self.rules.effects.iter().chain(&self.rules.outside);
        for (name, kind) in all {
            for joint in Joint::all(joints) {
                let effect = self.hidden(name, joint, &kind.values, self.scales(joint), rng)?;
                if kind.joint.is_none_or(|only| only == joint) {
                    Machine::with(self.mechanics.clone(), &[effect])?;
                }
            }
        }
        drawn.simulation.condition.check()
    }

    /// A rig.
    ///
    /// # Errors
    /// Rules that leave no effect to draw, or name an unknown scale.
    pub fn draw(&self, rng: &mut impl Rng) -> Result<Drawn, String> {
        let mut drawn = Drawn {
            simulation: Simulation {
                mechanics: self.mechanics.clone(),
                driving: self.driving.clone(),
                condition: self.condition(rng)?,
            },
            effects: Vec::new(),
            stand_ins: vec![Vec::new(); self.outside],
        };
        for place in 0..self.effects + self.outside {
            self.draw_effect(&mut drawn, place, rng)?;
        }
        Ok(drawn)
    }

    /// Draw or redraw the effect at this index.
    ///
    /// # Errors
    /// As [`Recipe::draw`].
    pub fn draw_effect(
        &self,
        drawn: &mut Drawn,
        place: usize,
        rng: &mut impl Rng,
    ) -> Result<(), String> {
        if place < drawn.effects.len() {
            drawn.effects.remove(place);
        }
        let all = self.kinds(place).iter().flat_map(|(name, kind)| {
            let joints = Joint::all(self.mechanics.joints());
            let fits = |joint: &Joint| kind.joint.is_none_or(|only| only == *joint);
            joints.filter(fits).map(move |joint| (name, kind, joint))
        });
        let open: Vec<_> = all
            .filter(|(name, _, joint)| self.allows(&drawn.effects, name, *joint))
            .collect();
        let total: f64 = open.iter().map(|(_, kind, _)| kind.weight).sum();
        let mut left = total * rng.random::<f64>();
        let chosen = open.iter().find(|(_, kind, _)| {
            left -= kind.weight;
            left <= 0.0
        });
        let (name, kind, joint) = chosen.ok_or("the rules leave no effect to draw")?;
        let hidden = self.hidden(name, *joint, &kind.values, self.scales(*joint), rng)?;
        if place >= self.effects {
            drawn.stand_ins[place - self.effects] = self.stand_ins(&hidden, rng)?;
        }
        drawn.effects.insert(place, hidden);
        Ok(())
    }

    /// The effects that may be drawn at this index.
    fn kinds(&self, place: usize) -> &BTreeMap<String, Kind> {
        if place < self.effects {
            &self.rules.effects
        } else {
            &self.rules.outside
        }
    }

    fn allows(&self, present: &[Hidden], name: &str, joint: Joint) -> bool {
        let mut on_joint = present.iter().filter(|other| other.joint == joint);
        on_joint.all(|other| self.rules.allow(name, &other.name))
    }

    /// Values from which the free parameters of the model file start, given the true ones.
    ///
    /// # Errors
    /// A free parameter whose true value is not known.
    pub fn start(
        &self,
        model: &Model,
        declared: &BTreeMap<String, f64>,
        rng: &mut impl Rng,
    ) -> Result<BTreeMap<String, f64>, String> {
        let factor = self.rules.start.plain(rng)?;
        let free = model.parameters.iter().filter(|parameter| !parameter.fixed);
        free.map(|parameter| {
            let name = &parameter.name;
            let value = declared.get(name);
            let value = value.ok_or_else(|| format!("the true value of `{name}` is not known"))?;
            let off = factor.powf(rng.random_range(-1.0..=1.0));
            Ok((name.clone(), value * off))
        })
        .collect()
    }

    /// Scales for the numbers of effects on a joint.
    fn scales(&self, joint: Joint) -> BTreeMap<String, f64> {
        let (torque, speed) = (self.driving.torque[joint], self.speed[joint]);
        let inertia = self.mechanics.mass([0.0; 2])[joint.index()][joint.index()];
        let scales = [
            ("torque", torque),
            ("speed", speed),
            ("inertia", inertia),
            ("torque/speed", torque / speed),
            ("torque/speed^2", torque / speed.powi(2)),
            ("torque/speed^3", torque / speed.powi(3)),
        ];
        scales.map(|(name, value)| (name.to_owned(), value)).into()
    }

    fn hidden(
        &self,
        name: &str,
        joint: Joint,
        sizes: &BTreeMap<String, Size>,
        mut scales: BTreeMap<String, f64>,
        rng: &mut impl Rng,
    ) -> Result<Hidden, String> {
        let mut values = BTreeMap::new();
        for (parameter, size) in sizes {
            let drawn = size.draw(&scales, rng);
            let value = drawn.map_err(|why| format!("`{name}`: `{parameter}`: {why}"))?;
            scales.insert(parameter.clone(), value);
            values.insert(parameter.clone(), value);
        }
        Ok(Hidden {
            name: name.to_owned(),
            joint,
            values,
        })
    }

    fn stand_ins(&self, outside: &Hidden, rng: &mut impl Rng) -> Result<Vec<Hidden>, String> {
        let mut scales = self.scales(outside.joint);
        scales.extend(outside.values.clone());
        let stand_ins = self.rules.outside[&outside.name].stand_ins.iter();
        let hidden =
            |of: &StandIn| self.hidden(&of.name, outside.joint, &of.values, scales.clone(), rng);
        stand_ins.map(hidden).collect()
    }

    fn condition(&self, rng: &mut impl Rng) -> Result<Condition, String> {
        let rules = &self.rules.condition;
        let mut loops = rules.loops.clone();
        while loops.len() > 2 {
            loops.remove(rng.random_range(0..loops.len()));
        }
        if rules.filter_s.is_empty() {
            return Err("`filter_s` needs a number".to_owned());
        }
        let mut plain = |size: &Option<Size>| match size {
            Some(size) => size.plain(rng),
            None => Ok(0.0),
        };
        let (stamps_s, repeated) = (plain(&rules.stamps_s)?, plain(&rules.repeated)?);
        let quantum = TAU / 2.0_f64.powf(rules.bits.plain(rng)?);
        Ok(Condition {
            drive: loops,
            rate_hz: rules.rate_hz.plain(rng)?,
            noise: quantum * rules.noise.plain(rng)?,
            quantum,
            logs: rules.logs.count(rng)?,
            seconds: rules.seconds.plain(rng)?,
            flaws: Flaws {
                jitter: rules.jitter.plain(rng)?,
                stamps_s,
                repeated,
                dropped: rules.dropped.plain(rng)?,
                burst: rules.burst.count(rng)?,
                torque_noise: rules.torque_noise.plain(rng)?,
                torque_quantum: rules.torque_quantum.plain(rng)?,
                filter_s: rules.filter_s[rng.random_range(0..rules.filter_s.len())],
            },
        })
    }
}

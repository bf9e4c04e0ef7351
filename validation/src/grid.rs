//! A grid file: plants, conditions, and series of cells that combine them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::arm::{Arm, Column, Lacks};
use super::condition::{Condition, Driving, check_rows};
use super::draw::{Recipe, Rules};
use super::hidden::Hidden;
use super::machine::Machine;
use super::mechanics::Mechanics;
use super::robot::{Build, Hides, Robot};
use super::sensors::Flaws;
use residyn_core::limits::{CELLS, check_readings};
use residyn_core::toml_text::from_toml;
use residyn_io::files::{beside_or_named, read_text};

/// Why a grid cannot be run.
#[derive(Debug, Error)]
pub enum GridError {
    #[error("{path}: cannot be read: {source}", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
}

/// The test that a series of cells makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// One effect is missing and has to be named.
    Single,
    /// Two are missing and both have to be named.
    Pair,
    /// Two to five are missing in a rig drawn by chance and all have to be named.
    Several,
    /// Two or three are missing on each of many joints, and count joint by joint.
    Joints,
    /// As above, but the program is told which, and its intervals have to hold the truth.
    Told,
    /// Nothing is missing, as the model declares all effects of the rig, and nothing may be named.
    None,
    /// An effect that the library lacks is missing; it has to be flagged.
    Outside,
    /// Rows repeat readings: what is named has to be what is named without.
    Repeated,
}

/// A simulated rig and the model that is declared for it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plant {
    /// A model file, as seen from the grid, or the name of a built-in system.
    model: PathBuf,
    mechanics: Mechanics,
    driving: Driving,
    /// Typical top speed of each joint \[rad/s\], which scales the drawn effects.
    #[serde(default)]
    speed: Vec<f64>,
}

/// Rigs drawn at random: each number of effects on each plant in turn.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Draws {
    /// The part of a cell's name before its number.
    name: String,
    group: Group,
    plants: Vec<String>,
    /// First and last number of its cells.
    numbers: [u64; 2],
    /// How many library effects a rig hides.
    effects: Vec<usize>,
    /// How many effects from outside the library it hides.
    #[serde(default)]
    outside: usize,
}

/// Arms of many joints: what each model lacks is drawn at random, from these kinds in turn.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Arms {
    /// The part of a cell's name before the kind of effect and the number.
    name: String,
    /// A model file, relative to the grid.
    model: PathBuf,
    lacks: Vec<Lacks>,
    /// First and last number of the cells of each kind.
    numbers: [u64; 2],
    bodies: [f64; 2],
    amplitude: Vec<f64>,
    rate_hz: f64,
    seconds: Vec<f64>,
    noise: [f64; 2],
    #[serde(default)]
    column: Column,
}

/// Position-controlled robots, which hide one kind of thing after the other.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Robots {
    /// The part of a cell's name before what it hides and the number.
    name: String,
    /// A model file, relative to the grid.
    model: PathBuf,
    hides: Vec<Hides>,
    /// First and last number of the cells of each kind.
    numbers: [u64; 2],
    build: Build,
    /// Of the logs of a robot: the next robot, and the next kind's first, have the next ones.
    flaws: Vec<Flaws>,
}

/// Every set of effects under every condition with every seed.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Series {
    group: Group,
    plant: String,
    conditions: Vec<String>,
    seeds: Vec<u64>,
    effects: Vec<Vec<Hidden>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    plants: BTreeMap<String, Plant>,
    #[serde(default)]
    conditions: BTreeMap<String, Condition>,
    #[serde(default)]
    series: Vec<Series>,
    /// By which rigs are drawn.
    rules: Option<Rules>,
    #[serde(default)]
    draws: Vec<Draws>,
    #[serde(default)]
    arms: Vec<Arms>,
    #[serde(default)]
    robots: Vec<Robots>,
}

/// One test: a rig with its effects, how its logs are taken, and a seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Unique in its grid: plant, effects, condition and seed.
    pub id: String,
    pub group: Group,
    pub plant: String,
    /// The name of the condition, or of the program that recorded the logs.
    pub condition: String,
    pub effects: Vec<Hidden>,
    pub seed: u64,
    /// A model file, or the name of a built-in system.
    pub model: PathBuf,
    /// Values of declared parameters in place of the model file's.
    #[serde(default)]
    pub start: BTreeMap<String, f64>,
    pub source: Source,
}

/// A simulated rig and how its logs are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Simulation {
    pub mechanics: Mechanics,
    pub driving: Driving,
    pub condition: Condition,
}

/// Where the logs of a cell come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Recorded on demand.
    Simulated(Box<Simulation>),
    /// A rig that is drawn on demand.
    Drawn(Box<Recipe>),
    /// An arm, whose effects are drawn on demand.
    Arm(Box<Arm>),
    /// A robot under position control, whose effects are drawn on demand.
    Robot(Box<Robot>),
    /// Recorded by another program.
    Files {
        logs: Vec<PathBuf>,
        /// True values of declared parameters, if the rig fixes them.
        declared: BTreeMap<String, f64>,
    },
}

/// All cells of a grid, in the order of its series.
///
/// # Errors
/// A file that cannot be read or refers to something unknown.
pub fn read(path: &Path) -> Result<Vec<Cell>, GridError> {
    let text = read_text(path).map_err(|source| GridError::Open {
        path: path.to_owned(),
        source,
    })?;
    cells(path, &text)
}

/// The cells of the grid in `text`; file names in it are relative to `path`.
///
/// # Errors
/// As [`read`].
pub fn cells(path: &Path, text: &str) -> Result<Vec<Cell>, GridError> {
    let wrong = |message: String| GridError::File {
        path: path.to_owned(),
        message,
    };
    let file: File = from_toml(text).map_err(|error| wrong(error.to_string()))?;
    file.check().map_err(wrong)?;
    let mut all = Vec::new();
    for (number, series) in file.series.iter().enumerate() {
        let added = file.expand(series, path);
        all.extend(added.map_err(|message| wrong(format!("series {}: {message}", number + 1)))?);
    }
    for draws in &file.draws {
        let drawn = file.drawn(draws, path);
        all.extend(drawn.map_err(|message| wrong(format!("draws {}: {message}", draws.name)))?);
    }
    all.extend(file.arms.iter().flat_map(|arms| arms.cells(path)));
    all.extend(file.robots.iter().flat_map(|robots| robots.cells(path)));
    let mut ids: Vec<&str> = all.iter().map(|cell| cell.id.as_str()).collect();
    ids.sort_unstable();
    match ids.windows(2).find(|two| two[0] == two[1]) {
        Some(two) => Err(wrong(format!("the cell {} occurs twice", two[0]))),
        None => Ok(all),
    }
}

impl File {
    fn check(&self) -> Result<(), String> {
        for (name, plant) in &self.plants {
            let driving = &plant.driving;
            let joints = plant.mechanics.joints();
            let lists = [
                &driving.torque,
                &driving.reference,
                &driving.stiffness,
                &driving.damping,
                &driving.limit,
            ];
            if lists.iter().any(|list| list.len() != joints) {
                return Err(format!(
                    "plants.{name}: every list of `driving` must have {joints} numbers, one per joint"
                ));
            }
            check_readings("driving", lists.into_iter().flatten().copied())
                .map_err(|message| format!("plants.{name}: {message}"))?;
            let rises = |[low, high]: [f64; 2]| 0.0 < low && low < high;
            if !(rises(driving.torque_hz) && rises(driving.reference_hz)) {
                return Err(format!(
                    "plants.{name}: `torque_hz` and `reference_hz` must be two increasing frequencies above zero"
                ));
            }
        }
        for (name, condition) in &self.conditions {
            let checked = condition.check();
            checked.map_err(|message| format!("conditions.{name}: {message}"))?;
        }
        for arms in &self.arms {
            let checked = check_rows(arms.rate_hz, &arms.seconds);
            checked.map_err(|message| format!("arms {}: {message}", arms.name))?;
        }
        for robots in &self.robots {
            let checked = robots.check();
            checked.map_err(|message| format!("robots {}: {message}", robots.name))?;
        }
        match self.count() {
            0..=CELLS => Ok(()),
            found => Err(format!("has {found} cells; at most {CELLS} are run")),
        }
    }

    /// Number of cells.
    fn count(&self) -> usize {
        let all = |counts: &[usize]| {
            counts
                .iter()
                .fold(1, |all: usize, n| all.saturating_mul(*n))
        };
        let series = self.series.iter().map(|series| {
            all(&[
                series.effects.len(),
                series.conditions.len(),
                series.seeds.len(),
            ])
        });
        let draws = self.draws.iter().map(|draws| numbered(draws.numbers));
        let arms = self
            .arms
            .iter()
            .map(|arms| all(&[arms.lacks.len(), numbered(arms.numbers)]));
        let robots = self
            .robots
            .iter()
            .map(|robots| all(&[robots.hides.len(), numbered(robots.numbers)]));
        series
            .chain(draws)
            .chain(arms)
            .chain(robots)
            .fold(0, usize::saturating_add)
    }

    fn expand(&self, series: &Series, path: &Path) -> Result<Vec<Cell>, String> {
        let plant = self.plants.get(&series.plant);
        let plant = plant.ok_or(format!("no plant `{}`", series.plant))?;
        let mut all = Vec::new();
        for effects in &series.effects {
            Machine::with(plant.mechanics.clone(), effects)?;
            for name in &series.conditions {
                let condition = self.conditions.get(name);
                let condition = condition.ok_or(format!("no condition `{name}`"))?;
                all.extend(series.seeds.iter().map(|&seed| Cell {
                    id: id(&series.plant, effects, name, seed),
                    group: series.group,
                    plant: series.plant.clone(),
                    condition: name.clone(),
                    effects: effects.clone(),
                    seed,
                    model: beside_or_named(path, &plant.model),
                    start: BTreeMap::new(),
                    source: Source::Simulated(Box::new(Simulation {
                        mechanics: plant.mechanics.clone(),
                        driving: plant.driving.clone(),
                        condition: condition.clone(),
                    })),
                }));
            }
        }
        Ok(all)
    }

    fn drawn(&self, draws: &Draws, path: &Path) -> Result<Vec<Cell>, String> {
        let rules = self.rules.as_ref().ok_or("needs `rules` to draw by")?;
        if draws.plants.is_empty() || draws.effects.is_empty() {
            return Err("needs a plant and a number of effects".to_owned());
        }
        let [first, last] = draws.numbers;
        (first..=last)
            .zip(0..)
            .map(|(number, place)| {
                let [effects, plants] = [draws.effects.len(), draws.plants.len()];
                let name = &draws.plants[place / effects % plants];
                let plant = self.plants.get(name).ok_or(format!("no plant `{name}`"))?;
                let recipe = Recipe {
                    mechanics: plant.mechanics.clone(),
                    driving: plant.driving.clone(),
                    speed: plant.speed.clone(),
                    rules: rules.clone(),
                    effects: draws.effects[place % effects],
                    outside: draws.outside,
                };
                recipe.check()?;
                Ok(Cell {
                    id: format!("{}/{number}", draws.name),
                    group: draws.group,
                    plant: name.clone(),
                    condition: draws.name.clone(),
                    effects: Vec::new(),
                    seed: number,
                    model: beside_or_named(path, &plant.model),
                    start: BTreeMap::new(),
                    source: Source::Drawn(Box::new(recipe)),
                })
            })
            .collect()
    }
}

/// How many numbers there are from the first to the last.
fn numbered([first, last]: [u64; 2]) -> usize {
    let after = last
        .checked_sub(first)
        .map_or(0, |more| more.saturating_add(1));
    usize::try_from(after).unwrap_or(usize::MAX)
}

impl Arms {
    fn cells(&self, path: &Path) -> Vec<Cell> {
        let [first, last] = self.numbers;
        let cell = |lacks: Lacks, number: u64| Cell {
            id: format!("{}/{}/{number}", self.name, lacks.name()),
            group: match lacks {
                Lacks::Nothing => Group::None,
                _ => Group::Several,
            },
            plant: self.name.clone(),
            condition: lacks.name().to_owned(),
            effects: Vec::new(),
            seed: number,
            model: beside_or_named(path, &self.model),
            start: BTreeMap::new(),
            source: Source::Arm(Box::new(Arm {
                lacks,
                bodies: self.bodies,
                amplitude: self.amplitude.clone(),
                rate_hz: self.rate_hz,
                seconds: self.seconds.clone(),
                noise: self.noise,
                column: self.column,
            })),
        };
        let of_kind = |lacks: &Lacks| (first..=last).map(|number| cell(*lacks, number)).collect();
        let all: Vec<Vec<Cell>> = self.lacks.iter().map(of_kind).collect();
        all.concat()
    }
}

impl Robots {
    fn check(&self) -> Result<(), String> {
        if self.flaws.is_empty() {
            return Err("needs `flaws`, at least one set".to_owned());
        }
        self.flaws.iter().try_for_each(Flaws::check)?;
        self.build.check()
    }

    fn cells(&self, path: &Path) -> Vec<Cell> {
        let [first, last] = self.numbers;
        let cell = |hides: Hides, number: u64, place: usize| Cell {
            id: format!("{}/{}/{number}", self.name, hides.name()),
            group: match hides {
                Hides::Nothing => Group::None,
                _ => Group::Joints,
            },
            plant: self.name.clone(),
            condition: hides.name().to_owned(),
            effects: Vec::new(),
            seed: number,
            model: beside_or_named(path, &self.model),
            start: BTreeMap::new(),
            source: Source::Robot(Box::new(Robot {
                hides,
                build: self.build.clone(),
                flaws: self.flaws[place % self.flaws.len()].clone(),
            })),
        };
        let kinds = self.hides.iter().enumerate();
        let of_kind = |(k, hides): (usize, &Hides)| -> Vec<Cell> {
            let numbered = (first..=last).zip(k..);
            numbered
                .map(|(number, place)| cell(*hides, number, place))
                .collect()
        };
        kinds.flat_map(of_kind).collect()
    }
}

/// `pendulum/coulomb_friction@1(F_c=0.1)/base/1`
pub(super) fn id(plant: &str, effects: &[Hidden], condition: &str, seed: u64) -> String {
    let effect = |hidden: &Hidden| {
        let values = hidden.values.iter();
        let values: Vec<String> = values
            .map(|(name, value)| format!("{name}={value}"))
            .collect();
        format!("{}@{}({})", hidden.name, hidden.joint, values.join(","))
    };
    let effects: Vec<String> = effects.iter().map(effect).collect();
    let effects = match effects.as_slice() {
        [] => "none".to_owned(),
        effects => effects.join("+"),
    };
    format!("{plant}/{effects}/{condition}/{seed}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: &str = r#"
        [plants.p]
        model = "pendulum"
        mechanics = { form = "pendulum", inertia = 0.15, moment = 0.3, g = 9.81 }
        [plants.p.driving]
        torque = [1.0]
        torque_hz = [0.2, 2.0]
        reference = [1.0]
        reference_hz = [0.2, 1.0]
        stiffness = [10.0]
        damping = [1.0]
        limit = [3.0]
        [conditions.base]
        loop = "open"
        rate_hz = 100
        noise = 1e-3
        logs = 4
        seconds = 20
        [[series]]
        group = "single"
        plant = "p"
        conditions = ["base"]
        seeds = [1, 2]
        effects = [
            [{ name = "coulomb_friction", joint = 1, F_c = 0.1 }],
            [{ name = "joint_spring", joint = 1, k = 0.5, q_0 = -0.25 }],
        ]
    "#;

    fn message(grid: &str) -> String {
        cells(Path::new("grid.toml"), grid).unwrap_err().to_string()
    }

    #[test]
    fn a_series_combines_all_sets_of_effects_with_all_seeds() {
        let all = cells(Path::new("grid.toml"), GRID).unwrap();
        let ids: Vec<&str> = all.iter().map(|cell| cell.id.as_str()).collect();
        assert_eq!(
            ids,
            [
                "p/coulomb_friction@1(F_c=0.1)/base/1",
                "p/coulomb_friction@1(F_c=0.1)/base/2",
                "p/joint_spring@1(k=0.5,q_0=-0.25)/base/1",
                "p/joint_spring@1(k=0.5,q_0=-0.25)/base/2",
            ]
        );
        assert_eq!(all[0].model, Path::new("pendulum"));
    }

    #[test]
    fn unknown_names_in_a_grid_are_refused_with_their_place() {
        let wrong = |from: &str, to: &str| message(&GRID.replace(from, to));
        assert_eq!(
            wrong("F_c = 0.1", "f = 0.1"),
            "grid.toml: series 1: `coulomb_friction` needs `F_c`"
        );
        assert_eq!(
            wrong("F_c = 0.1", "F_c = 0.1, b = 2"),
            "grid.toml: series 1: `coulomb_friction` has no `b`"
        );
        assert_eq!(
            wrong("joint = 1, F_c", "joint = 2, F_c"),
            "grid.toml: series 1: `coulomb_friction`: `joint` must be from 1 to 1"
        );
        assert_eq!(
            wrong(r#"conditions = ["base"]"#, r#"conditions = ["fast"]"#),
            "grid.toml: series 1: no condition `fast`"
        );
        assert_eq!(
            wrong("seeds = [1, 2]", "seeds = [1, 1]"),
            "grid.toml: the cell p/coulomb_friction@1(F_c=0.1)/base/1 occurs twice"
        );
        assert!(
            wrong("torque = [1.0]", "torque = [1.0, 2.0]").contains("1 numbers, one per joint")
        );
        assert!(wrong("seconds = 20", "seconds = 1e9").contains("at most 1e5 s long"));
        assert!(wrong("logs = 4", "logs = 1000000000").contains("at most 100000 `logs`"));
        assert!(wrong("logs = 4", "logs = 1").contains("conditions.base: needs"));
    }

    #[test]
    fn a_grid_of_more_cells_than_are_run_is_refused_before_they_are_made() {
        let draws =
            "[[draws]]\nname = \"d\"\ngroup = \"single\"\nplants = [\"p\"]\neffects = [1]\n";
        for (numbers, found) in [
            ("[0, 9223372036854775807]", "9223372036854775812"),
            ("[1, 20001]", "20005"),
        ] {
            let message = message(&format!("{GRID}\n{draws}numbers = {numbers}\n"));
            let expected = format!("has {found} cells; at most 20000 are run");
            assert!(message.contains(&expected), "{message}");
        }
    }
}

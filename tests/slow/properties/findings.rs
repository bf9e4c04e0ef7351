//! What closing the loop finds does not depend on how the rig is described: units, the order of columns, logs and
//! joints, and when its clock was set to zero.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use rand::RngExt;
use residyn::read_logs;
use residyn::read_model;
use residyn::{Finding, Library, Outcome, Request, close_loop, rng};
use residyn_core::closeloop::Split;
use residyn_core::data::{Joint, Log};
use residyn_io::plant_from_text;

use super::times;

/// A simulated rig: its model file, and logs of a plant with effects that the model lacks.
pub struct Rig {
    name: String,
    text: &'static str,
    joints: usize,
    logs: Vec<Log>,
}

const PENDULUM: &str = include_str!("../../../models/pendulum.toml");
const ACROBOT: &str = include_str!("../../../models/acrobot.toml");

/// The acrobot with its joints numbered the other way round.
const RENUMBERED: &str = include_str!("../../fixtures/acrobot-renumbered.toml");

/// Rigs of one and of two joints, recorded in seconds; sizes of effects are drawn at random.
const ONE: &str = "model = \"pendulum\"\nparameters = { C_g = -17.4, C_i = 4.6 }\n\
    sensor = { rate_hz = 100, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 6, start = [0, 0] }\n";
const TWO: &str = "model = \"acrobot\"\n\
    sensor = { rate_hz = 50, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [3.0, 2.0], band_hz = [0.1, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 6, start = [0, 0, 0, 0] }\n";

/// Effects with the first parameter's usual size, of one joint and of two.
type Hidden = &'static [(&'static str, usize, &'static [(&'static str, f64)])];
const ON_ONE: [Hidden; 6] = [
    &[("coulomb_friction", 0, &[("F_c", 0.16)])],
    &[
        ("viscous_friction", 0, &[("b", 0.06)]),
        ("actuator_delay", 0, &[("d", 0.012)]),
    ],
    &[("joint_spring", 0, &[("k", 0.5), ("q_0", 0.4)])],
    &[(
        "stribeck_friction",
        0,
        &[("F_c", 0.1), ("F_s", 0.3), ("v_s", 0.3)],
    )],
    &[("backlash", 0, &[("delta", 0.02)])],
    &[
        ("quadratic_drag", 0, &[("c", 0.03)]),
        ("actuator_gain", 0, &[("g", -0.2)]),
    ],
];
const ON_TWO: [Hidden; 3] = [
    &[
        ("viscous_friction", 0, &[("b", 0.1)]),
        ("coulomb_friction", 1, &[("F_c", 0.15)]),
    ],
    &[("actuator_deadzone", 0, &[("w", 0.3)])],
    &[
        ("rotor_inertia", 1, &[("J", 0.3)]),
        ("coulomb_friction", 0, &[("F_c", 0.3)]),
    ],
];

impl Rig {
    fn new(plant: &str, text: &'static str, hidden: Hidden, seed: u64) -> Self {
        let library = Library::built_in();
        let mut plant = plant_from_text(Path::new("rig.toml"), plant, &library).unwrap();
        let mut rng = rng(seed);
        let mut name = format!("{} {seed}", plant.system.name);
        for (effect, joint, values) in hidden {
            let size = rng.random_range(0.8..1.25);
            let values: Vec<_> = values
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value * size))
                .collect();
            plant
                .add_effect(&library, effect, Joint::at(*joint), &values)
                .unwrap();
            let _ = write!(name, ", {effect} {size:.3}");
        }
        let logs = (1..=4).map(|k| Log {
            path: format!("run{k}.csv").into(),
            ..plant.record(&mut rng).unwrap()
        });
        Self {
            name,
            text,
            joints: plant.system.joints,
            logs: logs.collect(),
        }
    }

    pub fn of_one_joint(number: u32) -> Self {
        Self::new(
            ONE,
            PENDULUM,
            ON_ONE[number as usize % ON_ONE.len()],
            u64::from(number),
        )
    }

    pub fn of_two_joints(number: u32) -> Self {
        Self::new(
            TWO,
            ACROBOT,
            ON_TWO[number as usize % ON_TWO.len()],
            u64::from(number),
        )
    }

    /// A rig whose model lacks nothing.
    pub fn as_declared() -> Self {
        Self::new(ONE, PENDULUM, &[], 1)
    }

    /// Writes the model and the logs into a folder.
    pub fn write(&self, folder: &Path) -> (PathBuf, Vec<PathBuf>) {
        Written::of(self).write(folder)
    }
}

/// A rig as somebody may write it down.
struct Written {
    model: String,
    /// Header and rows of each log.
    logs: Vec<(Vec<String>, Vec<Vec<f64>>)>,
}

impl Written {
    /// In the standard columns and units.
    fn of(rig: &Rig) -> Self {
        let names = |stem: &str| {
            (1..=rig.joints)
                .map(|j| format!("{stem}{j}"))
                .collect::<Vec<_>>()
        };
        let header = [
            vec!["time".to_owned()],
            names("q"),
            names("qd"),
            names("tau"),
        ]
        .concat();
        let table = |log: &Log| {
            let channels = || log.q.iter().chain(&log.qd).chain(&log.tau);
            let row = |k: usize| {
                std::iter::once(log.time[k])
                    .chain(channels().map(|c| c[k]))
                    .collect()
            };
            (header.clone(), (0..log.time.len()).map(row).collect())
        };
        Self {
            model: rig.text.to_owned(),
            logs: rig.logs.iter().map(table).collect(),
        }
    }

    /// The numbers of each column after applying `change`, which is given the column's name.
    fn with(mut self, change: impl Fn(&str, f64) -> f64) -> Self {
        for (header, rows) in &mut self.logs {
            for row in rows {
                for (name, value) in header.iter().zip(row) {
                    *value = change(name, *value);
                }
            }
        }
        self
    }

    /// In degrees, mN m and ms.
    fn in_other_units(self, joints: usize) -> Self {
        let list = |stem: &str, unit: &str| {
            let column = |j: usize| format!("{{ column = \"{stem}{j}\", unit = \"{unit}\" }}");
            let columns: Vec<String> = (1..=joints).map(column).collect();
            format!("{stem} = [{}]\n", columns.join(", "))
        };
        let columns = [list("q", "deg"), list("qd", "deg/s"), list("tau", "mN m")].concat();
        let mut other = self.with(|name, value| match name {
            "time" => 1e3 * value,
            name if name.starts_with("tau") => 1e3 * value,
            _ => value.to_degrees(),
        });
        let time = "time = { column = \"time\", unit = \"ms\" }\n";
        let _ = write!(other.model, "\n[columns]\n{time}{columns}");
        other
    }

    /// The columns in another order, among others.
    fn with_columns_moved(mut self) -> Self {
        for (header, rows) in &mut self.logs {
            header.extend(["mode", "current"].map(str::to_owned));
            header.rotate_left(3);
            header.swap(0, 1);
            for (k, row) in rows.iter_mut().enumerate() {
                #[allow(clippy::cast_precision_loss)] // a few hundred rows
                row.extend([k as f64, 0.5]);
                row.rotate_left(3);
                row.swap(0, 1);
            }
        }
        self
    }

    /// With the joints of [`RENUMBERED`].
    fn with_joints_renumbered(mut self) -> Self {
        RENUMBERED.clone_into(&mut self.model);
        let other = |name: &mut String| match name.pop() {
            Some('1') => name.push('2'),
            Some('2') => name.push('1'),
            last => name.extend(last),
        };
        self.logs
            .iter_mut()
            .flat_map(|(header, _)| header)
            .for_each(other);
        self
    }

    fn write(&self, folder: &Path) -> (PathBuf, Vec<PathBuf>) {
        let model = folder.join("model.toml");
        fs::write(&model, &self.model).unwrap();
        let write = |(k, (header, rows)): (usize, &(Vec<String>, Vec<Vec<f64>>))| {
            let path = folder.join(format!("run{k}.csv"));
            let line = |row: &Vec<f64>| {
                row.iter()
                    .map(|x| format!("{x:?}"))
                    .collect::<Vec<_>>()
                    .join(",")
            };
            let lines: Vec<String> = rows.iter().map(line).collect();
            fs::write(
                &path,
                format!("{}\n{}\n", header.join(","), lines.join("\n")),
            )
            .unwrap();
            path
        };
        (model, (1..).zip(&self.logs).map(write).collect())
    }

    /// The findings when the logs are given in this order, the last as the test log.
    fn findings(&self, order: [usize; 4]) -> Findings {
        let folder = tempfile::tempdir().unwrap();
        let (model, paths) = self.write(folder.path());
        let library = Library::built_in();
        let model = read_model(&model, &library).unwrap();
        let mut train = read_logs(order.map(|k| &paths[k]), &model).unwrap();
        let test = train.split_off(3);
        let request = Request::new(&model, &library, Split::given(train, test));
        Findings::of(&close_loop(request, &mut rng(0), &()).unwrap())
    }
}

/// The findings for a rig.
#[derive(Debug, Clone)]
struct Findings {
    verdict: String,
    /// Established effects, then supported ones: name and joint.
    effects: Vec<(String, usize)>,
    /// Effects of each alternative.
    alternatives: Vec<Vec<(String, usize)>>,
    /// Values of the effects, then of the declared parameters; then the unexplained residual, which depends on random
    /// draws.
    numbers: Vec<(String, f64)>,
}

impl Findings {
    fn of(outcome: &Outcome) -> Self {
        let found = || {
            outcome
                .effects
                .findings
                .iter()
                .chain(&outcome.effects.supported)
        };
        let name = |finding: &Finding| {
            (
                finding.effect.effect.name.clone(),
                finding.effect.joint.number(),
            )
        };
        let values = |finding: &Finding| {
            let joint = finding.effect.joint.number();
            let of = |(k, value): (usize, f64)| {
                (format!("{} {joint}.{k}", finding.effect.effect.name), value)
            };
            let values = finding.effect.values.iter().map(|(value, _)| *value);
            values.enumerate().map(of).collect::<Vec<_>>()
        };
        let declared = outcome.models.after.model.parameters.iter();
        let declared = declared.map(|parameter| (parameter.name.clone(), parameter.value));
        let mut numbers: Vec<_> = found().flat_map(values).chain(declared).collect();
        let left = &outcome.diagnostics.unexplained;
        numbers.push(("unexplained".to_owned(), left.fraction));
        let alternative = |rival: &residyn_core::closeloop::Alternative| {
            let each = rival.effects.iter();
            each.map(|effect| (effect.effect.name.clone(), effect.joint.number()))
                .collect()
        };
        Self {
            verdict: format!("{:?}", outcome.verdict),
            effects: found().map(name).collect(),
            alternatives: outcome
                .effects
                .alternatives
                .iter()
                .map(alternative)
                .collect(),
            numbers,
        }
    }

    /// The same findings with joints renumbered by `number` and sorted.
    fn renumbered(mut self, number: impl Fn(usize) -> usize) -> Self {
        let all = self
            .effects
            .iter_mut()
            .chain(self.alternatives.iter_mut().flatten());
        all.for_each(|(_, joint)| *joint = number(*joint));
        self.effects.sort();
        self.alternatives
            .iter_mut()
            .for_each(|effects| effects.sort());
        for (name, _) in &mut self.numbers {
            if let Some((effect, place)) = name.clone().split_once(' ') {
                let (joint, k) = place.split_once('.').unwrap();
                *name = format!("{effect} {}.{k}", number(joint.parse().unwrap()));
            }
        }
        self.numbers.sort_by(|a, b| a.0.cmp(&b.0));
        self
    }

    /// Fails unless these are the same findings, with numbers within `share` of those.
    #[track_caller]
    fn same_as(&self, wanted: &Self, share: f64, what: &str) {
        let named = |of: &Self| {
            (
                of.verdict.clone(),
                of.effects.clone(),
                of.alternatives.clone(),
            )
        };
        assert_eq!(named(self), named(wanted), "{what}");
        let names = |of: &Self| {
            of.numbers
                .iter()
                .map(|(name, _)| name.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(self), names(wanted), "{what}");
        let off = |((name, a), (_, b)): (&(String, f64), &(String, f64))| {
            // What is left unexplained is a share already, of the variance.
            let size = match name.as_str() {
                "unexplained" => 1.0,
                _ => a.abs().max(b.abs()).max(1e-9),
            };
            (a - b).abs() / size
        };
        let most = self
            .numbers
            .iter()
            .zip(&wanted.numbers)
            .map(off)
            .fold(0.0, f64::max);
        assert!(
            most <= share,
            "{what}: off by {most:e}:\n{:?}\n{:?}",
            self.numbers,
            wanted.numbers
        );
        if times() > 1 {
            eprintln!("{what}: {most:.1e}");
        }
    }
}

const IN_ORDER: [usize; 4] = [0, 1, 2, 3];

/// What numbers may differ by where they are written in other digits: fits end where the next step gains less than a millionth.
const ROUNDING: f64 = 1e-6;
/// Unix time in floating point has steps of a quarter of a microsecond, a forty-thousandth of a step of 10 ms.
const OF_STAMPS: f64 = 1e-3;

/// All ways to write down a rig.
fn check(rig: &Rig) {
    let usual = || Written::of(rig);
    let wanted = usual().findings(IN_ORDER);
    let same = |found: Findings, share: f64, how: &str| {
        found.same_as(&wanted, share, &format!("{}, {how}", rig.name));
    };
    same(
        usual().with_columns_moved().findings(IN_ORDER),
        0.0,
        "columns moved",
    );
    same(usual().findings([2, 0, 1, 3]), 0.0, "logs in another order");
    same(
        usual().in_other_units(rig.joints).findings(IN_ORDER),
        ROUNDING,
        "other units",
    );
    let later = |seconds: f64| {
        let shift = |name: &str, value| match name {
            "time" => value + seconds,
            _ => value,
        };
        usual().with(shift).findings(IN_ORDER)
    };
    same(later(3600.0), ROUNDING, "an hour later");
    same(later(1.7e9), OF_STAMPS, "in Unix time");
    if rig.joints == 2 {
        let other = usual().with_joints_renumbered().findings(IN_ORDER);
        let back = other.renumbered(|joint| 3 - joint);
        let wanted = wanted.clone().renumbered(|joint| joint);
        back.same_as(
            &wanted,
            ROUNDING,
            &format!("{}, joints renumbered", rig.name),
        );
    }
}

#[test]
fn findings_of_one_joint_do_not_depend_on_how_it_is_written_down() {
    (0..3 * times())
        .map(Rig::of_one_joint)
        .for_each(|rig| check(&rig));
    check(&Rig::as_declared());
}

#[test]
fn findings_of_two_joints_do_not_depend_on_how_they_are_written_down() {
    (0..times())
        .map(Rig::of_two_joints)
        .for_each(|rig| check(&rig));
}

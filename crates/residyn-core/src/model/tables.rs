//! The tables of model, effect and drive files: which keys each has, and what they hold. A key that is not optional must
//! be given; another one is refused.
//!
//! `[columns]`, `[drive]`, `[dynamics]`, `[logs]` and `[[effect]]` have keys that depend on the model: they are read in
//! `columns_in_file.rs`, `drive.rs`, `sections.rs`, `logs_in_file.rs` and `effects_in_file.rs`.

use super::effect::ActsOn;
use super::effect::AlikeOn;
use super::effect::Measure;
use super::effect::ShowsIn;
use super::effect::Side;
use super::filter::CommandFilter;
use super::reader::{Entry, FileError, Located, Section};
use super::values::{ColumnName, EachLog, JointKey, Limits, Named, OrTable, Per, Read};
use crate::data::TorqueColumn;
use crate::expr::Formula;

/// Structs that are read from a table, each field from the key of its name.
macro_rules! tables {
    ($($(#[$about:meta])* struct $name:ident<$a:lifetime> { $($key:ident: $type:ty,)* })*) => { $(
        $(#[$about])*
        #[allow(dead_code)] // Keys for people are checked, and not used.
        pub(super) struct $name<$a> {
            $(pub $key: $type,)*
            /// For messages.
            pub section: Section<$a>,
        }

        impl<$a> $name<$a> {
            pub fn of(section: Section<$a>) -> Result<Self, FileError> {
                section.only(&[$(stringify!($key)),*])?;
                Ok(Self { $($key: section.read(stringify!($key))?,)* section })
            }
        }

        impl<$a> Read<$a> for $name<$a> {
            const NAMES: [&'static str; 2] = Section::NAMES;

            fn read(entry: Entry<'_, $a>) -> Result<Self, FileError> {
                <Section<$a> as Read<$a>>::read(entry).and_then(Self::of)
            }

            fn absent(section: &Section<$a>, key: &str) -> Result<Self, FileError> {
                Section::absent(section, key).and_then(Self::of)
            }
        }
    )* };
}

tables! {
    /// A model file.
    struct ModelFile<'a> {
        system: SystemTable<'a>,
        columns: Option<Section<'a>>,
        log: Option<LogTable<'a>>,
        logs: Named<Section<'a>>,
        measured: Named<Located<String>>,
        drive: Option<Section<'a>>,
        parameters: Named<ParameterTable<'a>>,
        dynamics: Option<Section<'a>>,
        chain: Option<ChainTable<'a>>,
        energy: Option<EnergyTable<'a>>,
        residual: Option<ResidualTable<'a>>,
        sensors: Option<SensorsTable<'a>>,
        effect: Vec<Section<'a>>,
    }

    struct SystemTable<'a> {
        name: String,
        about: Option<String>,
        joints: usize,
        joint_names: Vec<String>,
        like: Option<Vec<Vec<JointKey>>>,
        prismatic: Vec<usize>,
        smoothing_velocity: Option<Vec<f64>>,
    }

    /// What is known of all logs.
    struct LogTable<'a> {
        torque: Option<TorqueColumn>,
    }

    /// A column that is not read as it is.
    struct ColumnTable<'a> {
        column: ColumnName,
        unit: Option<String>,
        factor: Option<f64>,
        wrapped: bool,
        late: Option<f64>,
    }

    /// A declared parameter of a model, or of a drive.
    struct ParameterTable<'a> {
        value: f64,
        unit: Option<String>,
        about: Option<String>,
        positive: bool,
        bounds: Option<Limits>,
        fixed: bool,
        ci95: Option<Limits>,
        per: Option<Per>,
        logs: Named<OrTable<f64, ValueTable<'a>>>,
    }

    struct ChainTable<'a> {
        gravity: [Located<Formula>; 3],
        link: Vec<LinkTable<'a>>,
    }

    struct LinkTable<'a> {
        joint: usize,
        parent: Option<usize>,
        ratio: Option<f64>,
        offset: Option<f64>,
        slides: Option<bool>,
        origin: [f64; 3],
        axis: [f64; 3],
        across: [f64; 3],
        mass: Located<Formula>,
        moment: [Located<Formula>; 3],
        inertia: [Located<Formula>; 6],
    }

    struct EnergyTable<'a> {
        total: Located<Formula>,
        power: Located<Formula>,
    }

    struct SensorsTable<'a> {
        angle: Vec<Side>,
    }

    struct ResidualTable<'a> {
        hidden: Option<Vec<usize>>,
    }

    /// A value with its interval.
    struct ValueTable<'a> {
        value: f64,
        ci95: Option<Limits>,
    }

    /// A value with its interval, and its per-log values.
    struct PerLogTable<'a> {
        value: f64,
        ci95: Option<Limits>,
        logs: Named<OrTable<f64, ValueTable<'a>>>,
    }

    /// The file of an effect.
    struct EffectFile<'a> {
        effect: EffectTable<'a>,
        states: Named<InternalStateTable<'a>>,
        parameters: Named<EffectParameterTable<'a>>,
    }

    struct EffectTable<'a> {
        name: String,
        about: String,
        force: Option<Located<Formula>>,
        torque: Option<Located<Formula>>,
        angle: Option<Located<Formula>>,
        inertia: Option<Located<Formula>>,
        friction: Option<Located<Formula>>,
        command: Option<CommandFilter>,
        reading: Option<Located<Formula>>,
        coupling: Option<Located<Formula>>,
        payload: Option<Located<Formula>>,
        transmission: Option<Located<Formula>>,
        free_within: Option<[Located<Formula>; 2]>,
        contains: Vec<String>,
        refines: bool,
        confused_with: Vec<String>,
        shown_by: Option<String>,
        joints: Option<ActsOn>,
        shows_in: Option<ShowsIn>,
        alike_on: Option<AlikeOn>,
        valid_if: Option<Located<Formula>>,
        baseline: Option<usize>,
    }

    struct InternalStateTable<'a> {
        rate: Located<Formula>,
        unit: String,
        about: Option<String>,
        start: Option<Located<Formula>>,
        within: Option<[Located<Formula>; 2]>,
    }

    struct EffectParameterTable<'a> {
        unit: String,
        about: Option<String>,
        typical: f64,
        positive: bool,
        bounds: Option<Limits>,
        start: Option<f64>,
        search: Option<Vec<f64>>,
        relative_to: Option<Measure>,
        whole: bool,
        held_if_unknown: bool,
        per: Option<EachLog>,
    }

    /// The file of a drive.
    struct DriveFile<'a> {
        drive: DriveTable<'a>,
        parameters: Named<ParameterTable<'a>>,
    }

    struct DriveTable<'a> {
        name: String,
        about: String,
        torque: Located<Formula>,
    }
}

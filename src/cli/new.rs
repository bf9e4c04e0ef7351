use std::path::PathBuf;

use anyhow::Result;
use clap::{Arg, ArgGroup, ArgMatches, Args, Command, FromArgMatches, value_parser};
use serde_json::json;

use super::gains::Gains;
use super::{Answer, Common, notes, terminal};
use residyn_formats::{FORMATS, Format, RobotReader, model_of};
use residyn_io::files::write_whole;

/// Write a model file for a mechanism on a fixed base, its equations derived from a robot description
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  residyn new --from-urdf arm.urdf --tip tool0 --out arm.toml")]
pub(super) struct Arguments {
    #[command(flatten)]
    description: Description,
    /// The last link of one limb (a body in MJCF): the model has only the joints on the way there, and the others are held
    /// as the file draws them. Without it, the model has all joints
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// What drives the joints, if their logs hold commands instead of torques: one of `residyn list drives`
    #[arg(long, value_name = "NAME", conflicts_with = "kp")]
    drive: Option<String>,
    /// Leave out the damping, dry friction and rotor inertia that the file gives the joints. They are often chosen for a
    /// simulator; without them, `closeloop` names those that the logs show
    #[arg(long)]
    bare_joints: bool,
    #[command(flatten)]
    gains: Gains,
    /// The model file to write; standard output if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// The robot description to read: one flag per format.
#[derive(Debug)]
struct Description {
    reader: &'static RobotReader,
    file: PathBuf,
}

/// The formats of robot descriptions, each with its flag.
fn flags() -> impl Iterator<Item = (&'static str, &'static Format, &'static RobotReader)> {
    FORMATS.iter().filter_map(|format| {
        let reader = format.robots.as_ref()?;
        // Clap takes only static names.
        let flag: &'static str = format!("from-{}", format.name).leak();
        Some((flag, *format, reader))
    })
}

impl Args for Description {
    fn augment_args(command: Command) -> Command {
        let flag = |(name, format, reader): (&'static str, &Format, &RobotReader)| {
            let help = format!("{} of {}", format.name.to_uppercase(), reader.about);
            let file = Arg::new(name).long(name).value_name("FILE").help(help);
            file.value_parser(value_parser!(PathBuf))
        };
        let names = flags().map(|(name, ..)| name);
        let one_of_them = ArgGroup::new("description").args(names).required(true);
        command.args(flags().map(flag)).group(one_of_them)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Description {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut given = flags().filter_map(|(name, _, reader)| {
            let file = matches.get_one::<PathBuf>(name)?.clone();
            Some(Self { reader, file })
        });
        given
            .next()
            .ok_or_else(|| clap::Error::new(clap::error::ErrorKind::MissingRequiredArgument))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Description { reader, file } = &arguments.description;
    let (tip, drive) = (arguments.tip.as_deref(), arguments.drive.as_deref());
    let mut tree = arguments.gains.on(reader.tree(file, tip, drive)?)?;
    if arguments.bare_joints {
        tree = tree.with_bare_joints();
    }
    let (model, notes) = (model_of(&tree)?, &tree.notes);
    let text = &model.text;
    notes::say(notes);
    if let Some(out) = &arguments.out {
        write_whole(out, text.as_bytes())?;
    }
    if arguments.common.json {
        let value =
            json!({"model": text, "joints": model.joints, "notes": notes, "out": arguments.out});
        terminal::json(&value)?;
    } else if let Some(out) = &arguments.out {
        terminal::print(&format!(
            "{}: model of {}, joints: {}\n",
            out.display(),
            model.name,
            model.joints
        ))?;
    } else {
        terminal::print(text)?;
    }
    Ok(Answer::Yes)
}

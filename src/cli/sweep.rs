use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::shard::{self, Sharding, program_id};
use super::{Answer, Common, command_line, inputs, interrupt, progress, terminal};
use residyn_io::files::content_id;
use residyn_io::runs::{Identity, Lines, RunFolder};
use residyn_train::Trained;
use residyn_train::recipe::{Job, Member, Recipe, SweepResults};

/// Train many models with one recipe, with different initial weights or different weights of the penalty
///
/// All models are trained on the data of --seed, one after the other. Each is a line of DIR/models.jsonl, and an
/// interrupted sweep is resumed.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        residyn sweep --config configs/train-pendulum.toml --seeds 100\n  \
        residyn sweep --config configs/train-pendulum.toml --seeds 20 --one-seed --alpha 1e-6-1e-2")]
pub(super) struct Arguments {
    /// Training recipe
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Number of models; their initial weights have the seeds --seed, --seed + 1, ...
    #[arg(long, value_name = "COUNT", value_parser = inputs::count)]
    seeds: NonZeroUsize,
    /// Weights of the penalty, one per model, from LOW to HIGH in equal ratios
    #[arg(long, value_name = "LOW-HIGH")]
    alpha: Option<Alphas>,
    /// Give all models the initial weights of --seed, so that they differ only in alpha
    #[arg(long, requires = "alpha")]
    one_seed: bool,
    /// Folder of the results: models.jsonl and sweep.json
    #[arg(long, default_value = "sweep", value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    effects: inputs::Effects,
    #[command(flatten)]
    sharding: Sharding,
    #[command(flatten)]
    common: Common,
}

/// A model; one line of `models.jsonl`.
#[derive(Clone, Serialize, Deserialize)]
struct Stored {
    /// Identifies the model, what it was trained by, and this build of the program: another one may give other results.
    configuration: String,
    /// Time that its training took, s.
    seconds: f64,
    trained: Trained,
}

/// A range of weights, both above zero and finite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Alphas {
    low: f64,
    high: f64,
}

impl FromStr for Alphas {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // In 1e-6-1e-2, the separator is the hyphen with a number on either side.
        let numbers = text.match_indices('-').find_map(|(at, _)| {
            let (low, high) = (text[..at].parse().ok()?, text[at + 1..].parse().ok()?);
            Some(Self { low, high })
        });
        let found = numbers.ok_or("give two numbers as LOW-HIGH, 1e-6-1e-2 say")?;
        let Self { low, high } = found;
        if !(low > 0.0 && high.is_finite()) {
            return Err(format!(
                "LOW is {low} and HIGH is {high}; both must be finite and above zero"
            ));
        }
        if low > high {
            return Err(format!("LOW is {low}, above HIGH, {high}; swap them"));
        }
        Ok(found)
    }
}

impl Alphas {
    /// Number `k` of `count` in equal ratios.
    fn at(self, k: usize, count: usize) -> f64 {
        let share = k as f64 / (count.max(2) - 1) as f64;
        self.low.powf(1.0 - share) * self.high.powf(share)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Arguments {
        config,
        out,
        common,
        ..
    } = arguments;
    if arguments.alpha.is_some() && arguments.seeds.get() == 1 {
        bail!("--alpha is a range of weights, and --seeds 1 trains one model; raise --seeds");
    }
    let library = arguments.effects.library()?;
    let job = Job::train(Recipe::read(config)?, &library, common.device, common.seed)?
        .begun_by(command_line());
    let folder = RunFolder::open(out)?;
    for note in &job.data.notes {
        terminal::say(format!("note: {note}"));
    }
    let members = arguments.members();
    job.check_members(&members)?;
    let run = json!([job.identity(), program_id()?]).to_string();
    let run = content_id(run.as_bytes());
    let key = |member: &Member| content_id(json!([run, member]).to_string().as_bytes());
    let part = arguments.sharding.part(&folder, arguments.identity(&job))?;
    let members: Vec<Member> = shard::of(part.as_ref()).share(members).collect();
    let models = train(&job, &members, &folder, &key)?;
    if let Some(part) = part {
        return shard::finish(part, common);
    }
    let wall_s = models.iter().map(|model| model.seconds).sum();
    let trained = models.into_iter().map(|model| model.trained).collect();
    let swept = SweepResults::new(&job, &members, trained, wall_s);
    let json = serde_json::to_string_pretty(&swept)? + "\n";
    folder.write_text("sweep.json", &json)?;
    terminal::print(&if common.json { json } else { swept.text() })?;
    let all_diverged = swept.totals.diverged == swept.totals.models;
    Ok(Answer::of(!all_diverged))
}

impl Arguments {
    /// What decides the numbers of the whole sweep.
    fn identity(&self, job: &Job) -> Identity {
        let run = job.identity();
        let Self {
            seeds,
            alpha,
            one_seed,
            ..
        } = self;
        Identity {
            command: "sweep".to_owned(),
            config: json!({"train": run.config, "seeds": seeds, "alpha": alpha, "one_seed": one_seed}),
            ..run
        }
    }

    fn members(&self) -> Vec<Member> {
        let count = self.seeds.get();
        let seed = |k: usize| match self.one_seed {
            true => self.common.seed,
            false => self.common.seed.wrapping_add(k as u64),
        };
        let member = |k: usize| Member {
            seed: seed(k),
            alpha: self.alpha.map(|alphas| alphas.at(k, count)),
        };
        (0..count).map(member).collect()
    }
}

/// The trained models; those that are not stored yet are trained now, and stored by their `key`.
fn train(
    job: &Job,
    members: &[Member],
    folder: &RunFolder,
    key: &dyn Fn(&Member) -> String,
) -> Result<Vec<Stored>> {
    let stored_key = |stored: &Stored| stored.configuration.clone();
    let mut store = Lines::open(folder, "models.jsonl", stored_key)?;
    let is_new = |member: &&Member| store.find(&key(member)).is_none();
    let new = members.iter().filter(is_new).count();
    let bar = progress::bar(new * job.recipe.fit.epochs);
    let out = folder.path().display().to_string();
    let _orderly = interrupt::orderly(folder, move || {
        let go_on = interrupt::go_on();
        format!("{out} keeps the models that are done; {go_on}")
    });
    let begun = Instant::now();
    let mut diverged = 0;
    let model = |member: &Member| {
        let configuration = key(member);
        let stored = store.find_or_make(&configuration.clone(), || -> Result<_> {
            let since = Instant::now();
            let trained = job.train_member(member, &mut || bar.inc(1))?;
            diverged += usize::from(trained.diverged);
            bar.set_message(format!("epochs, {diverged} diverged"));
            Ok(Stored {
                configuration,
                seconds: since.elapsed().as_secs_f64(),
                trained,
            })
        })?;
        Ok(stored.clone())
    };
    let models = members.iter().map(model).collect();
    bar.finish_and_clear();
    terminal::took("training", begun);
    models
}

#[cfg(test)]
mod tests {
    use super::Alphas;

    #[test]
    fn a_range_of_weights_is_read_and_divided_in_equal_ratios() {
        let alphas: Alphas = "1e-6-1e-2".parse().unwrap();
        assert_eq!((alphas.low, alphas.high), (1e-6, 1e-2));
        let weights: Vec<f64> = (0..5).map(|k| alphas.at(k, 5)).collect();
        assert_eq!((weights[0], weights[4]), (1e-6, 1e-2));
        for pair in weights.windows(2) {
            assert!((pair[1] / pair[0] - 10.0).abs() < 1e-12);
        }
        assert_eq!(alphas.at(0, 1), 1e-6);
    }

    #[test]
    fn ranges_that_are_none_are_refused() {
        for (text, part) in [
            ("1e-2-1e-6", "above HIGH"),
            ("0-1", "above zero"),
            ("1e-6", "LOW-HIGH"),
            ("-1-2", "above zero"),
            ("1-inf", "finite"),
        ] {
            let message = text.parse::<Alphas>().unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}

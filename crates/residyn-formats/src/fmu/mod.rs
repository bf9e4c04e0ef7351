//! FMI: the model with its C code as a unit (FMU) for other simulators, for model exchange and co-simulation.

mod description;
pub(super) mod fmi2;
pub(super) mod fmi3;
mod variables;

use std::io::{Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use self::variables::Variable;
use super::c::{Names, compile, compiler, header};
use super::template::filled;
use super::verify::{Client, ClientError, Predictions, PythonClient, Samples};
use super::{ExportError, ExportModel, File, Format};
use residyn_core::data::Joint;
use residyn_core::model::CommandFilter;

/// The specifics of one version of the standard. Templates are filled in by [`filled`].
struct Standard {
    /// Name and contents of its source file.
    source: (&'static str, &'static str),
    /// Template of the model description.
    description: &'static str,
    /// Template of the build description, which only some versions have.
    build: Option<&'static str>,
    /// Number of the first variable.
    first: usize,
    /// Template of a variable's element.
    variable: &'static str,
    /// Templates of the elements for outputs, derivatives, and variables that are unknown at the start.
    unknowns: [&'static str; 3],
    /// The folder of libraries for this platform.
    platform: fn() -> String,
}

/// What all versions share.
struct Fmu<'m> {
    model: &'m ExportModel,
    identifier: String,
    token: String,
    variables: Vec<Variable>,
}

type Files = fn(&ExportModel, &Path) -> Result<Vec<File>, ExportError>;

const fn format(name: &'static str, about: &'static str, files: Files) -> Format {
    Format {
        name,
        about,
        extension: "fmu",
        not_carried,
        files,
        client: Client::Own(predict),
        tolerance: 1e-9,
        robots: None,
    }
}

const CLIENT: PythonClient = PythonClient {
    name: "fmu.py",
    script: include_str!("../../../../docs/clients/fmu.py"),
    packages: "fmpy",
};

/// The predictions of FMPy, if the unit holds a library for this machine.
fn predict(path: &Path, samples: &Samples) -> Result<Predictions, ClientError> {
    let refused =
        |error: &dyn std::error::Error| ClientError::Failed(format!("{}: {error}", path.display()));
    let file = std::fs::File::open(path).map_err(|error| refused(&error))?;
    let archive = ZipArchive::new(file).map_err(|error| refused(&error))?;
    let runs = archive
        .file_names()
        .flatten()
        .any(|name| name.starts_with("binaries/"));
    match runs {
        true => CLIENT.ask(path, samples),
        false => Err(ClientError::Unavailable(
            "the unit holds no library; name a C compiler in CC".to_owned(),
        )),
    }
}

fn not_carried(model: &ExportModel) -> Vec<String> {
    let delay = delays(model).then(|| {
        "the delay between steps of model exchange: there a delayed torque is interpolated linearly between the \
         points that the importer accepted; co-simulation delays it exactly"
            .to_owned()
    });
    let stops = model.stops().then(|| {
        "stops in model exchange: a state of an effect that reaches the end of its range stops there within \
         1e-9 s, which no solver is told; co-simulation stops it in its step"
            .to_owned()
    });
    let binary = match compile(version()) {
        Ok(()) => None,
        Err(reason) => Some(format!(
            "a binary: the FMU holds only source code, since {reason}"
        )),
    };
    model
        .sensors_not_carried()
        .into_iter()
        .chain(delay)
        .chain(stops)
        .chain(binary)
        .collect()
}

fn version() -> std::process::Command {
    let mut command = compiler();
    command.arg("--version");
    command
}

/// Whether past torques matter.
fn delays(model: &ExportModel) -> bool {
    Joint::all(model.joints()).any(|joint| model.filter(joint, CommandFilter::Delay).is_some())
}

impl Standard {
    fn files(&self, model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
        let archive = self.archive(model)?;
        Ok(vec![File::new(path, archive, "functional mock-up unit")])
    }

    fn archive(&self, model: &ExportModel) -> Result<Vec<u8>, ExportError> {
        let names = Names::new(model);
        let header = header(model)?;
        let fmu = Fmu {
            model,
            identifier: names.lower.clone(),
            token: format!("{}-{:08x}", names.lower, crc32c::crc32c(header.as_bytes())),
            variables: variables::variables(model, &names),
        };
        let sources = [
            (self.source.0, self.source.1.to_owned()),
            ("functions.h", include_str!("functions.h").to_owned()),
            ("unit.h", code(model, &names, &fmu.token)),
            ("model.h", header),
        ];
        let library = library(model, &sources)?.map(|bytes| (self.library_path(&fmu), bytes));
        let build = self.build.map(|build| {
            let text = filled(build, &[("IDENTIFIER", &fmu.identifier)]);
            ("buildDescription.xml", text)
        });
        let described = ("modelDescription.xml".to_owned(), self.describe(&fmu));
        let sources = build.into_iter().chain(sources);
        let sources = sources.map(|(name, text)| (format!("sources/{name}"), text));
        let texts = [described].into_iter().chain(sources);
        let texts = texts.map(|(path, text)| (path, text.into_bytes()));
        Ok(zipped(texts.chain(library)))
    }

    fn library_path(&self, fmu: &Fmu) -> String {
        let ending = std::env::consts::DLL_SUFFIX;
        format!("binaries/{}/{}{ending}", (self.platform)(), fmu.identifier)
    }
}

/// The code of the unit that all versions share.
fn code(model: &ExportModel, names: &Names, token: &str) -> String {
    let (n, lags) = (model.joints(), variables::lags(model));
    let rest = match model.internal().next() {
        Some(_) => "\n    model_rest(&data->parameters, data->state);",
        None => "",
    };
    let parameters = &model.equations.parameters;
    let addresses = parameters
        .iter()
        .map(|p| format!("&data->parameters.{}", names.field(&p.name)));
    let addresses: Vec<String> = addresses.chain(["NULL".to_owned()]).collect();
    let lag_state = |joint: Joint| match lags.iter().position(|lag| *lag == joint) {
        Some(k) => (model.states() + k).to_string(),
        None => "-1".to_owned(),
    };
    let each = |of: &dyn Fn(Joint) -> String| Joint::all(n).map(of).collect::<Vec<_>>().join(", ");
    let delays = each(&|joint| names.filter(model, joint, CommandFilter::Delay));
    let time_constants = each(&|joint| names.filter(model, joint, CommandFilter::Lag));
    let points = if self::delays(model) { 4096 } else { 2 };
    names.fill(&filled(
        include_str!("unit.h"),
        &[
            ("TOKEN", &token),
            ("LAGS", &lags.len()),
            ("REST", &rest),
            ("PARAMETERS", &parameters.len()),
            ("POINTS", &points),
            ("LAG_STATE", &each(&lag_state)),
            ("ADDRESSES", &addresses.join(", ")),
            ("DELAYS", &delays),
            ("FILTER_LAGS", &time_constants),
            ("STEP", &format!("{:?}", model.step_s)),
        ],
    ))
}

/// The shared library, compiled from the first source, which includes the others; none without a compiler.
fn library(
    model: &ExportModel,
    sources: &[(&str, String)],
) -> Result<Option<Vec<u8>>, ExportError> {
    let refused = |reason| model.refused("FMU", reason);
    let io =
        |error: std::io::Error| refused(format!("no temporary folder to compile it in: {error}"));
    let folder = tempfile::tempdir().map_err(io)?;
    let at = |name: &str| folder.path().join(name);
    for (name, text) in sources {
        std::fs::write(at(name), text).map_err(io)?;
    }
    let mut command = compiler();
    command.args([
        "-std=c99",
        "-O2",
        "-fPIC",
        "-shared",
        "-fvisibility=hidden",
        "-o",
    ]);
    command.args([&at("library"), &at(sources[0].0)]).arg("-lm");
    match compile(command) {
        Ok(()) => std::fs::read(at("library")).map(Some).map_err(io),
        Err(ClientError::Unavailable(_)) => Ok(None),
        Err(ClientError::Failed(said) | ClientError::NotFinite(said)) => Err(refused(said)),
    }
}

/// A ZIP archive without dates, so that the same files give the same bytes.
fn zipped(files: impl Iterator<Item = (String, Vec<u8>)>) -> Vec<u8> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in files {
        let written = writer
            .start_file(path, options)
            .map(|()| writer.write_all(&bytes));
        written
            .expect("memory takes everything")
            .expect("memory takes everything");
    }
    writer
        .finish()
        .expect("memory takes everything")
        .into_inner()
}

//! FMI 3.0: the model with its C code as a unit of other simulators, for model exchange and for co-simulation.

mod description;
mod unit;
mod variables;

use std::io::{Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::c::{Names, compile, compiler, header};
use super::{Answers, ExportError, File, Format, Portable, PythonClient, Reader, Samples, Unread};
use crate::model::CommandFilter;

pub(super) const FORMAT: Format = Format {
    name: "fmu",
    about: "FMI 3.0 for model exchange and co-simulation, physical parameters tunable",
    limits,
    files: |model, path| {
        Ok(vec![File {
            path: path.to_owned(),
            bytes: archive(model)?,
            about: "functional mock-up unit".into(),
        }])
    },
    reader: Reader::Own(ask),
    tolerance: 1e-9,
};

const CLIENT: PythonClient = PythonClient {
    name: "fmu.py",
    script: include_str!("../../../docs/clients/fmu.py"),
    packages: "fmpy",
};

/// What FMPy predicts, where the unit holds a library that can run.
fn ask(path: &Path, samples: &Samples) -> Result<Answers, Unread> {
    let refused =
        |error: &dyn std::error::Error| Unread::Refused(format!("{}: {error}", path.display()));
    let file = std::fs::File::open(path).map_err(|error| refused(&error))?;
    let archive = ZipArchive::new(file).map_err(|error| refused(&error))?;
    let runs = archive
        .file_names()
        .flatten()
        .any(|name| name.starts_with("binaries/"));
    match runs {
        true => CLIENT.ask(path, samples),
        false => Err(Unread::NoReader(
            "the unit holds no library; name a C compiler in CC".to_owned(),
        )),
    }
}

fn limits(model: &Portable) -> Vec<String> {
    let delay = delays(model).then(|| {
        "the delay between steps of model exchange: there a delayed torque follows straight lines through the points \
         that the importer accepted; co-simulation has it as it is"
            .to_owned()
    });
    let binary = match compile(version()) {
        Ok(()) => None,
        Err(reason) => Some(format!(
            "a binary, the FMU holds source code alone: {reason}"
        )),
    };
    model
        .sensor_limits()
        .into_iter()
        .chain(delay)
        .chain(binary)
        .collect()
}

fn version() -> std::process::Command {
    let mut command = compiler();
    command.arg("--version");
    command
}

/// Whether a torque of the past matters.
fn delays(model: &Portable) -> bool {
    (0..model.joints()).any(|joint| model.filter(joint, CommandFilter::Delay).is_some())
}

fn archive(model: &Portable) -> Result<Vec<u8>, ExportError> {
    let names = Names::new(model);
    let header = header(model)?;
    let token = format!("{}-{:08x}", names.lower, crc32c::crc32c(header.as_bytes()));
    let variables = variables::variables(model, &names);
    let source = source(model, &names, &token);
    let build = include_str!("buildDescription.xml").replace("@IDENTIFIER@", &names.lower);
    let description = description::description(model, &names.lower, &token, &variables);
    let mut files = vec![
        ("modelDescription.xml".to_owned(), description.into_bytes()),
        (
            "sources/buildDescription.xml".to_owned(),
            build.into_bytes(),
        ),
        ("sources/fmi3.c".to_owned(), source.clone().into_bytes()),
        ("sources/model.h".to_owned(), header.clone().into_bytes()),
    ];
    files.extend(binary(model, &names, &source, &header)?);
    Ok(zipped(&files))
}

fn source(model: &Portable, names: &Names, token: &str) -> String {
    let (n, lags) = (model.joints(), variables::lags(model));
    let parameters = &model.equations.parameters;
    let addresses = parameters
        .iter()
        .map(|p| format!("&data->parameters.{}", names.field(&p.name)));
    let addresses: Vec<String> = addresses.chain(["NULL".to_owned()]).collect();
    let lag_state = |joint: usize| match lags.iter().position(|lag| *lag == joint) {
        Some(k) => (2 * n + k).to_string(),
        None => "-1".to_owned(),
    };
    let each = |of: &dyn Fn(usize) -> String| (0..n).map(of).collect::<Vec<_>>().join(", ");
    let filled = include_str!("fmi3.c")
        .replace("@TOKEN@", token)
        .replace("@LAGS@", &lags.len().to_string())
        .replace("@PARAMETERS@", &parameters.len().to_string())
        .replace("@POINTS@", if delays(model) { "4096" } else { "2" })
        .replace("@LAG_STATE@", &each(&lag_state))
        .replace("@ADDRESSES@", &addresses.join(", "))
        .replace(
            "@DELAYS@",
            &each(&|joint| names.filter(model, joint, CommandFilter::Delay)),
        )
        .replace(
            "@FILTER_LAGS@",
            &each(&|joint| names.filter(model, joint, CommandFilter::Lag)),
        )
        .replace("@STEP@", &format!("{:?}", model.step_s));
    names.fill(&filled)
}

/// The shared library for this machine, where there is a compiler.
fn binary(
    model: &Portable,
    names: &Names,
    source: &str,
    header: &str,
) -> Result<Option<(String, Vec<u8>)>, ExportError> {
    let refused = |reason: String| ExportError::Model {
        format: "FMU",
        system: model.name().to_owned(),
        reason,
    };
    let io = |error: std::io::Error| refused(format!("there is no place to compile it: {error}"));
    let folder = tempfile::tempdir().map_err(io)?;
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("fmi3.c"), source).map_err(io)?;
    std::fs::write(at("model.h"), header).map_err(io)?;
    let mut command = compiler();
    command.args([
        "-std=c99",
        "-O2",
        "-fPIC",
        "-shared",
        "-fvisibility=hidden",
        "-o",
    ]);
    command.args([&at("library"), &at("fmi3.c")]).arg("-lm");
    match compile(command) {
        Ok(()) => {}
        Err(Unread::NoReader(_)) => return Ok(None),
        Err(Unread::Refused(said)) => return Err(refused(said)),
    }
    let bytes = std::fs::read(at("library")).map_err(io)?;
    Ok(Some((binary_path(names), bytes)))
}

fn binary_path(names: &Names) -> String {
    let system = match std::env::consts::OS {
        "macos" => "darwin",
        other => other,
    };
    let (arch, ending) = (std::env::consts::ARCH, std::env::consts::DLL_SUFFIX);
    let ending = if system == "darwin" { ".dylib" } else { ending };
    format!("binaries/{arch}-{system}/{}{ending}", names.lower)
}

/// The same bytes for the same files: they carry no date.
fn zipped(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in files {
        let written = writer
            .start_file(path, options)
            .map(|()| writer.write_all(bytes));
        written
            .expect("memory takes everything")
            .expect("memory takes everything");
    }
    writer
        .finish()
        .expect("memory takes everything")
        .into_inner()
}

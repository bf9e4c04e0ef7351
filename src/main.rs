use std::process::ExitCode;

fn main() -> ExitCode {
    residyn::cli::run(std::env::args_os()).into()
}

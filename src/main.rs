use std::process::ExitCode;

fn main() -> ExitCode {
    residyn::cli::main()
}

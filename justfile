# What developers run; `just` lists it. .ci/run does all of it in one go.

_list:
    @just --list

# Format the code
fmt:
    cargo fmt --all

# Lints, as errors
lint:
    cargo clippy --release --workspace --all-targets -- -D warnings

# All tests; arguments go to cargo test, which then runs alone
test *arguments:
    tests/run {{arguments}}

# The tests that answer within two minutes once all is built
quick *arguments:
    tests/run --quick {{arguments}}

# The library's documentation
doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps

# Licences, advisories, bans and sources of the dependencies
deny:
    cargo deny check

# Count instructions against the committed counts; --update writes them
instructions *arguments:
    benches/instructions {{arguments}}

# Everything that must hold before a change is taken
ci:
    .ci/run

# A release in target/dist: static binary, wheel, bills of materials, checksums
release:
    scripts/release

# Build the committed release again elsewhere, and compare the bytes
reproduce:
    scripts/reproduce

# Run the demo and refresh the pictures of the README
demo:
    cargo run --release -- closeloop --out target/demo
    cp target/demo/residual.svg docs/demo-residual.svg
    cp target/demo/errors.svg docs/demo-errors.svg

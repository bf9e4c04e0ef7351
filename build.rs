fn main() {
    // The folder is embedded whole: a new system or effect must not need a change of code.
    println!("cargo::rerun-if-changed=models");
}

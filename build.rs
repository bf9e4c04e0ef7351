fn main() {
    // These folders are embedded whole: a new system, effect, plant or task must not need a change of code.
    println!("cargo::rerun-if-changed=models");
    println!("cargo::rerun-if-changed=configs");
}

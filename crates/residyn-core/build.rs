fn main() {
    // These folders are embedded whole: a new system, effect or plant must not need a change of code.
    println!("cargo::rerun-if-changed=../../models");
    println!("cargo::rerun-if-changed=../../configs/plants");
}

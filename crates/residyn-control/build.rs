fn main() {
    // This folder is embedded whole: a new task must not need a change of code.
    println!("cargo::rerun-if-changed=../../configs/tasks");
}

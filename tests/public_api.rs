//! The crates' interfaces compared with the committed lists: what users call changes on purpose, not by chance.

use crate::support::committed::is_as_committed;
use crate::support::interface::interface;
use crate::support::paths::{crates, ours};

#[test]
fn the_interfaces_are_those_that_are_listed() {
    for (name, folder) in crates() {
        let found = interface(&folder.join("src/lib.rs"));
        let listed = ours("tests/public_api").join(format!("{name}.txt"));
        is_as_committed(&listed, &found, |a, b| a == b);
    }
}

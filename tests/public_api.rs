//! The library's interface beside the list that is committed: what users call changes when that is meant, and not by chance.

use crate::support::committed::is_as_committed;
use crate::support::interface::interface;
use crate::support::paths::ours;

#[test]
fn the_interface_is_the_one_that_is_listed() {
    let found = interface(&ours("src/lib.rs"));
    is_as_committed(&ours("tests/public_api.txt"), &found, |a, b| a == b);
}

//! Real clients read what the program writes: Python with the packages of `tests/clients`.

use crate::support::clients::client;
use crate::support::demo::demo;
use crate::support::paths::schema_path;

#[test]
fn python_reads_the_weights_of_a_checkpoint() {
    client("weights.py", &[demo()]);
}

#[test]
fn report_matches_its_published_schema() {
    client("report.py", &[demo(), &schema_path()]);
}

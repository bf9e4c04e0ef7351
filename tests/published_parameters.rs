//! Model files of published parameter sets against accelerations worked out by hand from the published equations.

use residyn::read_model;
use residyn_core::expr::SignForm;
use residyn_core::model::Library;

use crate::support::catalogue::{assert_all_near, dynamics};
use crate::support::paths::ours;

/// The file, then points: states and torques, and the accelerations at each.
type Case = (&'static str, &'static [(&'static [f64], &'static [f64])]);

const CASES: [Case; 3] = [
    (
        "dfki_double_pendulum_c1_model_1",
        &[
            (
                &[0.3, -0.5, 0.0, 0.0, 0.4, -0.2],
                &[-2.39033363155, 5.63750113942],
            ),
            (
                &[2.0, 1.0, 3.0, -4.0, 0.5, 1.5],
                &[-65.4021789557, 106.548395909],
            ),
            (
                &[-1.2, 0.7, -0.002, 6.0, 0.0, 0.0],
                &[53.2823555375, -64.6690450302],
            ),
        ],
    ),
    (
        "dfki_double_pendulum_c1_model_2",
        &[
            (
                &[0.3, -0.5, 0.0, 0.0, 0.4, -0.2],
                &[-1.74637960783, 4.58666642858],
            ),
            (
                &[2.0, 1.0, 3.0, -4.0, 0.5, 1.5],
                &[-65.1751748729, 105.646250283],
            ),
            (
                &[-1.2, 0.7, -0.002, 6.0, 0.0, 0.0],
                &[52.0059501038, -62.3711973769],
            ),
        ],
    ),
    (
        "dfki_simple_pendulum_published",
        &[
            (&[0.3, 0.0, 0.4], &[2.86909666345]),
            (&[2.0, 3.0, -0.5], &[-28.2034139567]),
            (&[-1.2, -0.002, 0.0], &[16.7231314003]),
        ],
    ),
];

/// The accelerations above are rounded to twelve digits.
const ROUNDING: f64 = 1e-10;

#[test]
fn published_parameter_sets_have_the_published_accelerations() {
    for (name, points) in CASES {
        let file = ours("docs/rigs").join(name).with_extension("toml");
        let system = read_model(&file, &Library::built_in()).unwrap();
        assert_eq!(system.name, name);
        let model = dynamics(&system, &[], SignForm::Exact);
        for (state, wanted) in points {
            let inputs = [state, [0.0].as_slice(), &model.values()].concat();
            let found = model.program.eval(&inputs);
            assert_all_near(&found[model.joints..], wanted, ROUNDING, name);
        }
    }
}

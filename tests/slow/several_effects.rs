//! Effects that no log shows alone: all of them act at each speed and each angle.

use crate::support::Scratch;

/// A pendulum, how it is driven and read, and its friction.
struct Rig {
    parameters: [f64; 2],
    torque: f64,
    rate_hz: f64,
    /// Standard deviation and step of the encoder, rad.
    sensor: [f64; 2],
    /// b in N m s/rad, `F_c` in N m, c in N m s^2/rad^2: each lowers the loss by more than a tenth.
    friction: [f64; 3],
}

/// From a light fast rod to a heavy slow one; the last stands upright.
const RIGS: [Rig; 5] = [
    Rig {
        parameters: [-17.4, 4.6],
        torque: 1.6,
        rate_hz: 100.0,
        sensor: [5e-4, 1.534e-3],
        friction: [0.03, 0.12, 0.02],
    },
    Rig {
        parameters: [-25.0, 14.0],
        torque: 0.7,
        rate_hz: 200.0,
        sensor: [2e-4, 3.83e-4],
        friction: [0.01, 0.04, 0.008],
    },
    Rig {
        parameters: [-9.0, 1.8],
        torque: 4.0,
        rate_hz: 250.0,
        sensor: [1e-4, 1e-4],
        friction: [0.1, 0.3, 0.06],
    },
    Rig {
        parameters: [-40.0, 20.0],
        torque: 0.5,
        rate_hz: 500.0,
        sensor: [1e-3, 0.0],
        friction: [0.012, 0.03, 0.003],
    },
    Rig {
        parameters: [12.0, 3.0],
        torque: 3.0,
        rate_hz: 100.0,
        sensor: [3e-4, 7.67e-4],
        friction: [0.05, 0.25, 0.04],
    },
];

impl Rig {
    fn plant(&self) -> String {
        let ([c_g, c_i], [noise, step], [b, f_c, c]) =
            (self.parameters, self.sensor, self.friction);
        format!(
            "model = \"pendulum\"\nparameters = {{ C_g = {c_g}, C_i = {c_i} }}\n\
             sensor = {{ rate_hz = {}, position_noise = {noise}, position_step = {step} }}\n\
             excitation = {{ amplitude = [{}], band_hz = [0.15, 2.0], tones = 8 }}\n\
             recording = {{ logs = 1, duration_s = 12, start = [0, 0] }}\n\
             effect = [{{ name = \"viscous_friction\", joint = 1, b = {b} }}, \
             {{ name = \"coulomb_friction\", joint = 1, F_c = {f_c} }}, \
             {{ name = \"quadratic_drag\", joint = 1, c = {c} }}]\n",
            self.rate_hz, self.torque
        )
    }
}

#[test]
fn friction_of_three_kinds_is_named_as_such() {
    for (k, rig) in RIGS.iter().enumerate() {
        let scratch = Scratch::new();
        scratch.file("rig.toml", rig.plant());
        scratch.simulates("rig.toml", &[1, 2, 3, 4]);
        let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
        let report = scratch.json(&format!("closeloop --model pendulum {logs} --out report"));
        let effects = report["effects"].as_array().unwrap();
        let mut found: Vec<(&str, f64)> = (effects.iter())
            .map(|effect| {
                let value = effect["parameters"][0]["value"].as_f64().unwrap();
                (effect["name"].as_str().unwrap(), value)
            })
            .collect();
        found.sort_by_key(|(name, _)| *name);
        let [b, f_c, c] = rig.friction;
        let true_ones = [
            ("coulomb_friction", f_c),
            ("quadratic_drag", c),
            ("viscous_friction", b),
        ];
        assert_eq!(found.len(), 3, "rig {k}: {found:?}");
        for ((name, value), (wanted, truth)) in found.iter().zip(true_ones) {
            let off = (value / truth - 1.0).abs();
            assert!(*name == wanted && off < 0.05, "rig {k}: {found:?}");
        }
        assert_eq!(report["verdict"], "explained", "rig {k}");
    }
}

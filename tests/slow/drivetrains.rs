//! Drivetrains that MuJoCo simulates, by laws of its own: a second body on a spring or with play, and its DC motor with
//! friction that gives before it slips, with cogging, and with a winding that heats up.

use std::path::Path;

use crate::support::Scratch;
use crate::support::clients::{client, interpreter_for};
use crate::support::reports::names;

/// A mass of 1 kg on an arm of 0.5 m, and what drives it.
struct Rig {
    /// What stands between the world and the arm, and the arm's joint.
    bodies: [&'static str; 3],
    actuators: &'static str,
    /// Largest part of the control; step and length of the logs in s.
    amplitude: f64,
    log_s: [f64; 2],
    /// The torque that the model declares.
    torque: &'static str,
    /// The effect it lacks, with its first parameters in the order of its file.
    lacks: &'static str,
    values: &'static [f64],
}

const ARM: [&str; 3] = ["", r#"<joint name="driven" axis="0 1 0"/>"#, ""];
const ROTOR: &str = r#"<body><joint name="driven" axis="0 1 0"/><inertial pos="0 0 0" mass="0.001" diaginertia="0.02 0.02 0.02"/>"#;
const DIRECT: &str = r#"<motor joint="driven"/>"#;

/// Where only the ripple or the friction of a DC motor is wanted, its torque constant is next to nothing.
const RIGS: [Rig; 5] = [
    Rig {
        bodies: [
            ROTOR,
            r#"<joint axis="0 1 0" stiffness="60" damping="0.3"/>"#,
            "</body>",
        ],
        actuators: DIRECT,
        amplitude: 0.5,
        log_s: [0.005, 6.0],
        torque: "cmd1",
        lacks: "joint_elasticity",
        values: &[60.0, 0.3, 0.02, 1.0],
    },
    // The stiffness of the stops is MuJoCo's own.
    Rig {
        bodies: [
            ROTOR,
            r#"<joint axis="0 1 0" limited="true" range="-0.015 0.015" solreflimit="0.004 1" solimplimit="0.99 0.999 1e-4"/>"#,
            "</body>",
        ],
        actuators: DIRECT,
        amplitude: 0.5,
        log_s: [0.005, 8.0],
        torque: "cmd1",
        lacks: "motor_backlash",
        values: &[0.03],
    },
    Rig {
        bodies: ARM,
        actuators: r#"<motor joint="driven"/>
            <dcmotor joint="driven" motorconst="1e-6" resistance="1" lugre="40 0.2 0.2 0.3 0.1"/>"#,
        amplitude: 0.5,
        log_s: [0.005, 10.0],
        torque: "cmd1",
        lacks: "lugre_friction",
        values: &[0.2, 0.3, 0.1, 40.0, 0.2],
    },
    Rig {
        bodies: ARM,
        actuators: r#"<motor joint="driven"/>
            <dcmotor joint="driven" motorconst="1e-6" resistance="1" cogging="0.1 8 0.3"/>"#,
        amplitude: 0.3,
        log_s: [0.005, 8.0],
        torque: "cmd1",
        lacks: "cogging_torque",
        values: &[0.1, 8.0, 0.3],
    },
    // 3 K/W and 5 J/K, and 0.39 % more resistance per K: heat of tau^2 R / K^2 makes 0.0936 of it per N^2 m^2.
    Rig {
        bodies: ARM,
        actuators: r#"<dcmotor joint="driven" motorconst="0.5" resistance="2" thermal="3 5 0 0.0039 25 25"/>"#,
        amplitude: 5.0,
        log_s: [0.01, 30.0],
        torque: "0.5 / 2 * (cmd1 - 0.5 * qd1)",
        lacks: "winding_heat",
        values: &[0.0936, 15.0],
    },
];

impl Rig {
    fn drawing(&self) -> String {
        let [before, joint, after] = self.bodies;
        format!(
            r#"<mujoco><compiler angle="radian"/><option timestep="0.0001" integrator="implicitfast"><flag contact="disable"/></option>
            <worldbody>{before}<body>{joint}<inertial pos="0 0 -0.5" mass="1" diaginertia="1e-7 1e-7 1e-7"/></body>{after}</worldbody>
            <actuator>{}</actuator></mujoco>"#,
            self.actuators
        )
    }

    fn model(&self) -> String {
        format!(
            "[system]\nname = \"arm\"\njoints = 1\n\n[parameters]\nC_g = {{ value = 19.62, unit = \"1/s^2\" }}\n\
             C_i = {{ value = 4.0, unit = \"1/(kg m^2)\", positive = true }}\n\n[drive]\ntau1 = \"{}\"\n\n\
             [dynamics]\nqdd1 = \"C_i * tau1 - C_g * sin(q1)\"\n",
            self.torque
        )
    }
}

#[test]
fn drivetrains_of_mujoco_are_named_with_their_values() {
    if interpreter_for("drivetrain.py").is_none() {
        return;
    }
    for rig in &RIGS {
        let scratch = Scratch::new();
        scratch.file("rig.xml", rig.drawing());
        scratch.file("arm.toml", rig.model());
        let numbers = [rig.amplitude, rig.log_s[0], rig.log_s[1]].map(|number| number.to_string());
        let drawing = scratch.path("rig.xml");
        let logs = ["run1.csv", "run2.csv", "run3.csv", "run4.csv"].map(|name| scratch.path(name));
        let numbers = numbers.iter().map(Path::new);
        let arguments: Vec<&Path> = std::iter::once(drawing.as_path())
            .chain(numbers)
            .chain(logs.iter().map(|log| log.as_path()))
            .collect();
        client("drivetrain.py", &arguments);
        let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
        let report = scratch.json(&format!("closeloop --model arm.toml {logs} --out out"));
        assert_eq!(report["verdict"], "explained", "{}: {report:#}", rig.lacks);
        assert_eq!(names(&report), [rig.lacks]);
        for (k, truth) in rig.values.iter().enumerate() {
            let parameter = &report["effects"][0]["parameters"][k];
            let value = parameter["value"].as_f64().unwrap();
            assert!(
                (value / truth - 1.0).abs() < 0.05,
                "{}: {parameter}",
                rig.lacks
            );
        }
    }
}

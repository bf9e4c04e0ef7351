use residyn_excite::{Drives, JointLimits, Limits as Allowed};
use residyn_plants::{Commanded, Guard, Limits};

/// Keeps commands within the limits of angle, speed and command for which a motion was designed, from measured positions `q`. The
/// motion ends at its limits with speed zero, so nothing is braked ahead of them.
pub fn guard(allowed: &Allowed, driven_by: Drives, q: &[f64]) -> Guard {
    let joints = &allowed.joints;
    let (kind, of_joint): (_, fn(&JointLimits) -> Sent) = match driven_by {
        Drives::Torque => (Commanded::Torque, torque),
        Drives::Command => (Commanded::Position, command),
    };
    let sent: Vec<Sent> = joints.iter().map(of_joint).collect();
    let limits = Limits {
        command: sent.iter().map(|sent| sent.range).collect(),
        rate: Some(sent.iter().map(|sent| sent.rate).collect()),
        speed: Some(joints.iter().map(|joint| Some(joint.speed)).collect()),
        angle: Some(joints.iter().map(|joint| Some(joint.angle)).collect()),
        brake_s: 0.0,
    };
    let safe = vec![0.0; q.len()];
    Guard::within(limits, (kind, &safe), allowed.step_s, q)
}

/// What may be sent to a joint, and how fast it may change per s.
struct Sent {
    range: [f64; 2],
    rate: Option<f64>,
}

fn torque(joint: &JointLimits) -> Sent {
    let most = joint.torque.unwrap_or(f64::INFINITY);
    Sent {
        range: [-most, most],
        rate: joint.torque_rate,
    }
}

fn command(joint: &JointLimits) -> Sent {
    Sent {
        range: joint.command.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
        rate: joint.command_rate,
    }
}

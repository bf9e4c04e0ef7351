//! The figure of a designed motion.

use residyn_core::data::Joint;
use residyn_core::model::Model;
use residyn_plot::{JointKind, Panel, PlotError, Role, Track, predictions};

use crate::design::Design;
use crate::limits::Limits;

/// One panel per joint, as an SVG document: its angle over time, between its limits.
///
/// # Errors
/// None with at least one joint.
pub fn picture(model: &Model, limits: &Limits, design: &Design) -> Result<String, PlotError> {
    let panel = |joint: Joint| {
        let channel = design.time.iter().zip(&design.q[joint.index()]);
        let motion = channel.map(|(time, angle)| (*time, *angle)).collect();
        let line = |angle: f64| vec![(0.0, angle), (design.duration_s, angle)];
        Panel {
            label: model.joint_label(joint),
            quantity: JointKind::of(model.prismatic[joint]).position(joint),
            tracks: vec![
                Track {
                    label: "limits".to_owned(),
                    role: Role::Measured,
                    segments: limits.joints[joint.index()].angle.map(line).to_vec(),
                },
                Track {
                    label: "motion".to_owned(),
                    role: Role::After,
                    segments: vec![motion],
                },
            ],
        }
    };
    let panels: Vec<Panel> = Joint::all(model.joints).map(panel).collect();
    predictions(&panels, &format!("{}: motion that tells most", model.name))
}

//! What the effects leave unexplained.

use super::{Block, folded, heading, paragraph, paragraphs};
use crate::schema::Report;
use crate::wording::{FITTED, WITH_EFFECTS, p_value};
use residyn_core::closeloop::{ErrorModel, Probed, Proposal, UNKNOWN};
use residyn_core::data::Joint;

/// What is left of the residuals, and a formula for it.
pub(super) fn left(report: &Report) -> Vec<Block> {
    let norm = &report.residual_norm;
    let force = |value: Option<f64>| match value {
        Some(value) => format!("{value:.4}"),
        None => format!(
            "not computed ({})",
            norm.failure.as_deref().unwrap_or_default()
        ),
    };
    let size = format!(
        "Residual generalised force: {} ({FITTED}) and {} ({WITH_EFFECTS}), root mean square over blocks of {} s in {}.",
        force(norm.before),
        force(norm.after),
        report.settings.diagnostics.block_s,
        super::force_unit(report)
    );
    let said = [Some(structure(report)), network(report), Some(size)];
    let said = paragraphs(said.into_iter().flatten());
    let proposal = report.unexplained.proposal.as_ref();
    let proposal = proposal.map(|proposal| proposed(report, proposal));
    let title = vec![heading("What is left")];
    [title, said, Vec::from_iter(proposal)].concat()
}

/// What the residuals show, in a sentence or two.
pub(crate) fn structure(report: &Report) -> String {
    let left = &report.unexplained.left;
    let settings = &report.settings.diagnostics;
    let p = p_value(left.p_value);
    let share = 100.0 * left.omnibus.most().1;
    let structure = match left.place.as_str() {
        UNKNOWN => format!(
            "The residuals are not white noise ({p}; {share:.0} % of their variance exceeds it), but they are not a \
             smooth function of angle, speed, torque or time. Candidates are effects that were not looked for: {}a link \
             that bends, a periodic disturbance.",
            match report.compared {
                ErrorModel::OutputError => "",
                // Torques follow from a smoothed motion, which is slower than a motor swings against its link.
                ErrorModel::InverseDynamics => "a spring or play between a motor and its link, ",
            }
        ),
        place if left.is_significant() => format!("The residual depends on {place} ({p})."),
        _ if left.p_value < settings.significance => format!(
            "The residual has structure ({p}), but too little to matter: {share:.1} % of the residuals' variance \
             exceeds white noise, and no probe lowers the loss by {:.0} %.",
            100.0 * settings.noteworthy_share
        ),
        _ => format!("The residuals cannot be distinguished from sensor noise ({p})."),
    };
    match left.fraction < 1.0 {
        true => format!(
            "Of the residual variance above the sensor noise, {:.1} % is left. {structure}",
            100.0 * left.fraction
        ),
        false => structure,
    }
}

/// Says that no network is used and why, if one was to be trained.
fn network(report: &Report) -> Option<String> {
    let check = report.network.as_ref().filter(|check| !check.used)?;
    let why = match &check.failure {
        None => "No residual network lowers the error on parts of the training logs that it was not trained on".to_owned(),
        Some(failure) => format!("The training of a residual network failed ({failure})"),
    };
    Some(format!(
        "{why}: the hybrid model is the one without a network."
    ))
}

/// On which variables the residual of a joint depends, by how far flexible shapes over them lower the loss.
fn sensitivity(report: &Report, joint: Joint) -> String {
    let probes = report.unexplained.left.probes.iter();
    let mut seen: Vec<&Probed> = probes
        .filter(|probe| probe.joint == joint && probe.gain > 0.0)
        .collect();
    seen.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    if seen.is_empty() {
        return "No flexible shape over the present angle, speed, torque or time lowers the loss on left-out blocks.".to_owned();
    }
    let shape = |probe: &&Probed| format!("`{}` {:.1} %", probe.place, 100.0 * probe.gain);
    let shapes: Vec<String> = seen.iter().map(shape).collect();
    format!(
        "Flexible shapes over these variables lower the loss on left-out blocks: {}.",
        shapes.join(", ")
    )
}

fn proposed(report: &Report, proposal: &Proposal) -> Block {
    let about = format!(
        "Force `{}` removes {:.0} % of the residual on blocks left out of its fit, and is supported only by that fit. As an \
         effect file, for your own folder of effects:",
        proposal.formula,
        100.0 * proposal.explains
    );
    let file = Block::Code(proposal.file.clone());
    folded(
        format!("A proposal, not a finding, for joint {}", proposal.joint),
        vec![
            paragraph(sensitivity(report, proposal.joint)),
            paragraph(about),
            file,
        ],
    )
}

/// `proposal, not a finding: force on joint 1 ~ -0.0012 * qd1^3 (explains 81 % of the residual on held-out blocks)`
pub(crate) fn proposal_line(proposal: &Proposal) -> String {
    format!(
        "proposal, not a finding: force on joint {} ~ {} (explains {:.0} % of the residual on held-out blocks)",
        proposal.joint,
        proposal.formula,
        100.0 * proposal.explains
    )
}

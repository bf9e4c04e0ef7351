//! The section of `report.md` on what the effects leave unexplained.

use super::wording::{FITTED, WITH_EFFECTS, capitalised, probability};
use crate::closeloop::{Outcome, Proposal, ResidualForce, UNKNOWN};
use crate::identify::FitError;

/// What is left of the residuals, and a formula for it.
pub(super) fn remainder(outcome: &Outcome) -> String {
    let left = &outcome.remainder.unexplained;
    let settings = &outcome.given.settings.remainder;
    let p = probability(left.p_value);
    let share = 100.0 * left.omnibus.most().1;
    let structure = match left.place.as_str() {
        UNKNOWN => format!(
            "The residuals are not white noise (p = {p}; {share:.0} % of their variance exceeds it), but they are no smooth \
             function of angle, speed, torque or time. Candidates are effects with a state or a frequency of their own: \
             joint compliance, presliding friction, a periodic disturbance."
        ),
        place if left.is_significant() => format!("The remainder depends on {place} (p = {p})."),
        _ if left.p_value < settings.significance => format!(
            "The remainder has structure (p = {p}), but too little to matter: {share:.1} % of the residuals' variance \
             exceeds white noise, and no probe lowers the loss by {:.0} %.",
            100.0 * settings.noteworthy
        ),
        _ => format!("The residuals cannot be told from sensor noise (p = {p})."),
    };
    let cut = if left.fraction < 1.0 {
        let share = 100.0 * left.fraction;
        format!("Of the residual variance above the sensor noise, {share:.1} % is left. ")
    } else {
        String::new()
    };
    let network = match &outcome.learned {
        Some(learned) if !learned.check.used => {
            "No residual network lowers the error on parts of the training logs that it was not trained on: the hybrid \
             model is the one without a network.\n"
        }
        _ => "",
    };
    format!(
        "## What is left\n\n{cut}{structure}\n{network}\
         Residual generalised force: {} ({FITTED}) and {} ({WITH_EFFECTS}), root mean square over stretches of {} s in \
         N m or N.\n\n\
         ![residual](residual.svg)\n\n{}",
        force(&outcome.remainder.before),
        force(&outcome.remainder.after),
        settings.stretch_s,
        outcome
            .remainder
            .proposal
            .as_ref()
            .map(proposed)
            .unwrap_or_default()
    )
}

fn force(force: &Result<ResidualForce, FitError>) -> String {
    match force {
        Ok(force) => format!("{:.4}", force.norm()),
        Err(error) => format!("not computed ({error})"),
    }
}

fn proposed(proposal: &Proposal) -> String {
    format!(
        "{}.\nSupported only by its fit. As an effect file, for a folder given with `--effects`:\n\n\
         ```toml\n{}```\n\n",
        capitalised(&proposal_line(proposal)),
        proposal.file
    )
}

/// `proposal, not a finding: force on joint 1 ~ -0.0012 * qd1^3 (explains 81 % of the remainder on held-out stretches)`
pub(super) fn proposal_line(proposal: &Proposal) -> String {
    format!(
        "proposal, not a finding: force on joint {} ~ {} (explains {:.0} % of the remainder on held-out stretches)",
        proposal.joint,
        proposal.formula,
        100.0 * proposal.explains
    )
}

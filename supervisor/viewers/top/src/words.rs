//! Guidance, deaths and stalls in words.

use common::samples::{
    DeathSample, GuidanceStatus, RecoveryStep, StallCause, StallSample, name_str,
};
use processes::process::ExitCause;

/// The status of the planner, a [`GuidanceStatus`].
pub(super) const fn guidance(status: u8) -> &'static str {
    match GuidanceStatus::from_byte(status) {
        GuidanceStatus::Waiting => "waits for a field",
        GuidanceStatus::Along => "along the field",
        GuidanceStatus::AtTarget => "beside the target",
        GuidanceStatus::WayOut => "out of a hazard",
        GuidanceStatus::Unreachable => "no way to the target",
        GuidanceStatus::Look => "turn and look",
    }
}

pub(super) fn death(death: &DeathSample) -> String {
    let (stage, generation) = (name_str(&death.stage), death.generation);
    let how = ExitCause::from(death);
    let hung = if death.hung == 1 { "hung, " } else { "" };
    let at = death.stamp.time().seconds();
    format!("{at:.1} s {stage} {generation}: {hung}{how}")
}

pub(super) fn stall(stall: &StallSample) -> String {
    let cause = match stall.cause() {
        StallCause::Still => "stands still",
        StallCause::Pinned => "stays where it is",
        StallCause::InsideHazard => "is inside a hazard",
        StallCause::CutOff => "is cut off",
        StallCause::Held => "is held by its wheels",
        StallCause::Wandering => "wanders",
        StallCause::Relocated => "is elsewhere",
    };
    let recovery = match stall.recovery() {
        RecoveryStep::Replan => "new planner",
        RecoveryStep::Reset => "map reset",
        RecoveryStep::GiveUp => "given up",
    };
    let at = stall.stamp.time().seconds();
    format!("{at:.1} s robot {cause}: {recovery}")
}

//! The code of an error, for scripts: `firsthand` prints it in brackets at the end of the message, `[not-running]`.
//!
//! A script matches the code; the sentence before it may change.

use std::{error::Error, process::ExitCode};

use common::{
    address::AddressError, bus::BusError, checkpoint::CheckpointError, mission::MissionError,
};
use recording::RecordingError;
use supervisor::{
    DomainError, SupervisorError, planner_executable::PlannerExecutableError, recovery::ResumeError,
};
use thiserror::Error;

use super::{fault::FaultError, missions::LookupError};

type Code = Option<&'static str>;

/// A refusal by the command line itself.
#[derive(Debug, Error)]
#[error("{message}")]
pub(crate) struct Refused {
    code: &'static str,
    message: String,
}

impl Refused {
    pub(crate) fn new(code: &'static str, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { code, message }
    }
}

/// The exit code of an invalid mission file: a service manager must not retry.
const INVALID_MISSION: u8 = 78;

/// The exit code of a subcommand that failed with `error`.
pub(crate) fn exit_code(error: &(dyn Error + 'static)) -> ExitCode {
    match of(error) {
        Some("mission" | "unknown-mission" | "planner-executable" | "address") => {
            ExitCode::from(INVALID_MISSION)
        }
        _ => ExitCode::FAILURE,
    }
}

/// The code of `error`; none where no script could react in a way of its own.
pub(crate) fn of(error: &(dyn Error + 'static)) -> Code {
    let code = error.downcast_ref().map(|refused: &Refused| refused.code);
    code.or_else(|| error.downcast_ref().and_then(of_supervisor))
        .or_else(|| error.downcast_ref().and_then(of_resumption))
        .or_else(|| error.downcast_ref().and_then(of_bus))
        .or_else(|| error.downcast_ref().and_then(of_recording))
        .or_else(|| error.downcast_ref().map(of_lookup))
        .or_else(|| error.downcast_ref().map(of_fault))
        .or_else(|| error.is::<MissionError>().then_some("mission"))
        .or_else(|| {
            let planner = error.is::<PlannerExecutableError>();
            planner.then_some("planner-executable")
        })
        .or_else(|| of_simulator(error))
        .or_else(|| of_tool(error))
}

fn of_supervisor(error: &SupervisorError) -> Code {
    match error {
        SupervisorError::Domain(error) => of_domain(error),
        SupervisorError::Bus(error) => of_bus(error),
        SupervisorError::Checkpoint(error) => of_checkpoint(error),
        SupervisorError::Address(AddressError::Form { .. }) => Some("address"),
        _ => None,
    }
}

fn of_domain(error: &DomainError) -> Code {
    match error {
        DomainError::Supervised { .. } => Some("supervised"),
        DomainError::SharedMemory { .. } => Some("shared-memory"),
        DomainError::Descriptors { .. } => Some("descriptors"),
        DomainError::Bus(error) => of_bus(error),
        _ => None,
    }
}

fn of_bus(error: &BusError) -> Code {
    match error {
        BusError::NotRunning { .. } => Some("not-running"),
        BusError::Incompatible { .. } => Some("other-payload"),
        BusError::NoPlace { .. } => Some("no-place"),
        _ => None,
    }
}

fn of_resumption(error: &ResumeError) -> Code {
    match error {
        ResumeError::Ended { .. } => Some("ended"),
        ResumeError::Checkpoint(error) => of_checkpoint(error),
        _ => None,
    }
}

fn of_checkpoint(error: &CheckpointError) -> Code {
    matches!(error, CheckpointError::Foreign { .. }).then_some("other-version")
}

fn of_recording(error: &RecordingError) -> Code {
    match error {
        RecordingError::NoRecording(_) => Some("no-recording"),
        RecordingError::Several { .. } => Some("several-recordings"),
        RecordingError::Foreign { .. } => Some("not-a-recording"),
        _ => None,
    }
}

fn of_lookup(error: &LookupError) -> &'static str {
    match error {
        LookupError::Unknown { .. } | LookupError::Neither { .. } => "unknown-mission",
        _ => "mission",
    }
}

fn of_fault(error: &FaultError) -> &'static str {
    match error {
        FaultError::NoSuchFault { .. } => "unknown-fault",
        FaultError::RealRobot(_) => "real-robot",
        FaultError::NotYet(_) => "not-yet",
        FaultError::NoAnswer(_) => "no-answer",
    }
}

#[cfg(feature = "simulator")]
fn of_simulator(error: &(dyn Error + 'static)) -> Code {
    match error.downcast_ref() {
        Some(x80_sim::SimError::Bind { .. }) => Some("address-in-use"),
        _ => None,
    }
}

#[cfg(not(feature = "simulator"))]
fn of_simulator(_: &(dyn Error + 'static)) -> Code {
    None
}

#[cfg(feature = "tools")]
fn of_tool(error: &(dyn Error + 'static)) -> Code {
    use evaluation::{directory::DirectoryError, experiments::experiment::ExperimentError};
    use recording::replay::live::LiveError;

    use super::field::FieldError;

    if let Some(FieldError::Target { .. }) = error.downcast_ref() {
        return Some("target");
    }
    if let Some(ExperimentError::Unknown { .. }) = error.downcast_ref() {
        return Some("unknown-experiment");
    }
    if let Some(report::ReportError::Recording(error)) = error.downcast_ref() {
        return of_recording(error);
    }
    if let Some(LiveError::Link) = error.downcast_ref() {
        return Some("never-live");
    }
    match error.downcast_ref()? {
        DirectoryError::Taken { .. } => Some("results-there"),
        DirectoryError::Another { .. } => Some("other-results"),
        DirectoryError::System { .. } => None,
    }
}

#[cfg(not(feature = "tools"))]
fn of_tool(_: &(dyn Error + 'static)) -> Code {
    None
}

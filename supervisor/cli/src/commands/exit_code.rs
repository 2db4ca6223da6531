//! The exit code of what a subcommand failed with.

use std::{error::Error, process::ExitCode};

use common::{address::AddressError, mission::MissionError};
use supervisor::{SupervisorError, planner_executable::PlannerExecutableError};

use super::missions::LookupError;

/// The exit code of a mission that is wrongly written, or names what is not there: a service manager need not try again.
const WRONG_MISSION: u8 = 78;

/// The exit code of what a subcommand failed with.
pub(crate) fn of(error: &(dyn Error + 'static)) -> ExitCode {
    let wrong_address = matches!(
        error.downcast_ref(),
        Some(SupervisorError::Address(AddressError::Form { .. }))
    );
    let wrong_mission = error.is::<MissionError>()
        || error.is::<LookupError>()
        || error.is::<PlannerExecutableError>()
        || wrong_address;
    if wrong_mission {
        ExitCode::from(WRONG_MISSION)
    } else {
        ExitCode::FAILURE
    }
}

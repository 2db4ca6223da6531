//! Failures: a sentence, a code for scripts, an exit code, and sometimes a remark.
//!
//! `firsthand` prints the code in brackets at the end, such as `[not-running]`. Only the code is
//! stable.

use std::{error::Error, path::Path, process::ExitCode};

use common::{
    address::AddressError, bus::BusError, checkpoint::CheckpointError, domain::SHARED_MEMORY,
    mission::MissionError, run::RunError, start::StageError,
};
use mission_control::{SupervisorError, operator::OperatorError, recovery::ResumeError};
use processes::{DomainError, planner_executable::PlannerExecutableError};
use recording::RecordingError;

pub use mission_control::{Refused, refuse};

use super::{missions::LookupError, output::say, robots};

/// Sentence that names the input and the remedy.
pub type Failure = Box<dyn Error>;

pub type Result<T = (), E = Failure> = std::result::Result<T, E>;

pub fn report(result: Result<ExitCode>) -> ExitCode {
    result.unwrap_or_else(|error| {
        let error = error.as_ref();
        let code = code(error).map_or(String::new(), |code| format!(" [{code}]"));
        let said = not_running(error).unwrap_or_else(|| error.to_string());
        say(format_args!("{said}{code}"));
        exit_code(error)
    })
}

/// Exit code at which a service manager need not retry.
const INVALID_MISSION: u8 = 78;

fn exit_code(error: &(dyn Error + 'static)) -> ExitCode {
    match code(error) {
        Some("mission" | "unknown-mission" | "planner-executable" | "address") => {
            ExitCode::from(INVALID_MISSION)
        }
        _ => match error.downcast_ref() {
            Some(error) => ExitCode::from(StageError::exit_code(error)),
            None => ExitCode::FAILURE,
        },
    }
}

/// Returns the code, or `None` for errors that no script can handle.
pub fn code(error: &(dyn Error + 'static)) -> Option<&'static str> {
    macro_rules! codes {
        ($($type:ty { $($pattern:pat => $code:expr,)* })*) => {{
            $(if let Some(error) = error.downcast_ref::<$type>() {
                return match error { $($pattern => $code,)* };
            })*
            None
        }};
    }
    codes! {
        Refused {
            refused => Some(refused.code),
        }
        SupervisorError {
            SupervisorError::Domain(error) => code(error),
            SupervisorError::Bus(error) => code(error),
            SupervisorError::Checkpoint(error) => code(error),
            SupervisorError::Address(AddressError::Form { .. }) => Some("address"),
            _ => None,
        }
        ResumeError {
            ResumeError::Ended { .. } => Some("ended"),
            ResumeError::Checkpoint(error) => code(error),
            ResumeError::Run(error) => code(error),
            _ => None,
        }
        RunError {
            RunError::OtherVersion { .. } => Some("other-version"),
            _ => None,
        }
        OperatorError {
            OperatorError::Refused(refused) => Some(refused.code),
            OperatorError::Bus(error) => code(error),
            OperatorError::System(..) => None,
        }
        DomainError {
            DomainError::Supervised { .. } => Some("supervised"),
            DomainError::SharedMemory { .. } => Some("shared-memory"),
            DomainError::Descriptors { .. } => Some("descriptors"),
            DomainError::Bus(error) => code(error),
            _ => None,
        }
        BusError {
            BusError::NotRunning { .. } => Some("not-running"),
            BusError::OtherVersion { .. } => Some("other-version"),
            BusError::Incompatible { .. } => Some("other-payload"),
            BusError::NoPlace { .. } => Some("no-place"),
            _ => None,
        }
        RecordingError {
            RecordingError::NoRecording(_) => Some("no-recording"),
            RecordingError::Several { .. } => Some("several-recordings"),
            RecordingError::Foreign { .. } => Some("not-a-recording"),
            RecordingError::Schema { .. } | RecordingError::Message { .. } => Some("other-version"),
            RecordingError::Run(error) => code(error),
            _ => None,
        }
        LookupError {
            LookupError::Unknown { .. } | LookupError::Neither { .. } => Some("unknown-mission"),
            _ => Some("mission"),
        }
        CheckpointError {
            CheckpointError::Foreign { .. } => Some("other-version"),
            _ => None,
        }
        MissionError {
            _ => Some("mission"),
        }
        PlannerExecutableError {
            _ => Some("planner-executable"),
        }
    }
}

/// Explains an absent robot: another user's, or misspelt.
fn not_running(error: &(dyn Error + 'static)) -> Option<String> {
    let operator = error.downcast_ref().and_then(|error| match error {
        OperatorError::Bus(error) => Some(error),
        _ => None,
    });
    let Some(BusError::NotRunning { robot, .. }) = operator.or_else(|| error.downcast_ref()) else {
        return None;
    };
    let own = rustix::process::geteuid().as_raw();
    let mut users = users(Path::new(SHARED_MEMORY), robot);
    if let Some(user) = users.find(|user| *user != own) {
        return Some(format!(
            "robot {robot} of user {user} runs here; only that user reaches it: `sudo -u '#{user}' firsthand ...`"
        ));
    }
    let names: Vec<_> = robots::own().0.iter().map(|robot| robot.name.to_string()).collect();
    (!names.is_empty()).then(|| format!("{error}; these run here: {}", names.join(", ")))
}

/// By file name prefix in `shared` memory.
fn users<'a>(shared: &Path, robot: &'a str) -> impl Iterator<Item = u32> + use<'a> {
    robots::entries(shared).filter_map(move |entry| {
        let name = entry.file_name();
        let (user, rest) = name.to_str()?.strip_prefix("fh")?.split_once('_')?;
        rest.strip_prefix(robot)?.starts_with('_').then_some(user.parse().ok()?)
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_user_of_a_robot_is_told_by_its_files_in_shared_memory() {
        let shared = tempfile::tempdir().unwrap();
        for name in ["fh1000_x80_bus", "fh7_x80-2_bus", "other"] {
            fs::create_dir(shared.path().join(name)).unwrap();
        }
        let users_of = |robot| users(shared.path(), robot).collect::<Vec<_>>();
        assert_eq!(users_of("x80"), [1000]);
        assert_eq!(users_of("x80-2"), [7]);
        assert_eq!(users_of("x8"), Vec::<u32>::new());
    }
}

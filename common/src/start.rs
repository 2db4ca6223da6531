//! Joining a run as a child of the supervisor. `external` is the alternative.

use std::{fs::File, os::fd::OwnedFd, path::PathBuf};

use thiserror::Error;

use crate::{
    bus::{Bus, BusError},
    checkpoint::CheckpointError,
    domain::{Domain, RobotName},
    run::{Run, RunError},
};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generation {
    pub stage: &'static str,
    /// Directory of `run.toml` and the checkpoints.
    pub directory: PathBuf,
    pub number: u32,
    /// First tick of this generation; earlier ones belong to its predecessors.
    pub first_tick: u64,
}

#[derive(Clone, Debug)]
pub enum Start {
    Child {
        generation: Generation,
        /// Parent process, the supervisor; this process ends with it.
        supervisor: u32,
    },
    /// Started by systemd or a person for a supervisor that only watches; it finds the rest itself.
    External { stage: &'static str, robot: RobotName },
}

pub(crate) struct Joined {
    pub generation: Generation,
    pub run: Run,
    pub bus: Bus,
    /// Becomes readable when the supervisor has ended; a child gets a signal instead.
    pub supervisor: Option<OwnedFd>,
    pub stage_lock: File,
}

pub type Result<T = (), E = StageError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum StageError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Publication on a topic outside the stage's outputs.
    #[error("the stage's outputs lack topic {0}; add it to them")]
    NoOutput(&'static str),
    #[error("{0}")]
    Other(String),
    #[error("cannot {action}: {source}; this needs Linux 5.4 or newer")]
    System { action: &'static str, source: std::io::Error },
}

/// Exit code of a stage that the bus refused: the supervisor then creates a new bus instance.
pub const REFUSED: u8 = 8;

impl StageError {
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Bus(_) => REFUSED,
            _ => 1,
        }
    }
}

pub(crate) fn join_as_child(generation: &Generation, supervisor: u32) -> Result<Joined> {
    become_child(generation.stage, supervisor)?;
    let run = Run::load(&generation.directory)?;
    let domain = run.robot.domain();
    let stage_lock = enter(&domain)?;
    let bus = Bus::join_as_stage(&domain, generation.stage, supervisor)?;
    Ok(Joined { generation: generation.clone(), run, bus, supervisor: None, stage_lock })
}

/// Counts as a process of `domain` until the result is dropped.
pub(crate) fn enter(domain: &Domain) -> Result<File> {
    domain.enter().map_err(system("enter the robot's directory"))
}

pub(crate) fn system<E: Into<std::io::Error>>(
    action: &'static str,
) -> impl FnOnce(E) -> StageError {
    move |source: E| StageError::System { action, source: source.into() }
}

/// Sets the name for `ps` and `pkill`, and requests SIGTERM at the end of `supervisor`.
///
/// # Errors
/// If the supervisor has ended already, or the system is not Linux.
pub fn become_child(process_name: &str, supervisor: u32) -> Result {
    name_process(process_name)?;
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))
        .map_err(system("tie the process to its supervisor"))?;
    // The supervisor may have ended before that took effect.
    let parent = rustix::process::getppid().map_or(0, |pid| pid.as_raw_nonzero().get() as u32);
    if parent == supervisor {
        Ok(())
    } else {
        Err(StageError::Other(format!(
            "supervisor {supervisor} has ended; start stages through `firsthand run`"
        )))
    }
}

pub(crate) fn name_process(name: &str) -> Result {
    // The table has no name with a zero byte.
    if let Ok(name) = std::ffi::CString::new(name) {
        rustix::thread::set_name(&name).map_err(system("name the process"))?;
    }
    Ok(())
}

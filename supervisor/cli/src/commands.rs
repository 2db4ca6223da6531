//! The subcommands: one file each.

#[cfg(feature = "tools")]
pub(crate) mod chaos;
pub(crate) mod check;
mod directories;
pub(crate) mod fault;
#[cfg(feature = "tools")]
pub(crate) mod field;
pub(crate) mod install;
#[cfg(feature = "tools")]
pub(crate) mod latency;
pub(crate) mod missions;
pub(crate) mod operate;
pub(crate) mod run;
#[cfg(feature = "simulator")]
pub(crate) mod sim;
pub(crate) mod stage;
pub(crate) mod status;
pub(crate) mod tables;

/// What a subcommand fails with: one clear sentence.
type Failure = Box<dyn std::error::Error>;

//! The subcommands that a robot does not need, and the code that only they use.

pub(crate) mod bench;
pub(crate) mod calibrate;
pub(crate) mod completions;
pub(crate) mod diff;
pub(crate) mod error_code;
pub(crate) mod evaluate;
pub(crate) mod experiments;
pub(crate) mod field;
pub(crate) mod man;
pub(crate) mod map;
mod mission_progress;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod ros2;
pub(crate) mod run_report;
pub(crate) mod top;

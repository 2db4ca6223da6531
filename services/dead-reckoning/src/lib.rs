//! Dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the whole of it, pure: one `wheels` sample to one `pose` |
//! | [`covariance`] | how far the pose may be off |
//! | [`shell`] | wires it to the topics, saves its state |

pub mod covariance;
pub mod replay;
pub mod shell;
pub mod step;

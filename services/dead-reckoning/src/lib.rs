//! Naive dead reckoning: encoder counts to pose, equations (20) and (21).
//!
//! [`step`] is the whole of it, pure; [`shell`] wires it to the topics `wheels` and `pose`.

pub mod shell;
pub mod step;

//! The velocity synchroniser: guidance to wheel speeds, equations (14)-(17).
//!
//! [`step`] is the whole of it, pure; [`shell`] wires it to the topics `guidance`, `pose`, `command`.

pub mod shell;
pub mod step;

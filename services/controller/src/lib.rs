//! The velocity synchroniser: guidance to wheel speeds, equations (14)-(17).
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the whole of it, pure: one `guidance` sample to one `command` |
//! | [`shell`] | wires it to the topics |

pub mod replay;
pub mod shell;
pub mod step;

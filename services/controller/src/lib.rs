//! The velocity synchroniser: guidance to wheel speeds, equations (14)-(17).
//!
//! [`step`] has the controller, pure: one `guidance` sample to one `command`.

pub mod step;

pub use step::Controller;

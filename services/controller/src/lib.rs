//! Velocity synchroniser: guidance to wheel speeds, equations (14)-(17). [`step`] is the pure
//! controller.

pub mod step;

pub use step::Controller;

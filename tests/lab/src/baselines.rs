//! Baseline: a planner stage for comparison, with the harmonic planner's map, sonar and controller.
//!
//! It treats unknown cells as free, like the harmonic planner. Unlike it with the evidential
//! method, it does not look around before driving.

pub mod map;
pub mod planner;
pub mod process;
pub mod wavefront;

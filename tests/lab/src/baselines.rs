//! Baselines: planner stages for comparison, with the harmonic planner's map, sonar and controller.
//!
//! Both treat unknown cells as free, like the harmonic planner. Unlike it with the evidential
//! method, neither looks around before driving.

pub mod belief;
pub mod bug;
pub mod planner;
pub mod process;
#[cfg(test)]
mod testing;
pub mod wavefront;

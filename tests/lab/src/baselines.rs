//! Baselines: planner stages for comparison, with the harmonic planner's map, sonar and controller.
//!
//! | module | contents |
//! |---|---|
//! | [`belief`] | a planner's copy of the map |
//! | [`planner`] | a planner for comparison, and guidance along its path |
//! | [`wavefront`] | the shortest path, replanned each tick; pure |
//! | [`bug`] | Bug2: straight to the target, and around hazards; pure |
//! | [`process`] | the process and start command |
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

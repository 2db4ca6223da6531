//! Baselines: planner stages to compare the harmonic planner with, on the same map, with the same sonar and controller.
//!
//! | module | holds |
//! |---|---|
//! | [`belief`] | a planner's copy of the map: free cells, lines of sight |
//! | [`planner`] | a planner to compare with, and the guidance along its way |
//! | [`wavefront`] | the shortest path over the map, planned anew in every tick; pure |
//! | [`bug`] | Bug2: straight to the target, and around hazards; pure |
//! | [`process`] | the process of either of them, and the command that it is started by |
//!
//! Both take unknown cells for free, like the harmonic planner. Neither looks around before it drives: that is the harmonic
//! planner's active sensing, with the evidential method.

pub mod belief;
pub mod bug;
pub mod planner;
pub mod process;
#[cfg(test)]
mod testing;
pub mod wavefront;

//! Baselines: planner stages to compare the harmonic planner with, on the same map, with the same sonar and controller.
//!
//! | module | holds |
//! |---|---|
//! | [`belief`] | a planner's copy of the map: free cells, lines of sight |
//! | [`planner`] | input and output of a planner's step |
//! | [`wavefront`] | the shortest path over the map, planned anew in every tick; pure |
//! | [`bug`] | Bug2: straight to the target, and around hazards; pure |
//! | [`shell`] | wires either of them to the topics |
//!
//! Both take unknown cells for free, like the harmonic planner. Neither looks around before it drives: that is the harmonic
//! planner's active sensing, with the evidential method.

pub mod belief;
pub mod bug;
pub mod planner;
pub mod shell;
#[cfg(test)]
mod testing;
pub mod wavefront;

//! Baselines: planner stages to compare the harmonic planner with, on the same map, with the same sonar and controller.
//!
//! | module | holds |
//! |---|---|
//! | [`belief`] | the map as a planner follows it: free cells, lines of sight |
//! | [`planner`] | what goes into a planner's step and what comes out |
//! | [`wavefront`] | the shortest path over the map, planned anew in every tick; pure |
//! | [`bug`] | Bug2: straight to the target, and around what is in the way; pure |
//! | [`shell`] | wires either of them to the topics |
//!
//! Both take unknown cells for free, as the harmonic planner does. Neither looks before it goes: that is the
//! harmonic planner's active sensing, under the evidential method.

pub mod belief;
pub mod bug;
pub mod planner;
pub mod shell;
#[cfg(test)]
mod testing;
pub mod wavefront;

//! The ground every firsthand process stands on: only what two processes must agree on.
//!
//! Layout, from the idea to the wire:
//!
//! | module | holds |
//! |---|---|
//! | [`mission`] | the mission file, validated |
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`geometry`], [`grid`] | shapes; cells and metres, windows, versions |
//! | [`kinematics`] | (1)-(3) and their inverses |

pub mod clock;
pub mod geometry;
pub mod grid;
pub mod kinematics;
pub mod mission;

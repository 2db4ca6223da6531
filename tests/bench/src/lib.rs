//! Benches of a whole robot, through its real processes. Only `firsthand bench` uses them; no robot contains them.
//!
//! | module | holds |
//! |---|---|
//! | [`chaos`] | signals to random processes at random times, and what became of the missions; faults of the robot |
//! | [`tick`] | the latency of a tick, compared with five bare hops on the bus |

pub mod chaos;
pub mod tick;

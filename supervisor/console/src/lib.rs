//! A robot at the prompt: what consumers of the command line have in common.
//!
//! | module | holds |
//! |---|---|
//! | [`sample_text`] | a sample of any topic as text or JSON |
//! | [`rates`] | how often topics are published, against the table |
//! | [`words`] | states and ages in words |
//! | [`robots`] | the robots of this machine |
//! | [`runs`] | the runs that are kept |
//! | [`logs`] | the logs of a run, merged by time |
//! | [`usage`] | processor and memory of a process |
//! | [`top`] | the screen of a robot |

pub mod logs;
pub mod rates;
pub mod robots;
pub mod runs;
pub mod sample_text;
#[cfg(feature = "top")]
pub mod top;
#[cfg(feature = "top")]
pub mod usage;
pub mod words;

//! Missions on many worlds, each through the real processes, judged by the ground truth.
//!
//! | module | holds |
//! |---|---|
//! | [`trial`] | a mission in a world, and the rules it is judged by |
//! | [`setting`] | settings that are compared on the same worlds |
//! | [`row`], [`latency`] | one mission's result; its latencies |
//! | [`table`], [`results`] | a CSV file of rows; the two tables of an evaluation |
//! | [`runner`], `progress` | the missions, several at a time; a line about them |
//! | [`statistics`], [`totals`] | shares with their intervals; the result of each setting, and paired differences |
//! | [`report`], [`page`] | the results as a page; the common parts of pages |
//! | [`directory`] | the directory of an evaluation |
//!
//! Every setting runs on the same worlds with the same noise, so that results differ only by the setting.

pub mod directory;
pub mod latency;
pub mod page;
mod progress;
pub mod report;
pub mod results;
pub mod row;
pub mod runner;
pub mod setting;
pub mod statistics;
pub mod table;
pub mod totals;
pub mod trial;

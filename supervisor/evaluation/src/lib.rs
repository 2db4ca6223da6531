//! How often a robot arrives: missions on many worlds, each through the real processes, judged by the ground truth.
//!
//! | module | holds |
//! |---|---|
//! | [`worlds`] | worlds, drawn from a seed or read from files |
//! | [`shortest_path`] | whether a body gets through a world, and its shortest path |
//! | [`trial`] | a mission in a world, and the rules it is judged by |
//! | [`setting`] | settings that are compared on the same worlds |
//! | [`row`], [`latency`] | one mission's result; its latencies |
//! | [`table`], [`results`] | a CSV file of rows; the two tables of an evaluation |
//! | [`runner`] | the missions, several at a time |
//! | [`statistics`], [`totals`] | shares with their intervals; the result of each setting, and paired differences |
//! | [`report`], [`page`] | the results as a page; the common parts of pages |
//! | [`directory`] | the directory of an evaluation |
//! | [`experiments`] | the paper's experiments with many seeds |
//! | [`baselines`] | planners to compare with: shortest paths, Bug2 |
//!
//! Every setting runs on the same worlds with the same noise, so that results differ only by the setting.

pub mod baselines;
pub mod directory;
pub mod experiments;
pub mod latency;
pub mod page;
pub mod report;
pub mod results;
pub mod row;
pub mod runner;
pub mod setting;
pub mod shortest_path;
pub mod statistics;
pub mod table;
pub mod totals;
pub mod trial;
pub mod worlds;

//! How often does it arrive? Missions on many worlds, each through the real processes, judged by the ground truth.
//!
//! | module | holds |
//! |---|---|
//! | [`worlds`] | where worlds come from: drawn from a seed, or read from files |
//! | [`shortest_path`] | whether a body gets through a world, and how short its way can be |
//! | [`trial`] | a mission in a world, and the rules it is judged by |
//! | [`setting`] | what missions on the same worlds differ by |
//! | [`summary`] | what a run says at its end |
//! | [`row`], [`latency`] | one mission's result; how long its ticks and solves took |
//! | [`table`], [`results`] | rows in a file, as they come and in order; both tables |
//! | [`runner`] | the missions, several at a time |
//! | [`statistics`], [`totals`] | shares with their intervals; the result of each setting, and paired differences |
//! | [`report`], [`page`] | all of it as a page; what every page has |
//! | [`directory`] | where all of it lies |
//! | [`experiments`] | the paper's experiments with many seeds |
//! | [`maps`] | readers of ROS, PGM, PNG and MovingAI maps |
//! | [`baselines`] | planners to compare with: shortest paths, Bug2 |
//!
//! Every setting runs on the same worlds with the same noise, so that two of them differ by what was set alone.

pub mod baselines;
pub mod directory;
pub mod experiments;
pub mod latency;
pub mod maps;
pub mod page;
pub mod report;
pub mod results;
pub mod row;
pub mod runner;
pub mod setting;
pub mod shortest_path;
pub mod statistics;
pub mod summary;
pub mod table;
pub mod totals;
pub mod trial;
pub mod worlds;

//! The experiments of the paper, repeated with many seeds through the real processes, beside what the paper reports.
//!
//! | module | holds |
//! |---|---|
//! | [`experiment`] | THE table of experiments: their missions, and what the paper reports of each |
//! | [`method`] | how they are run: by the paper's method and by the default one |
//! | [`result`] | what became of one experiment by one method |
//! | [`expectation`] | what the paper says of its experiments, and whether it holds here |
//! | [`report`] | all of it as a table, a page and objects |

pub mod expectation;
pub mod experiment;
pub mod method;
pub mod report;
pub mod result;

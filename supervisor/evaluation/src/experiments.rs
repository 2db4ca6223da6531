//! The experiments of the paper, repeated with many seeds through the real processes, beside the paper's values.
//!
//! | module | holds |
//! |---|---|
//! | [`experiment`] | THE table of experiments: their missions, and the paper's report of each |
//! | [`method`] | the methods: the paper's and the default one |
//! | [`result`] | the result of one experiment by one method |
//! | [`expectation`] | the paper's claims, and whether they hold here |
//! | [`report`] | the results as text, a page and JSON objects |

pub mod expectation;
pub mod experiment;
pub mod method;
pub mod report;
pub mod result;

//! Tests of the library against a reference solver and exact fields.
#![allow(
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests may stop at the first broken promise"
)]

mod changes;
mod fields;
mod guidance;
mod properties;
mod support;

//! Tests of whole simulated robots, in one executable because linking is slow.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "what tests share may stop at the first broken promise too"
)]

mod bad_radio;
mod in_memory;
mod loopback;
mod meeting;
mod support;

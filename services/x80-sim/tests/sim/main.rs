//! Tests of whole simulated robots. They are one executable, because each takes long to link.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "what tests share may stop at the first broken promise too"
)]

mod bad_radio;
mod foreign_clients;
mod loopback;
mod meeting;
mod support;

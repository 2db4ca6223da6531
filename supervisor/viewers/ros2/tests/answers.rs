//! Makes Cargo build the executable beside `firsthand` for the system tests.

include!("../../../../tests/support/answers.rs");

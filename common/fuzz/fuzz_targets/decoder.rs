//! `cargo +nightly fuzz run decoder --fuzz-dir common/fuzz -s none -- -runs=100000000`
//!
//! No sanitizer: there is no unsafe code to watch over, and without one it runs ten times as often.
#![no_main]

#[path = "../oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|input: &[u8]| oracle::check(input));

//! `cargo +nightly fuzz run decoder --fuzz-dir common/fuzz -s none --no-trace-compares -- -max_len=300 -runs=100000000`
//!
//! No sanitizer: there is no unsafe code to watch over. No traced comparisons: the corpus has the headers
//! and CRCs they would help to find, and without them it runs several times as often. To keep what was
//! found, small: `cargo +nightly fuzz cmin decoder --fuzz-dir common/fuzz -s none`.
#![no_main]

#[path = "../oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|input: &[u8]| oracle::check(input));

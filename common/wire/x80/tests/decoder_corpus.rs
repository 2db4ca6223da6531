//! Runs the decoder on the fuzzing corpus.
//!
//! The target in `common/wire/x80/fuzz` describes the long run.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test")]

#[path = "../fuzz/oracle.rs"]
mod oracle;

#[test]
fn the_corpus_breaks_no_promise() {
    let byte = |digits: &str| u8::from_str_radix(digits, 16).expect("two hexadecimal digits");
    for line in include_str!("../fuzz/decoder-corpus.hex").lines() {
        let bytes = (0..line.len()).step_by(2).map(|at| byte(&line[at..at + 2]));
        oracle::check(&bytes.collect::<Vec<_>>());
    }
}

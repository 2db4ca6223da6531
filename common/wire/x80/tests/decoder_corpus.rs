//! Runs the decoder on the fuzzing corpus.
//!
//! The target in `common/wire/x80/fuzz` describes the long run.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test")]

#[path = "../fuzz/oracle.rs"]
mod oracle;

fn corpus() -> Vec<Vec<u8>> {
    let byte = |digits: &str| u8::from_str_radix(digits, 16).expect("two hexadecimal digits");
    let lines = include_str!("../fuzz/decoder-corpus.hex").lines();
    let input = |line: &str| (0..line.len()).step_by(2).map(|at| byte(&line[at..at + 2])).collect();
    lines.map(input).collect()
}

#[test]
fn the_corpus_breaks_no_promise() {
    for input in &corpus() {
        oracle::check(input);
    }
}

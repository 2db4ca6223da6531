//! Runs the decoder on the fuzzing corpus and on bounded random changes of it.
//!
//! The target in `common/wire/x80/fuzz` describes the long run.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test")]

#[path = "../fuzz/oracle.rs"]
mod oracle;

use proptest::{
    prelude::*,
    test_runner::{Config, TestRunner},
};

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

#[test]
fn random_changes_of_the_corpus_break_no_promise() {
    let change = (any::<prop::sample::Index>(), any::<u8>());
    let changed = (
        prop::sample::select(corpus()),
        prop::sample::select(corpus()),
        prop::collection::vec(change, 0..8),
    )
        .prop_map(|(mut input, other, changes)| {
            input.extend(other);
            for (at, byte) in changes {
                if !input.is_empty() {
                    let at = at.index(input.len());
                    input[at] = byte;
                }
            }
            input
        });
    let mut runner = TestRunner::new(Config::with_cases(20_000));
    runner
        .run(&changed, |input| {
            oracle::check(&input);
            Ok(())
        })
        .unwrap();
}

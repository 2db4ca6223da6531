//! Fuzz target of the decoder. The lines of `decoder-corpus.hex` are the inputs that fuzzing found;
//! in `common/wire/x80/fuzz`, convert them to files for cargo-fuzz:
//!
//! ```sh
//! mkdir -p corpus/decoder
//! n=0; while read -r line; do n=$((n + 1)); basenc --base16 --decode <<<"$line" >"corpus/decoder/$n"; done <decoder-corpus.hex
//! cargo +nightly fuzz run decoder --fuzz-dir . -s none --no-trace-compares -- -max_len=300 -runs=100000000
//! ```
//!
//! The code has no `unsafe`, so sanitizers are off. Comparison tracing is off too: the corpus
//! already has headers and CRCs, and runs are several times as fast. To add new inputs, minimised:
//!
//! ```sh
//! cargo +nightly fuzz cmin decoder --fuzz-dir . -s none
//! for file in corpus/decoder/*; do basenc --base16 --wrap=0 "$file"; echo; done | LC_ALL=C sort >decoder-corpus.hex
//! ```
#![no_main]

#[path = "../oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|input: &[u8]| oracle::check(input));

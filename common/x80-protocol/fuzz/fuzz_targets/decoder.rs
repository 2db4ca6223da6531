//! The inputs that fuzzing found are the lines of `decoder-corpus.hex`. In `common/x80-protocol/fuzz`, make them files, as cargo-fuzz wants them:
//!
//! ```sh
//! mkdir -p corpus/decoder
//! n=0; while read -r line; do n=$((n + 1)); basenc --base16 --decode <<<"$line" >"corpus/decoder/$n"; done <decoder-corpus.hex
//! cargo +nightly fuzz run decoder --fuzz-dir . -s none --no-trace-compares -- -max_len=300 -runs=100000000
//! ```
//!
//! No sanitizer: there is no unsafe code to watch over. No traced comparisons: the corpus has the headers
//! and CRCs they would help to find, and without them it runs several times as often. To add what was found, minimised:
//!
//! ```sh
//! cargo +nightly fuzz cmin decoder --fuzz-dir . -s none
//! for file in corpus/decoder/*; do basenc --base16 --wrap=0 "$file"; echo; done | LC_ALL=C sort >decoder-corpus.hex
//! ```
#![no_main]

#[path = "../oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|input: &[u8]| oracle::check(input));

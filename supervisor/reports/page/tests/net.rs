//! Tests of the page's JavaScript in Node.js.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::process::Command;

#[test]
fn a_page_connects_again_after_a_late_token_and_sends_a_stop_until_it_is_answered() {
    let at = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/net.mjs");
    let net = concat!(env!("CARGO_MANIFEST_DIR"), "/web/net.js");
    let Ok(ran) = Command::new("node").args([at, net]).output() else {
        println!("not run: there is no Node.js");
        return;
    };
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}

//! `firsthand bench consumer`: the program of a consumer, started by `firsthand bench chaos`, which it must not outlive.

use std::{ffi::OsString, os::unix::process::CommandExt as _, process::Command};

use clap::Args;
use common::start::become_child;

use crate::error::Result;

/// Become a program that ends with the process PARENT.
#[derive(Debug, Args)]
#[command(hide = true)]
pub struct Arguments {
    /// The parent.
    parent: u32,
    /// The program and its arguments.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    words: Vec<OsString>,
}

pub fn main(arguments: &Arguments) -> Result {
    // The kernel signals the end of the parent to this process also after it executes another program.
    become_child("consumer", arguments.parent)?;
    let Some((program, words)) = arguments.words.split_first() else {
        return Err("give a program".into());
    };
    let error = Command::new(program).args(words).exec();
    Err(format!("cannot execute {}: {error}", program.display()).into())
}

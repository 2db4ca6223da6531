use std::io::{self, IsTerminal as _};

use super::{failure::Result, output::write_stderr};

/// Asks a person to confirm `will`. Fails after a no, or if standard input is not a terminal.
pub fn ask(will: &str, question: &str) -> Result {
    if !io::stdin().is_terminal() {
        return Err(format!("{will}; give --yes to agree").into());
    }
    write_stderr(&format!("{will}. {question} [y/N] "));
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    match answer.trim().to_lowercase().as_str() {
        "y" | "yes" => Ok(()),
        _ => Err("nothing was done".into()),
    }
}

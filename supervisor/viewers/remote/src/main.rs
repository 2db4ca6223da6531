//! The executable `firsthand-remote`; see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_remote::main()
}

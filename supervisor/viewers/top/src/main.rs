//! The executable `firsthand-top`; see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_top::main()
}

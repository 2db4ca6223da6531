//! The executable `firsthand-page`; see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_page::main()
}

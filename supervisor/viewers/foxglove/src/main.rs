//! The executable `firsthand-foxglove`; see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_foxglove::main()
}

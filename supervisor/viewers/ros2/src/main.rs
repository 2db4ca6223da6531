//! The executable `firsthand-ros2`; see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_ros2::main()
}

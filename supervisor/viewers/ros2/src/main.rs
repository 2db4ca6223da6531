use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_ros2::main()
}

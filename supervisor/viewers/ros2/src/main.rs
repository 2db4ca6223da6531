use std::process::ExitCode;

fn main() -> ExitCode {
    // Refused requests of other nodes are logged.
    console::executable::run("warn,rustdds=off", firsthand_ros2::show)
}

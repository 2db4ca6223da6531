use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_lab::main()
}

use std::process::ExitCode;

fn main() -> ExitCode {
    firsthand_foxglove::main()
}

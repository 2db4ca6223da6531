use std::process::ExitCode;

fn main() -> ExitCode {
    // A client could fill the log with its own errors.
    console::executable::run(
        "error,firsthand_foxglove=warn,foxglove=off",
        firsthand_foxglove::serve,
    )
}

use std::process::ExitCode;

fn main() -> ExitCode {
    console::executable::run("error", firsthand_page::serve)
}

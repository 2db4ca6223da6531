//! `firsthand bench sources`: simulated sources of fixes and turns.

use bench::sources::publish;
pub(crate) use bench::sources::{Arguments, Published};

use console::{failure::Failure, output::print_text};

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let Published { fixes, turns } = publish(arguments)?;
    Ok(print_text(&format!("published {fixes} fixes and {turns} turns\n"))?)
}

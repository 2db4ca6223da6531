use clap::Args;

use console::{
    failure::Failure,
    missions::{self, LookupError, SHIPPED},
    output::print_text,
};

/// List the missions that ship with the program; with a name, print its file to start your own from.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A shipped mission.
    #[arg(id = "mission", value_name = "NAME")]
    name: Option<String>,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(name) = &arguments.name {
        let text =
            missions::shipped(name).ok_or_else(|| LookupError::Unknown { name: name.clone() })?;
        return Ok(print_text(text)?);
    }
    for (name, _) in SHIPPED {
        let description = missions::load(name, &[])?.description;
        print_text(&format!("{name:<18} {description}\n"))?;
    }
    Ok(())
}

use clap::Args;

use console::{
    failure::Result,
    missions::{self, LookupError, SHIPPED},
    output::print_text,
};

/// List the missions that ship with the program; with a name, print its file to start your own from.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A shipped mission.
    #[arg(id = "mission", value_name = "NAME")]
    name: Option<String>,
}

pub fn main(arguments: &Arguments) -> Result {
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

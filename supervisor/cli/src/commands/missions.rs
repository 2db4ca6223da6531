use clap::Args;

use console::{
    failure::Result,
    missions::{self, LookupError, SHIPPED},
    output::{print_line, print_text},
};

/// List the shipped missions, or print one as a template.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Shipped mission to print.
    #[arg(id = "mission", value_name = "NAME")]
    name: Option<String>,
}

pub fn main(arguments: &Arguments) -> Result {
    if let Some(name) = &arguments.name {
        let text =
            missions::shipped(name).ok_or_else(|| LookupError::Unknown { name: name.clone() })?;
        return print_text(text);
    }
    for (name, _) in SHIPPED {
        let description = missions::load(name, &[])?.description;
        print_line(format_args!("{name:<18} {description}"))?;
    }
    Ok(())
}

//! Manual page, generated from the parser's tables.

use std::io;

use clap::{Args, Command};
use clap_mangen::Man;

use console::{failure::Result, output::print_text};

/// Print the manual page, with all subcommands.
///
/// Example: `firsthand man > ~/.local/share/man/man1/firsthand.1`.
#[derive(Debug, Args)]
pub struct Arguments {}

pub fn main(_: &Arguments, whole: Command) -> Result {
    print_text(String::from_utf8_lossy(&page(whole)?))
}

fn page(mut whole: Command) -> io::Result<Vec<u8>> {
    // Usage lines are complete only after `build`.
    whole.build();
    let man = Man::new(whole.clone());
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    add_subcommands(&whole, "", &mut page)?;
    let mut extra = Vec::new();
    man.render_extra_section(&mut extra)?;
    // `.nf` keeps line breaks.
    let titled = ".SH \"PAGES OF THE GUIDE, EXIT CODES\"\n.nf";
    let extra = String::from_utf8_lossy(&extra).replace(".SH EXTRA", titled);
    page.extend_from_slice(extra.as_bytes());
    Ok(page)
}

/// `names` are the preceding words.
fn add_subcommands(command: &Command, names: &str, page: &mut Vec<u8>) -> io::Result<()> {
    for subcommand in command.get_subcommands().filter(|it| !it.is_hide_set()) {
        let names = format!("{names}{}", subcommand.get_name().to_uppercase());
        page.extend_from_slice(format!(".SH \"{names}\"\n").as_bytes());
        let man = Man::new(subcommand.clone());
        let mut sections = Vec::new();
        man.render_synopsis_section(&mut sections)?;
        man.render_description_section(&mut sections)?;
        man.render_options_section(&mut sections)?;
        // Sections of a subcommand become subsections.
        let sections = String::from_utf8_lossy(&sections).replace(".SH ", ".SS ");
        page.extend_from_slice(sections.as_bytes());
        add_subcommands(subcommand, &(names + " "), page)?;
    }
    Ok(())
}

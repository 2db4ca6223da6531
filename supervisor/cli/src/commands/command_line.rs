//! `firsthand completions` and `firsthand man`: completions of shells and the manual page, from the tables that the command
//! line is parsed with.

use std::{io, process::ExitCode};

use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;

use super::{Failure, print_text};

/// Print completions for a shell: `firsthand completions bash > ~/.local/share/bash-completion/completions/firsthand`.
#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

/// Print the manual page, with all subcommands: `firsthand man > ~/.local/share/man/man1/firsthand.1`.
#[derive(Debug, Args)]
pub(crate) struct Manual {}

/// `whole` is the command line of the executable.
pub(crate) fn completions(
    arguments: &Completions,
    mut whole: Command,
) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut whole, "firsthand", &mut script);
    print_text(&String::from_utf8_lossy(&script))?;
    Ok(ExitCode::SUCCESS)
}

/// `whole` is the command line of the executable.
pub(crate) fn manual(_: &Manual, whole: Command) -> Result<ExitCode, Failure> {
    print_text(&String::from_utf8_lossy(&page(whole)?))?;
    Ok(ExitCode::SUCCESS)
}

/// One page: the whole, and a section for each subcommand.
fn page(mut whole: Command) -> io::Result<Vec<u8>> {
    // Usage lines name the whole command only once it is built.
    whole.build();
    let subcommands: Vec<_> = whole.get_subcommands().cloned().collect();
    let man = Man::new(whole);
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    for subcommand in subcommands.into_iter().filter(|it| !it.is_hide_set()) {
        let name = subcommand.get_name().to_uppercase();
        let man = Man::new(subcommand);
        page.extend_from_slice(format!(".SH \"{name}\"\n").as_bytes());
        let mut sections = Vec::new();
        man.render_synopsis_section(&mut sections)?;
        man.render_description_section(&mut sections)?;
        man.render_options_section(&mut sections)?;
        // Its sections are parts of this one.
        let sections = String::from_utf8_lossy(&sections).replace(".SH ", ".SS ");
        page.extend_from_slice(sections.as_bytes());
    }
    let mut extra = Vec::new();
    man.render_extra_section(&mut extra)?;
    // Its lines stay lines.
    let titled = ".SH \"PAGES OF THE GUIDE, EXIT CODES\"\n.nf";
    let extra = String::from_utf8_lossy(&extra).replace(".SH EXTRA", titled);
    page.extend_from_slice(extra.as_bytes());
    Ok(page)
}

//! Installs a systemd service. The Debian package has the same files (`[package.metadata.deb]`).

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;
use processes::stages;

use console::{
    consent,
    failure::{Result, refuse},
    output::print_line,
};

/// Make this executable a systemd service: units, user, configuration.
///
/// `install` names each file before it writes it. `install` enables and starts no unit.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Only print the path and the content of each file.
    #[arg(long)]
    print: bool,
    /// Install below DIR instead of /.
    #[arg(long, value_name = "DIR", default_value = "/", conflicts_with = "print")]
    root: PathBuf,
    /// Write without asking first.
    #[arg(long, conflicts_with = "print")]
    yes: bool,
}

struct Part {
    path: &'static str,
    text: &'static str,
    /// Whether users may edit the file. An existing one is kept.
    configuration: bool,
}

macro_rules! part {
    ($path:literal, $source:literal, $configuration:literal) => {
        Part {
            path: $path,
            text: include_str!(concat!("../../../systemd/", $source)),
            configuration: $configuration,
        }
    };
}

static PARTS: [Part; 7] = [
    part!("etc/systemd/system/firsthand.service", "firsthand.service", false),
    part!("etc/systemd/system/firsthand-watch.service", "firsthand-watch.service", false),
    part!("etc/systemd/system/firsthand-stage@.service", "firsthand-stage@.service", false),
    part!("etc/sysusers.d/firsthand.conf", "firsthand.sysusers", false),
    part!("etc/tmpfiles.d/firsthand.conf", "firsthand.tmpfiles", false),
    part!("etc/default/firsthand", "firsthand.default", true),
    part!("etc/firsthand/mission.toml", "mission.toml", true),
];

/// Directories that the units hide from their processes (`ProtectHome`).
const HIDDEN: [&str; 3] = ["/home", "/root", "/run/user"];

const PACKAGED: &str = "/usr/bin/firsthand";

const THEN: &str = "systemd-sysusers && systemctl daemon-reload
then, when /etc/firsthand/mission.toml is the robot's mission:
  systemctl enable --now firsthand          # the supervisor starts the stages, or
  systemctl enable --now firsthand-watch    # systemd does:";

pub fn main(arguments: &Arguments) -> Result {
    let executable = std::env::current_exe()?;
    if !arguments.print {
        refuse_hidden(&executable)?;
    }
    let mut changed = Vec::new();
    for part in &PARTS {
        let text = part.text.replace(PACKAGED, &executable.to_string_lossy());
        let file = arguments.root.join(part.path);
        let (name, there) = (file.display(), fs::read_to_string(&file).ok());
        if arguments.print {
            print_line(format_args!("# {name}\n{text}"))?;
            continue;
        }
        let becomes = match there {
            Some(there) if part.configuration || there == text => "stays as it is",
            Some(_) => "will be replaced",
            None => "is new",
        };
        print_line(format_args!("{name} {becomes}"))?;
        if becomes != "stays as it is" {
            changed.push((file, text));
        }
    }
    if !(changed.is_empty() || arguments.yes) {
        consent::ask("these files will be written", "Write them?")?;
    }
    for (file, text) in &changed {
        put(file, text)?;
    }
    let units = stages::TABLE.iter().map(|stage| format!("\n    firsthand-stage@{}", stage.name));
    print_line(format_args!("# Then:\n{THEN}{}", units.collect::<String>()))
}

/// Refuses an executable that a service could not start.
fn refuse_hidden(executable: &Path) -> Result {
    if !HIDDEN.iter().any(|hidden| executable.starts_with(hidden)) {
        return Ok(());
    }
    let executable = executable.display();
    refuse(
        "home-directory",
        format!(
            "{executable} lies in a home directory, which a service cannot read; `sudo install {executable} /usr/local/bin/`, then \
             `sudo /usr/local/bin/firsthand install`"
        ),
    )
}

fn put(file: &Path, text: &str) -> Result {
    let written =
        file.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(file, text));
    let refused =
        |error| format!("cannot write {}: {error}; as root, or with --root?", file.display());
    Ok(written.map_err(refused)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(name: &str) -> &'static str {
        let found = PARTS.iter().find(|part| part.path.ends_with(name));
        found.unwrap().text
    }

    #[test]
    fn the_watching_unit_wants_every_stage_of_the_table() {
        let wanted: Vec<_> = unit("firsthand-watch.service")
            .lines()
            .filter_map(|line| line.strip_prefix("Wants=firsthand-stage@"))
            .collect();
        let stages: Vec<_> =
            stages::TABLE.iter().map(|stage| format!("{}.service", stage.name)).collect();
        assert_eq!(wanted, stages);
    }

    #[test]
    fn every_unit_starts_a_command_that_exists() {
        for part in &PARTS {
            for line in part.text.lines() {
                let Some(command) = line.strip_prefix("ExecStart=") else {
                    continue;
                };
                let command = command.replace("${FIRSTHAND_ROBOT}", "x80").replace("%i", "planner");
                let words: Vec<_> = command.split_whitespace().skip(1).collect();
                crate::commands::parse(&words)
                    .unwrap_or_else(|error| panic!("{}: {error}", part.path));
            }
        }
    }

    #[test]
    fn the_packaged_mission_is_valid() {
        let text = unit("mission.toml");
        common::mission::Mission::parse(text, "mission.toml").unwrap();
    }

    #[test]
    fn an_executable_that_a_service_cannot_read_is_refused_with_the_remedy() {
        let refused = refuse_hidden(Path::new("/home/you/firsthand/target/release/firsthand"));
        assert!(refused.unwrap_err().to_string().contains("/usr/local/bin"));
        assert!(refuse_hidden(Path::new("/usr/bin/firsthand")).is_ok());
    }

    #[test]
    fn files_are_written_after_consent_and_configuration_that_is_there_is_not_overwritten() {
        let root = tempfile::tempdir().unwrap();
        let mission = root.path().join("etc/firsthand/mission.toml");
        put(&mission, "target = [1.0, 0.0]").unwrap();
        let mut arguments = Arguments { print: false, root: root.path().to_path_buf(), yes: false };
        let service = root.path().join("etc/systemd/system/firsthand.service");
        let asks = main(&arguments).unwrap_err().to_string();
        assert!(asks.contains("--yes") && !service.exists(), "{asks}");
        arguments.yes = true;
        main(&arguments).unwrap();
        assert_eq!(fs::read_to_string(&mission).unwrap(), "target = [1.0, 0.0]");
        let service = fs::read_to_string(service).unwrap();
        let executable = std::env::current_exe().unwrap();
        assert!(service.contains(&format!("ExecStart={} run", executable.display())));
    }
}

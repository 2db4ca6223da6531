//! Planner of a mission, resolved before any start: a checked executable, or another planner of
//! `firsthand stage NAME`.

use std::{
    io,
    path::{Path, PathBuf},
};

use common::mission::Mission;
use thiserror::Error;

use crate::executable;

/// The mission's planner executable cannot be started.
#[derive(Debug, Error)]
#[error(
    "planner.executable {}: {problem}; give {}the path of a planner executable or a name on PATH, or omit the key", named.display(),
    others.iter().map(|other| format!("`{other}`, ")).collect::<String>()
)]
pub struct PlannerExecutableError {
    named: PathBuf,
    problem: io::Error,
    others: &'static [&'static str],
}

/// Makes the `planner.executable` of `mission` absolute, unless it is one of the `others`.
pub fn resolve(
    mission: &mut Mission,
    others: &'static [&'static str],
) -> Result<(), PlannerExecutableError> {
    if let Some(named) = &mut mission.planner.executable {
        *named = find_planner(named, others)?;
    }
    Ok(())
}

/// Returns the planner among `others` that is `named`, or the executable's absolute path.
pub fn find_planner(
    named: &Path,
    others: &'static [&'static str],
) -> Result<PathBuf, PlannerExecutableError> {
    if let Some(other) = others.iter().find(|other| named == Path::new(other)) {
        return Ok(other.into());
    }
    executable::find(named).map_err(|problem| PlannerExecutableError {
        named: named.to_path_buf(),
        problem,
        others,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{env, fs, os::unix::fs::PermissionsExt as _};

    fn resolved(named: &Path) -> Result<PathBuf, String> {
        let text = format!("target = [1, 0]\nplanner.executable = {named:?}");
        let mut mission = Mission::parse(&text, "test.toml").unwrap();
        resolve(&mut mission, &["odometry", "wavefront"]).map_err(|error| error.to_string())?;
        Ok(mission.planner.executable.unwrap())
    }

    #[test]
    fn a_path_is_taken_from_the_current_directory_and_a_name_from_path_and_both_are_made_absolute()
    {
        let shell = resolved(Path::new("sh")).unwrap();
        assert!(shell.is_absolute() && shell.ends_with("sh"), "{shell:?}");
        let here = env::current_dir().unwrap();
        let up: PathBuf = here.components().skip(1).map(|_| "..").collect();
        let relative = up.join(shell.strip_prefix("/").unwrap());
        let found = resolved(&relative).unwrap();
        assert!(found.is_absolute(), "{found:?}");
        assert_eq!(fs::canonicalize(found).unwrap(), fs::canonicalize(shell).unwrap());
    }

    #[test]
    fn what_cannot_be_executed_is_refused_by_name_with_what_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let plain = folder.path().join("plain");
        fs::write(&plain, "").unwrap();
        fs::set_permissions(&plain, fs::Permissions::from_mode(0o644)).unwrap();
        for (named, problem) in [
            (plain.as_path(), "chmod +x"),
            (folder.path(), "is a directory"),
            (&folder.path().join("none"), "No such file"),
            (Path::new("no-such-planner"), "nor on PATH"),
            (Path::new("./wavefront"), "`odometry`, `wavefront`, the path"),
        ] {
            let said = resolved(named).unwrap_err();
            let name = named.to_str().unwrap();
            assert!(said.contains(name) && said.contains(problem), "{said}");
        }
    }
}

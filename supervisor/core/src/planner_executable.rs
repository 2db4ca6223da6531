//! Finds the planner that a mission names, before anything starts: a baseline that is in this executable, or another executable, which
//! is checked and made absolute.

use std::path::{Path, PathBuf};

use common::mission::Mission;
use thiserror::Error;

use crate::executable::{self, ExecutableError};

/// The executable that a mission names for its planner cannot be started.
#[derive(Debug, Error)]
#[error(
    "planner.executable {}: {problem}; give `wavefront`, `bug`, a path to an executable of a planner, a name on PATH, or leave the key out", named.display()
)]
pub struct PlannerExecutableError {
    named: PathBuf,
    problem: ExecutableError,
}

/// The other planners that this executable contains, as the stages `firsthand stage NAME`: two to compare with, and the one of
/// `firsthand calibrate`.
const BASELINES: [&str; 3] = ["wavefront", "bug", "calibration"];

/// The baseline that is `named`, with the name of its former executable too.
pub fn baseline(named: &Path) -> Option<&'static str> {
    let named = named.to_str()?;
    let named = named.strip_prefix("firsthand-").unwrap_or(named);
    BASELINES.into_iter().find(|baseline| *baseline == named)
}

/// Make the `planner.executable` of `mission` absolute, if it names one.
pub fn resolve(mission: &mut Mission) -> Result<(), PlannerExecutableError> {
    if let Some(named) = &mut mission.planner.executable {
        *named = find(named)?;
    }
    Ok(())
}

/// The baseline that is `named`, or the absolute path of that executable.
pub fn find(named: &Path) -> Result<PathBuf, PlannerExecutableError> {
    if let Some(baseline) = baseline(named) {
        return Ok(baseline.into());
    }
    executable::find(named)
        .map_err(|problem| PlannerExecutableError { named: named.to_path_buf(), problem })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{env, fs, os::unix::fs::PermissionsExt as _};

    fn resolved(named: &Path) -> Result<PathBuf, String> {
        let text = format!("target = [1, 0]\nplanner.executable = {named:?}");
        let mut mission = Mission::parse(&text, Path::new("test.toml")).unwrap();
        resolve(&mut mission).map_err(|error| error.to_string())?;
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
    fn a_baseline_is_found_by_its_name_and_by_that_of_its_former_executable() {
        for (named, found) in [("bug", "bug"), ("wavefront", "wavefront"), ("firsthand-bug", "bug")]
        {
            assert_eq!(resolved(Path::new(named)).unwrap(), Path::new(found));
        }
        assert_eq!(baseline(Path::new("./bug")), None);
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
        ] {
            let said = resolved(named).unwrap_err();
            let name = named.to_str().unwrap();
            assert!(said.contains(name) && said.contains(problem), "{said}");
        }
    }
}

//! A robot that does not run for this user may run for another one, whose bus nobody else can join.

use std::{error::Error, fs, path::Path};

use common::{bus::BusError, domain::SHARED_MEMORY};

/// What to add to the message of `error`.
pub(crate) fn remark(error: &(dyn Error + 'static)) -> Option<String> {
    let Some(BusError::NotRunning { robot, .. }) = error.downcast_ref() else {
        return None;
    };
    let user = users(Path::new(SHARED_MEMORY), robot).next()?;
    Some(format!(
        "a robot {robot:?} runs here for user {user}: `sudo -u '#{user}' firsthand ...`"
    ))
}

/// Who has files of a robot of that name in `shared` memory, by their names there.
fn users<'a>(shared: &Path, robot: &'a str) -> impl Iterator<Item = u32> + use<'a> {
    let entries = fs::read_dir(shared).into_iter().flatten().flatten();
    entries.filter_map(move |entry| {
        let name = entry.file_name();
        let (user, rest) = name.to_str()?.strip_prefix("fh")?.split_once('_')?;
        let named = rest.strip_prefix(robot)?.starts_with('_');
        named.then_some(user.parse().ok()?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_user_of_a_robot_is_told_by_its_files_in_shared_memory() {
        let shared = tempfile::tempdir().unwrap();
        for name in ["fh1000_x80_bus", "fh7_x80-2_bus", "other"] {
            fs::create_dir(shared.path().join(name)).unwrap();
        }
        let users_of = |robot| users(shared.path(), robot).collect::<Vec<_>>();
        assert_eq!(users_of("x80"), [1000]);
        assert_eq!(users_of("x80-2"), [7]);
        assert_eq!(users_of("x8"), Vec::<u32>::new());
    }
}

//! Other processes and users beside a robot: they neither drive it nor keep it from starting, and what they break ends.

use std::{
    fs,
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::Path,
    time::{Duration, Instant},
};

use crate::support::{
    self, PATIENCE, Run, assert_nothing_left, assert_refused, bus_instance, domain, find,
    in_own_process, pid, signal_process,
};
use common::{
    bus::{Bus, BusError},
    clock::MissionTime,
    samples::{CommandSample, CommandState, DirectiveSample, Order},
    topics,
};
use rustix::process::Signal;

/// The files of a robot in shared memory.
fn shared(robot: &str) -> Vec<std::path::PathBuf> {
    support::shared_memory(&domain(robot).shared_memory_prefix())
}

#[test]
fn a_second_controller_and_a_second_supervisor_are_ignored_counted_and_told_with_their_process() {
    in_own_process(|| {
        let mut run = Run::start("two-masters", "open-room", &["--pace", "2"]);
        run.wait_until_under_way(0.3);
        let bus = Bus::join(&domain("two-masters"), "second").unwrap();
        let mut commands = bus.writer(&topics::COMMAND, u32::MAX).unwrap();
        let mut orders = bus.writer(&topics::DIRECTIVE, u32::MAX).unwrap();
        let backwards = CommandSample {
            pose_ns: u64::MAX,
            guidance_ns: u64::MAX,
            left_rad_s: -5.0,
            right_rad_s: -5.0,
            v_m_s: -0.4,
            state: CommandState::Driving.into(),
            ..CommandSample::default()
        };
        let stop = DirectiveSample {
            epoch: u64::MAX,
            order: Order::Stop.into(),
            ..DirectiveSample::default()
        };
        let began = Instant::now();
        let own = u64::from(std::process::id());
        loop {
            let forged = MissionTime(u64::MAX);
            commands.publish(u64::MAX, forged, backwards).unwrap();
            orders.publish(u64::MAX, forged, stop).unwrap();
            let link = run.status().map(|status| status["link"].clone());
            if link.is_some_and(|link| {
                link["ignored_writer"] == own && link["ignored_samples"].as_u64() > Some(3)
            }) {
                break;
            }
            assert!(began.elapsed() < PATIENCE, "nothing is told");
        }
        drop((commands, orders, bus));
        let (code, summary) = run.finish();
        assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()), "{summary}");
        assert_eq!(summary["collisions"], 0, "{summary}");
        let restarts = summary["restarts"].as_object().unwrap();
        assert!(restarts.values().all(|times| times == 0), "{summary}");
        assert_eq!(summary["resets"], 0, "{summary}");
    });
}

#[test]
fn no_file_of_a_run_is_open_to_other_users() {
    let mut run = Run::start("closed", "open-room", &["--pace", "1"]);
    run.wait_until_under_way(0.3);
    let robot = domain("closed");
    for path in shared("closed").into_iter().chain([robot.directory().to_owned()]) {
        // A file that was just removed is not open to others.
        if let Ok(found) = fs::symlink_metadata(&path) {
            assert_eq!(found.mode() & 0o077, 0, "{}", path.display());
        }
    }
    run.stop();
}

#[test]
fn a_file_of_another_user_with_a_name_of_the_robots_blocks_no_start() {
    if !rustix::process::geteuid().is_root() {
        let test = "a_file_of_another_user_with_a_name_of_the_robots_blocks_no_start";
        return support::not_run(test, "only root can make a file of another user");
    }
    let planted = Path::new("/dev/shm/fh0_planted_9204_node.0_10_0.global_mgmt");
    fs::write(planted, "").unwrap();
    fs::set_permissions(planted, fs::Permissions::from_mode(0o666)).unwrap();
    std::os::unix::fs::chown(planted, Some(65534), Some(65534)).unwrap();
    let run = Run::start("planted", "open-room", &[]);
    let (code, summary) = run.finish();
    let there = planted.exists();
    let _ = fs::remove_file(planted);
    assert_eq!(code, Some(0), "{summary}");
    assert!(there, "it is not the robot's to remove");
    assert_nothing_left("planted");
}

#[test]
fn a_bus_whose_count_of_nodes_is_empty_is_not_joined_and_the_message_says_so() {
    in_own_process(|| {
        let mut run = Run::start("emptied", "open-room", &["--pace", "1"]);
        run.wait_until_under_way(0.3);
        let count = shared("emptied").into_iter();
        let count = count.filter(|path| path.to_string_lossy().ends_with(".global_mgmt"));
        for path in count {
            fs::File::create(path).unwrap();
        }
        let refused = Bus::join(&domain("emptied"), "late").unwrap_err();
        assert!(matches!(refused, BusError::Join { .. }), "{refused}");
        run.signal(Signal::TERM);
        let began = Instant::now();
        run.finish();
        assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
        assert_nothing_left("emptied");
    });
}

#[test]
fn a_signal_goes_to_who_holds_the_supervisors_lock_and_not_to_the_number_in_its_file() {
    let mut bystander = std::process::Command::new("sleep").arg("60").spawn().unwrap();
    let robot = domain("stale-lock");
    fs::create_dir_all(robot.directory()).unwrap();
    for stale in [bystander.id().to_string(), "-1".to_owned()] {
        fs::write(robot.lock_file(), stale).unwrap();
        let killed = support::output(&["stage", "kill", "supervisor", "--robot", "stale-lock"]);
        assert_refused(&killed, "no-process", &["supervisor"]);
        assert!(bystander.try_wait().unwrap().is_none(), "it was killed");
    }
    bystander.kill().unwrap();
    bystander.wait().unwrap();
    fs::remove_dir_all(robot.directory()).unwrap();
}

#[test]
fn files_of_the_bus_truncated_or_removed_in_a_run_leave_sigterm_its_three_seconds() {
    // Sockets and directories can only be removed.
    for (robot, remove) in [("truncated", false), ("removed", true)] {
        let mut run = Run::start(robot, "open-room", &["--pace", "1"]);
        let status = run.wait_until_under_way(0.3);
        let supervisor = status["supervisor_pid"].as_u64().unwrap() as u32;
        let root = bus_instance(robot).root();
        for path in shared(robot).into_iter().filter(|path| *path != root) {
            let _ = if remove { fs::remove_file(path) } else { fs::File::create(path).map(drop) };
        }
        if remove {
            fs::remove_dir_all(root).unwrap();
        }
        // A stage that has to join meets them.
        signal_process(pid(&status, "mapper"), Signal::KILL);
        std::thread::park_timeout(Duration::from_millis(500));
        if Path::new(&format!("/proc/{supervisor}")).exists() {
            signal_process(supervisor, Signal::TERM);
        }
        let began = Instant::now();
        run.reap();
        let took = began.elapsed();
        println!("{robot}: ended {took:?} after SIGTERM");
        assert!(took < Duration::from_secs(4), "{robot}: {took:?}");
        // The next start is as any other.
        Run::start(robot, "open-room", &[]).arrives();
    }
}

#[test]
fn two_robots_on_one_machine_do_not_see_each_other() {
    let mut one = Run::start("one", "open-room", &["--pace", "4"]);
    let mut two = Run::start("two", "trap", &["--pace", "4"]);
    let status = one.wait_until_under_way(1.0);
    two.wait_until_under_way(1.0);
    let other = two.status().unwrap();
    assert_ne!(find(&status, "mapper")["pid"], find(&other, "mapper")["pid"]);
    one.kill_and_await_successor("mapper", Signal::KILL);
    assert_eq!(one.arrives()["restarts"]["mapper"], 1);
    assert_eq!(two.arrives()["restarts"]["mapper"], 0);
}

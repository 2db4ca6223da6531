//! Tests that other processes and users can neither drive a robot nor block its start.

use std::{
    fs,
    mem::MaybeUninit,
    net::UdpSocket,
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::Path,
    process::Stdio,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use crate::support::{
    self, PATIENCE, Run, assert_nothing_left, assert_refused, bus_instance, domain, find,
    firsthand, in_own_process, json_of, pid, signal_process,
};
use common::{
    address::Address,
    bus::{Bus, BusError},
    clock::MissionTime,
    poll,
    samples::{
        CommandSample, CommandState, DirectiveSample, GridHeader, GuidanceSample, LinkSample,
        Order, PoseSample, RangesHeader, WheelSample,
    },
    topics,
    wire::{Addressing, Command},
};
use processes::domain::DomainLock;
use recording::Recording;
use rustix::{
    fs::inotify,
    process::{Pid, PidfdFlags, Signal, pidfd_open},
    thread::{Uid, set_thread_res_uid},
};

/// Longest time from a signal to the end of a run with a damaged bus: 3 s, and machine load.
const ENDS_WITHIN: Duration = Duration::from_secs(20);

fn shared(robot: &str) -> Vec<std::path::PathBuf> {
    support::shared_memory(&domain(robot).shared_memory_prefix())
}

#[test]
fn a_second_controller_and_a_second_supervisor_are_ignored_counted_and_told_with_their_process() {
    in_own_process(|| {
        let run = Run::under_way("two-masters", "open-room", &["--pace", "4"], 0.3);
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
        support::assert_no_restart(&summary);
        assert_eq!(summary["resets"], 0, "{summary}");
    });
}

#[test]
fn samples_that_seem_newer_than_all_others_wedge_no_mission_and_no_consumer_whatever_their_topic() {
    in_own_process(|| {
        let run = Run::under_way("forged", "open-room", &["--pace", "4"], 0.3);
        let echo = |topic| {
            let mut echo = firsthand(&["topic", "echo", topic, "--robot", "forged", "--json"]);
            echo.args(["--number", "40"]).stdout(Stdio::piped()).spawn().unwrap()
        };
        let mut echoes = [echo("pose"), echo("guidance")];
        for echo in &mut echoes {
            let printed = echo.stdout.as_ref().unwrap();
            assert!(poll::is_readable(printed, PATIENCE).unwrap(), "nothing is shown");
        }
        let bus = Bus::join(&domain("forged"), "forger").unwrap();
        macro_rules! forge {
            ($($topic:ident),*) => {
                ($(bus.writer(&topics::$topic, u32::MAX).unwrap()),*)
            };
        }
        let (mut wheels, mut pose, mut guidance, mut link) = forge!(WHEELS, POSE, GUIDANCE, LINK);
        let mut ranges = bus.slice_writer(&topics::RANGES, u32::MAX, 1).unwrap();
        let mut grid = bus.slice_writer(&topics::GRID, u32::MAX, 1).unwrap();
        for tick in [0, u64::MAX] {
            let time = MissionTime(tick);
            ranges.publish_slice(tick, time, RangesHeader::default(), &[]).unwrap();
            wheels.publish(tick, time, WheelSample::default()).unwrap();
            pose.publish(tick, time, PoseSample::default()).unwrap();
            grid.publish_slice(tick, time, GridHeader::default(), &[]).unwrap();
            guidance.publish(tick, time, GuidanceSample::default()).unwrap();
            link.publish(tick, time, LinkSample::default()).unwrap();
        }
        let own = format!("process {}:", std::process::id());
        for reader in ["dead-reckoning", "mapper", "planner", "controller"] {
            let told = || support::logged(&run.directory(), reader, &["WARN", &own]) == 1;
            support::wait_until("a warning names the forger", told);
        }
        for echo in echoes {
            let ended = pidfd_open(Pid::from_child(&echo), PidfdFlags::empty()).unwrap();
            assert!(poll::is_readable(&ended, PATIENCE).unwrap(), "the echo ends");
            let (status, shown) = json_of(&echo.wait_with_output().unwrap());
            let forged = shown.iter().filter(|sample| sample["stamp"]["generation"] != 1);
            assert_eq!((status.code(), shown.len(), forged.count()), (Some(0), 40, 0));
        }
        drop((ranges, wheels, pose, grid, guidance, link, bus));
        let (summary, directory) = run.arrives_in();
        let recording = Recording::open(&directory.path().join("run")).unwrap();
        let poses: Vec<_> = recording.samples(&topics::POSE).unwrap().map(Result::unwrap).collect();
        assert!(poses.iter().all(|pose| pose.sample.stamp.generation == 1));
        let in_order =
            poses.windows(2).all(|pair| pair[0].sample.stamp.tick <= pair[1].sample.stamp.tick);
        assert!(in_order && poses.len() > 40, "{}", poses.len());
        support::assert_no_restart(&summary);
    });
}

#[test]
fn another_user_who_waits_for_the_files_of_a_new_bus_opens_none() {
    if !rustix::process::geteuid().is_root() {
        let test = "another_user_who_waits_for_the_files_of_a_new_bus_opens_none";
        return support::not_run(test, "only root can act as another user");
    }
    in_own_process(|| {
        let robot = domain("raced");
        let over = AtomicBool::new(false);
        let (seen, won) = std::thread::scope(|scope| {
            let racer = scope.spawn(|| race(&robot.shared_memory_prefix(), &over));
            for _ in 0..200 {
                DomainLock::acquire(robot.clone(), 1).unwrap();
            }
            over.store(true, Ordering::Relaxed);
            racer.join().unwrap()
        });
        println!("tried to open {seen} files, opened {won}");
        assert!(seen >= 200, "{seen}");
        assert_eq!(won, 0);
    });
}

/// Opens each file of that prefix for writing, as another user, on creation or change of
/// permissions. Returns tries and successes.
fn race(prefix: &str, over: &AtomicBool) -> (usize, usize) {
    let nobody = Uid::from_raw(65534);
    // Sets the user of this thread alone.
    set_thread_res_uid(nobody, nobody, nobody).unwrap();
    let watched = inotify::init(inotify::CreateFlags::NONBLOCK).unwrap();
    let events = inotify::WatchFlags::CREATE | inotify::WatchFlags::ATTRIB;
    inotify::add_watch(&watched, "/dev/shm", events).unwrap();
    let mut room = [MaybeUninit::uninit(); 4096];
    let mut reader = inotify::Reader::new(&watched, &mut room);
    let (mut seen, mut won) = (0, 0);
    while !over.load(Ordering::Relaxed) {
        let Ok(event) = reader.next() else {
            poll::is_readable(&watched, Duration::from_millis(20)).unwrap();
            continue;
        };
        let name = event.file_name().and_then(|name| name.to_str().ok()).unwrap_or_default();
        if name.starts_with(prefix) && name.contains('.') {
            seen += 1;
            won += usize::from(
                fs::File::options().write(true).open(format!("/dev/shm/{name}")).is_ok(),
            );
        }
    }
    (seen, won)
}

#[test]
fn a_directory_of_another_user_with_the_name_of_this_users_blocks_no_start() {
    let test = "a_directory_of_another_user_with_the_name_of_this_users_blocks_no_start";
    let as_user = ["setpriv", "--reuid=54322", "--regid=54322", "--clear-groups"];
    if !rustix::process::geteuid().is_root() || !support::can_run(&as_user) {
        return support::not_run(test, "only root can act as another user");
    }
    let home = tempfile::tempdir().unwrap();
    std::os::unix::fs::chown(home.path(), Some(54322), Some(54322)).unwrap();
    let squatted = Path::new("/tmp/firsthand-54322");
    fs::create_dir_all(squatted).unwrap();
    let start = |arguments: &[&str]| {
        let mut command = support::firsthand_under(&as_user, arguments);
        command.env("HOME", home.path()).env_remove("FIRSTHAND_SUITE").current_dir(home.path());
        command
    };
    let slowly = ["run", "open-room", "--robot", "squatted", "--pace", "1", "--json"];
    let mut run = start(&slowly).stdout(Stdio::piped()).spawn().unwrap();
    // Another process of the user finds the robot and stops it.
    support::wait_until("it is found", || {
        let status = start(&["status", "--robot", "squatted", "--json"]).output().unwrap();
        status.status.success() && home.path().join(".firsthand/squatted/lock").exists()
    });
    signal_process(run.id(), Signal::TERM);
    let code = run.wait().unwrap().code();
    let taken = fs::read_dir(squatted).unwrap().count();
    fs::remove_dir(squatted).unwrap();
    assert_eq!((code, taken), (Some(0), 0));
}

#[test]
fn datagrams_of_another_user_do_not_drive_the_simulated_robot_of_a_run() {
    if !rustix::process::geteuid().is_root() {
        let test = "datagrams_of_another_user_do_not_drive_the_simulated_robot_of_a_run";
        return support::not_run(test, "only root can act as another user");
    }
    in_own_process(|| {
        let run = Run::under_way("driven", "open-room", &["--pace", "4"], 0.3);
        let robot = common::run::Run::load(&run.directory()).unwrap().address;
        let Address::Udp(robot) = robot else { panic!("{robot}") };
        // The thread ends with the process of this test.
        std::thread::spawn(move || {
            let nobody = Uid::from_raw(65534);
            set_thread_res_uid(nobody, nobody, nobody).unwrap();
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            let mut backwards = Vec::new();
            Command::velocity([Some(-500); 2], None).encode(Addressing::default(), &mut backwards);
            loop {
                let _ = socket.send_to(&backwards, robot);
                std::thread::park_timeout(Duration::from_millis(5));
            }
        });
        let summary = run.arrives();
        assert_eq!(summary["safety_events"], 0, "{summary}");
    });
}

#[test]
fn no_file_of_a_run_is_open_to_other_users() {
    let run = Run::under_way("closed", "open-room", &["--pace", "1"], 0.3);
    let robot = domain("closed");
    for path in shared("closed").into_iter().chain([robot.directory().to_owned()]) {
        // A removed file cannot be opened by others.
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
    let prefix = domain("planted").shared_memory_prefix();
    let planted = &Path::new("/dev/shm").join(prefix + "9204_node.0_10_0.global_mgmt");
    fs::write(planted, "").unwrap();
    fs::set_permissions(planted, fs::Permissions::from_mode(0o666)).unwrap();
    std::os::unix::fs::chown(planted, Some(65534), Some(65534)).unwrap();
    let run = Run::start("planted", "open-room", &[]);
    let (code, summary) = run.finish();
    let there = planted.exists();
    let _ = fs::remove_file(planted);
    assert_eq!(code, Some(0), "{summary}");
    assert!(there, "the robot keeps a file of another user");
    assert_nothing_left("planted");
}

#[test]
fn a_bus_whose_count_of_nodes_is_empty_is_not_joined_and_the_message_says_so() {
    in_own_process(|| {
        let run = Run::under_way("emptied", "open-room", &["--pace", "1"], 0.3);
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
        assert!(began.elapsed() < ENDS_WITHIN, "{:?}", began.elapsed());
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
        // A stage that joins finds these files.
        signal_process(pid(&status, "mapper"), Signal::KILL);
        std::thread::park_timeout(Duration::from_millis(500));
        if Path::new(&format!("/proc/{supervisor}")).exists() {
            signal_process(supervisor, Signal::TERM);
        }
        let began = Instant::now();
        run.reap();
        let took = began.elapsed();
        println!("{robot}: ended {took:?} after SIGTERM");
        assert!(took < ENDS_WITHIN, "{robot}: {took:?}");
        Run::start(robot, "open-room", &[]).arrives();
    }
}

#[test]
fn two_robots_on_one_machine_do_not_see_each_other() {
    let mut one = Run::start("one", "open-room", &["--pace", "4"]);
    let mut two = Run::at_own_speed("two", "trap", &["--pace", "4"]);
    let status = one.wait_until_under_way(1.0);
    two.wait_until_under_way(1.0);
    let other = two.status().unwrap();
    assert_ne!(find(&status, "mapper")["pid"], find(&other, "mapper")["pid"]);
    one.kill_and_await_successor("mapper", Signal::KILL);
    assert_eq!(one.arrives()["restarts"]["mapper"], 1);
    assert_eq!(two.arrives()["restarts"]["mapper"], 0);
}

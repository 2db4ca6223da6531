//! Tests that other processes and users can neither drive a robot nor block its start.

use std::{
    fs,
    mem::MaybeUninit,
    net::UdpSocket,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use crate::support::{
    PATIENCE, Run, assert_no_restart, assert_nothing_left, assert_reached, assert_refused, domain,
    firsthand, in_own_process, in_own_process_of_root, json_of, kill, logged, output, pid,
    shared_memory, signal_process, start_piped, wait_until,
};
use common::{
    address::Address,
    bus::{Bus, BusError, Payload, Stamped, Topic, Writer},
    clock::MissionTime,
    poll,
    samples::{CommandSample, CommandState, DirectiveSample, Order},
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

/// Publishes default samples in the first and the last tick there can be.
fn forge<H: Stamped, E: Payload>(bus: &Bus, topic: &Topic<H, E>) -> Writer<H, E> {
    let mut writer = bus.slice_writer(topic, u32::MAX, 1).unwrap();
    for tick in [0, u64::MAX] {
        writer.publish_slice(tick, MissionTime(tick), H::default(), &[]).unwrap();
    }
    writer
}

#[test]
fn a_second_controller_or_supervisor_and_samples_that_seem_newer_are_ignored_and_told() {
    in_own_process(|| {
        let robot = "forged";
        let slow = "--pace 4 --set controller.speed_m_s=0.1";
        let run = Run::under_way(robot, "open-room", slow, 0.3);
        let mut echo = firsthand(&["topic", "echo", "pose", "--robot", robot, "--json"]);
        let echo = start_piped(echo.args(["--number", "40"]));
        let printed = echo.stdout.as_ref().unwrap();
        assert!(poll::is_readable(printed, PATIENCE).unwrap(), "nothing is shown");
        let bus = Bus::join(&domain(robot), "forger").unwrap();
        let forged = (
            forge(&bus, &topics::RANGES),
            forge(&bus, &topics::WHEELS),
            forge(&bus, &topics::POSE),
            forge(&bus, &topics::GRID),
            forge(&bus, &topics::GUIDANCE),
            forge(&bus, &topics::LINK),
        );
        let mut commands = bus.writer(&topics::COMMAND, u32::MAX).unwrap();
        let mut orders = bus.writer(&topics::DIRECTIVE, u32::MAX).unwrap();
        let own = format!("process {}:", std::process::id());
        for reader in ["dead-reckoning", "mapper", "planner", "controller"] {
            let told = || logged(&run.directory(), reader, &["WARN", &own]) == 1;
            wait_until("a warning names the forger", told);
        }
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
        wait_until("the commander is told", || {
            let newest = MissionTime(u64::MAX);
            commands.publish(u64::MAX, newest, backwards).unwrap();
            orders.publish(u64::MAX, newest, stop).unwrap();
            run.status().is_some_and(|status| {
                let link = &status["link"];
                link["ignored_writer"] == u64::from(std::process::id())
                    && link["ignored_samples"].as_u64() > Some(3)
            })
        });
        let ended = pidfd_open(Pid::from_child(&echo), PidfdFlags::empty()).unwrap();
        assert!(poll::is_readable(&ended, PATIENCE).unwrap(), "the echo ends");
        let (code, shown) = json_of(&echo.wait_with_output().unwrap());
        let foreign = shown.iter().filter(|sample| sample["stamp"]["generation"] != 1);
        assert_eq!((code, shown.len(), foreign.count()), (Some(0), 40, 0));
        drop((forged, commands, orders, bus));
        let (summary, directory) = run.arrives_in();
        let recording = Recording::open(&directory.path().join("run")).unwrap();
        let poses = recording.samples(&topics::POSE).unwrap();
        let stamps: Vec<_> = poses.map(|pose| pose.unwrap().stamp).collect();
        assert!(stamps.iter().all(|stamp| stamp.generation == 1));
        assert!(stamps.is_sorted_by_key(|stamp| stamp.tick));
        assert!(stamps.len() > 40, "{}", stamps.len());
        assert_no_restart(&summary);
        assert_eq!(summary["resets"], 0, "{summary}");
    });
}

#[test]
fn another_user_who_waits_for_the_files_of_a_new_bus_opens_none() {
    in_own_process_of_root(|| {
        let robot = domain("raced");
        let over = AtomicBool::new(false);
        let (seen, won) = thread::scope(|scope| {
            let racer = scope.spawn(|| race(&robot.shared_memory_prefix(), &over));
            for _ in 0..200 {
                DomainLock::acquire(robot.clone(), 1).unwrap();
            }
            over.store(true, Ordering::Relaxed);
            racer.join().unwrap()
        });
        assert!(seen >= 200 && won == 0, "tried to open {seen} files, opened {won}");
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
            let opened = fs::File::options().write(true).open(format!("/dev/shm/{name}"));
            won += usize::from(opened.is_ok());
        }
    }
    (seen, won)
}

#[test]
fn files_and_datagrams_of_another_user_neither_block_nor_drive_a_run() {
    in_own_process_of_root(|| {
        let prefix = domain("driven").shared_memory_prefix();
        let planted = &Path::new("/dev/shm").join(prefix + "9204_node.0_10_0.global_mgmt");
        fs::write(planted, "").unwrap();
        fs::set_permissions(planted, fs::Permissions::from_mode(0o666)).unwrap();
        std::os::unix::fs::chown(planted, Some(65534), Some(65534)).unwrap();
        let run = Run::under_way("driven", "open-room", "--pace 4", 0.3);
        let robot = common::run::Run::load(&run.directory()).unwrap().address;
        let Address::Udp(robot) = robot else { panic!("{robot}") };
        // The thread ends with the process of this test.
        thread::spawn(move || {
            let nobody = Uid::from_raw(65534);
            set_thread_res_uid(nobody, nobody, nobody).unwrap();
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            let mut backwards = Vec::new();
            Command::velocity([Some(-500); 2], None).encode(Addressing::default(), &mut backwards);
            loop {
                let _ = socket.send_to(&backwards, robot);
                thread::park_timeout(Duration::from_millis(5));
            }
        });
        let (code, summary) = run.finish();
        let there = planted.exists();
        let _ = fs::remove_file(planted);
        assert_reached(code, &summary);
        assert_eq!(summary["safety_events"], 0, "{summary}");
        assert!(there, "the robot keeps a file of another user");
        assert_nothing_left("driven");
    });
}

#[test]
fn a_signal_goes_to_who_holds_the_supervisors_lock_and_not_to_the_number_in_its_file() {
    let mut bystander = std::process::Command::new("sleep").arg("60").spawn().unwrap();
    let robot = domain("stale-lock");
    fs::create_dir_all(robot.directory()).unwrap();
    for stale in [bystander.id().to_string(), "-1".to_owned()] {
        fs::write(robot.lock_file(), stale).unwrap();
        let killed = output(&["stage", "kill", "supervisor", "--robot", "stale-lock"]);
        assert_refused(&killed, "no-process", &["supervisor"]);
        assert!(bystander.try_wait().unwrap().is_none(), "it was killed");
    }
    kill(&mut bystander);
    fs::remove_dir_all(robot.directory()).unwrap();
}

/// Runs into damage. Asserts that the run ends soon after SIGTERM, and that the next one arrives.
fn ends_after(robot: &str, damage: impl Fn(&[PathBuf])) {
    let mut run = Run::start(robot, "open-room", "--pace 1");
    let status = run.wait_until_under_way(0.3);
    damage(&shared_memory(&domain(robot).shared_memory_prefix()));
    // A stage that joins finds these files.
    signal_process(pid(&status, "mapper"), Signal::KILL);
    thread::park_timeout(Duration::from_millis(500));
    if run.is_running() {
        run.signal(Signal::TERM);
    }
    let began = Instant::now();
    run.reap();
    assert!(began.elapsed() < ENDS_WITHIN, "{robot}: {:?}", began.elapsed());
    Run::start(robot, "open-room", "").arrives();
}

#[test]
fn files_of_the_bus_truncated_or_removed_in_a_run_leave_sigterm_its_three_seconds() {
    in_own_process(|| {
        let truncate = |path: &PathBuf| drop(fs::File::create(path));
        thread::scope(|scope| {
            scope.spawn(|| ends_after("truncated", |shared| shared.iter().for_each(truncate)));
            scope.spawn(|| {
                ends_after("removed", |shared| {
                    for path in shared {
                        let _ = fs::remove_file(path).or_else(|_| fs::remove_dir_all(path));
                    }
                });
            });
            // A bus without its count of nodes is not joined.
            ends_after("emptied", |shared| {
                let counts = |path: &&PathBuf| path.to_string_lossy().ends_with(".global_mgmt");
                shared.iter().filter(counts).for_each(truncate);
                let refused = Bus::join(&domain("emptied"), "late").unwrap_err();
                assert!(matches!(refused, BusError::Join { .. }), "{refused}");
            });
        });
    });
}

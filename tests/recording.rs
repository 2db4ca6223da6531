//! Tests of recorded runs of real processes, which replay bit by bit, and of killed recorders.

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::{Child, ChildStdout},
    thread,
    time::Duration,
};

use common::{
    bus::decode_sample,
    grid::CellState,
    poll,
    samples::{PoseSample, RequestAnswer, RequestKind, name_str},
    topics,
};
use recording::{
    End, Message, Recording,
    replay::{Options, replay},
};
use rustix::process::Signal;

use crate::support::{
    self, PATIENCE, Run, STAGES, assert_ended, assert_nothing_left, assert_reached, assert_refused,
    firsthand, golden, golden_of, json_of, kill, logged, messages, operate, output, process_with,
    recording_in, refused, replayed, replayed_in, signal_process, start_piped, wait_until, words,
};

/// Starts a recorder of `robot`. Returns it with its output.
fn recorder(robot: &str, file: &Path) -> (Child, BufReader<ChildStdout>) {
    let mut command = firsthand(&["record", "--robot", robot, "--out"]);
    let mut recorder = start_piped(command.arg(file));
    let said = BufReader::new(recorder.stdout.take().unwrap());
    (recorder, said)
}

#[test]
fn a_run_is_recorded_from_its_first_sample_and_every_stage_replays_to_the_bit() {
    let robot = "rec-whole";
    // Another recorder waits for the robot.
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("waited.mcap");
    let (mut waits, said) = recorder(robot, &file);
    let (code, summary, directory) =
        Run::at_own_speed(robot, "obstacle-course", "--pace 2").finish_in();
    assert_reached(code, &summary);
    said.lines().map(Result::unwrap).find(|line| line.contains("complete")).unwrap();
    signal_process(waits.id(), Signal::INT);
    waits.wait().unwrap();
    assert_eq!(Recording::open(&file).unwrap().run.mission.name, "obstacle-course");

    let run = directory.path().join("run");
    let picture = fs::read_to_string(run.join("picture.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    let page = fs::read_to_string(run.join("report/report.html")).unwrap();
    let (messages, _) = messages(&page);
    let outcome = messages.last().unwrap()["outcome"].as_str().unwrap();
    assert!(outcome.starts_with("reached"), "{outcome}");
    let columns = messages[0]["about"]["columns"].as_array().unwrap();
    let at = columns.iter().position(|column| column == "true_x").unwrap();
    let mut rows = messages.iter().filter_map(|message| message["rows"].as_array()).flatten();
    assert!(rows.any(|row| row[at].is_number()), "the ground truth");
    assert_eq!(support::records(&run.join("summary.json")), [summary]);
    for process in STAGES.iter().copied().chain(["x80-sim"]) {
        assert!(logged(&run, process, &[]) > 0, "{process}");
    }

    let recording = recording_in(&directory);
    assert_eq!(recording.end, End::Complete);
    assert!(recording.lost.is_empty(), "{:?}", recording.lost);
    let poses = recording.samples(&topics::POSE).unwrap();
    let ticks: Vec<u64> = poses.map(|pose| pose.unwrap().stamp.tick).collect();
    let expected: Vec<u64> = (0..ticks.len() as u64).collect();
    assert_eq!(ticks, expected);
    let mut grids = recording.slices(&topics::GRID).unwrap();
    let (header, cells) = grids.next().unwrap().unwrap();
    assert!(header.part.is_keyframe());
    assert_eq!(cells.len(), recording.run.mission.grid_frame().area());
    assert!(recording.counts["log"] > 5);
    assert!(recording.counts["wire"] > 2 * ticks.len() as u64);
    // On a wall clock a tick is answered again when its map is solved.
    let guidance = recording.samples(&topics::GUIDANCE).unwrap();
    let guidance: Vec<_> = guidance.map(Result::unwrap).collect();
    let again = guidance.windows(2).any(|pair| {
        pair[0].stamp.tick == pair[1].stamp.tick && pair[0].full_solves < pair[1].full_solves
    });
    assert!(again, "{guidance:?}");

    let report = replayed(&recording);
    assert_eq!(report.equal(), 5);
    for stage in STAGES {
        // On a loaded machine some ticks may stay unanswered.
        let least = ticks.len() as u64 / 2;
        assert!(report.stages[stage].compared > least, "{report}");
    }
    assert_nothing_left(robot);
}

#[test]
fn every_order_that_was_answered_is_recorded_and_a_run_that_is_ended_waits_for_its_recorder() {
    let robot = "rec-orders";
    // These commands take long on a busy machine, and the robot must arrive later.
    let slow = "--pace 1 --set controller.speed_m_s=0.006";
    let mut run = Run::start(robot, "open-room", slow);
    run.wait_until_driving();
    let mut asked = Vec::new();
    for _ in 0..4 {
        for (line, kind) in [
            ("stop", RequestKind::Stop),
            ("resume", RequestKind::Resume),
            ("goto 3 0", RequestKind::Goto),
            ("stage restart planner", RequestKind::Restart),
        ] {
            let said = output(&words(&format!("{line} --robot {robot}")));
            assert!(said.status.success(), "{said:?}");
            // A stop that could not reach the supervisor says so, and still holds.
            if said.stderr.is_empty() {
                asked.push((kind, RequestAnswer::Taken));
            }
        }
    }
    refused(&["goto", "99", "0", "--robot", robot], "target-outside", &[]);
    asked.push((RequestKind::Goto, RequestAnswer::Outside));
    let recorder = process_with(robot, "firsthand record").unwrap();
    signal_process(recorder, Signal::STOP);
    run.signal(Signal::TERM);
    // Longer than a hung loop may stand still.
    thread::sleep(Duration::from_secs(4));
    signal_process(recorder, Signal::CONT);
    let (code, summary, directory) = run.finish_in();
    assert_ended(code, &summary, 0, "aborted");
    let recording = recording_in(&directory);
    assert_eq!(recording.end, End::Complete);
    let orders: Vec<_> = recording.samples(&topics::ORDERS).unwrap().map(Result::unwrap).collect();
    let answered: Vec<_> = orders.iter().map(|order| (order.kind(), order.answer())).collect();
    // An order is repeated until it is taken, possibly after its sender has ended.
    let mut rest = answered.iter();
    assert!(asked.iter().all(|order| rest.any(|it| it == order)), "{answered:?}");
    let times = orders.windows(2).map(|pair| pair[1].stamp.stamp_ns - pair[0].stamp.stamp_ns);
    assert!(times.min() > Some(0), "each has its mission time");
    assert_eq!(recording.lost.get("orders"), None);
    assert_nothing_left(robot);
}

#[test]
fn a_run_in_lockstep_waits_for_its_recorder_and_its_log_time_is_mission_time() {
    let run = Run::start("rec-late", "open-room", "--timeout 8");
    let file = run.directory().join("recording.mcap");
    wait_until("the recorder has begun its file", || file.exists());
    let recorder = process_with("rec-late", "firsthand record").unwrap();
    signal_process(recorder, Signal::STOP);
    support::wait_for_status("rec-late", |status| status["order"] == "driving");
    signal_process(recorder, Signal::CONT);
    let (_, summary, directory) = run.finish_in();
    let recording = recording_in(&directory);
    assert!(recording.lost.is_empty(), "{:?}", recording.lost);
    assert_eq!(replayed(&recording).equal(), 5);

    let mission_s = summary["mission_time_s"].as_f64().unwrap();
    let began_of = |message: Message| {
        let pose: PoseSample = decode_sample(&message.data)?;
        Some(message.log_ns - pose.stamp.stamp_ns)
    };
    let began = recording.decoded(&["pose"], began_of).unwrap();
    let began: BTreeSet<u64> = began.map(Result::unwrap).collect();
    assert_eq!(began.len(), 1, "{began:?}");
    let began_ns = *began.first().unwrap();
    let mut drawn = 0;
    for message in recording.messages(&[]).unwrap() {
        let message = message.unwrap();
        let at_s = (message.log_ns - began_ns) as f64 * 1e-9;
        assert!((0.0..=mission_s + 1.0).contains(&at_s), "{at_s} s on {}", message.topic);
        drawn += usize::from(&*message.topic == "foxglove/pose" && at_s > mission_s / 2.0);
    }
    assert!(drawn > 10, "{drawn} drawn poses in the second half of {mission_s} s");
    let mut beats = recording.messages(&["health"]).unwrap().map(Result::unwrap);
    assert!(beats.any(|beat| (beat.log_ns - began_ns) as f64 * 1e-9 > mission_s / 2.0));
}

/// Kills a recorder of `robot` after `growths` growths of its file.
fn kill_recorder(robot: &str, file: &Path, growths: usize) {
    let (mut recorder, mut said) = recorder(robot, file);
    let attaches = poll::is_readable(said.get_ref(), PATIENCE).unwrap();
    assert!(attaches, "the robot is gone");
    let mut attached = String::new();
    said.read_line(&mut attached).unwrap();
    assert!(attached.starts_with("recording"), "{attached}");
    let length = || fs::metadata(file).map_or(0, |file| file.len());
    for _ in 0..growths {
        let before = length();
        wait_until("a chunk is written", || length() > before);
    }
    kill(&mut recorder);
}

#[test]
fn recorders_killed_leave_readable_files_that_say_so_and_the_mission_as_it_was() {
    let run = Run::under_way("rec-shot", "open-room", "--pace 1", 0.5);
    // A standing robot cannot arrive before its recorders are killed.
    operate("rec-shot", "stop");
    let directory = tempfile::tempdir().unwrap();
    let mut read = 0;
    for shot in 0..6 {
        let file = directory.path().join(format!("{shot}.mcap"));
        kill_recorder(&run.robot, &file, shot / 2);
        let recording = Recording::open(&file).unwrap();
        assert_ne!(recording.end, End::Complete);
        let messages = recording.messages(&[]).unwrap().map(Result::unwrap).count() as u64;
        assert_eq!(messages, recording.counts.values().sum::<u64>());
        read += messages;
    }
    assert!(read > 0, "every recorder died before its first chunk");
    operate("rec-shot", "resume");
    let (summary, directory) = run.arrives_in();
    support::assert_no_restart(&summary);
    assert_eq!(replayed_in(&directory).equal(), 5);
}

#[test]
fn a_disk_budget_ends_files_at_a_quarter_of_it_removes_the_oldest_and_each_can_be_read_alone() {
    // The run is long enough for eight files. The budget allows one that exceeds its share by a
    // chunk.
    let budget = "--pace 4 --disk-budget 1500kB --set controller.speed_m_s=0.15";
    let (_, directory) = Run::start("rec-budget", "obstacle-course", budget).arrives_in();
    let run = directory.path().join("run");
    let files = recording::parts(&run);
    let size = |file: &PathBuf| fs::metadata(file).unwrap().len();
    let total: u64 = files.iter().map(size).sum();
    assert!(!run.join("recording.mcap").exists(), "{files:?}");
    // A file exceeds its share by at most a chunk.
    assert!(total < 2_100_000, "{total} in {files:?}");
    let all = Options::default();
    for file in &files {
        let recording = Recording::open(file).unwrap();
        assert_eq!(recording.end, End::Complete);
        assert_eq!(replay(&recording, &all).unwrap().difference, None);
    }
    let largest = Recording::open(files.iter().max_by_key(|file| size(file)).unwrap()).unwrap();
    let mut grids = largest.slices(&topics::GRID).unwrap().map(Result::unwrap);
    assert!(grids.any(|(header, _)| header.part.is_keyframe()), "{files:?}");
    assert!(replay(&largest, &all).unwrap().not_replayed() > 0, "{files:?}");
}

/// `.ci/renew` records the golden recording again after an intended change.
#[test]
fn the_golden_recording_replays_to_the_bit_and_with_another_constant_differs_with_its_place() {
    let recording = golden();
    let report = replayed(&recording);
    assert_eq!(report.equal(), 5);
    assert!(report.stages["planner"].compared > 20, "{report}");

    let mut run = recording.run.clone();
    run.mission.controller.speed_m_s = Some(run.mission.speed_m_s() * 1.01);
    let options = Options { run: Some(run), ..Options::default() };
    let report = replay(&recording, &options).unwrap();
    let difference = report.difference.as_ref().unwrap();
    assert_eq!((difference.stage, &*difference.topic), ("controller", "command"));
    let speeds = ["left_rad_s", "right_rad_s", "v_m_s"];
    assert!(speeds.contains(&&*difference.field), "{difference}");
    assert_ne!(difference.recorded, difference.computed);
    assert!(difference.inputs.iter().any(|input| input.contains("guidance")), "{difference}");
    assert_eq!(report.stages["controller"].different, 1);
    assert_eq!(report.stages["mapper"].equal, 1);
}

#[test]
fn a_golden_recording_of_obstacles_a_killed_stage_and_a_stall_replays_to_the_bit() {
    let recording = golden_of("stall-and-kill");
    let stalls = recording.samples(&topics::STALLS).unwrap().count();
    let deaths = recording.samples(&topics::DEATHS).unwrap().map(Result::unwrap);
    let killed: Vec<_> = deaths.map(|death| name_str(&death.stage).to_owned()).collect();
    assert!(stalls > 0);
    assert_eq!(killed, ["mapper"]);
    let mut grids = recording.slices(&topics::GRID).unwrap().map(Result::unwrap);
    let sensed = |cell: &u8| *cell == CellState::Sensed as u8;
    assert!(grids.any(|(_, cells)| cells.iter().any(sensed)), "obstacles");
    let report = replayed(&recording);
    let generations = |stage| report.stages[stage].equal;
    let planners = 1 + stalls as u64;
    assert_eq!((generations("mapper"), generations("planner")), (2, planners), "{report}");
    assert_eq!(report.equal(), 3 + 2 + planners);
}

#[test]
fn replay_and_diff_say_what_they_found_and_exit_with_1_on_a_difference() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let of_two = output(&["replay", file, "--stage", "mapper,planner", "--json"]);
    let (code, report) = json_of(&of_two);
    assert_eq!(code, Some(0), "{of_two:?}");
    assert_eq!(report[0]["stages"]["planner"]["equal"], 1, "{report:?}");
    assert!(report[0]["stages"].get("controller").is_none(), "{report:?}");
    let same = output(&["runs", "diff", file, file]);
    assert_eq!(same.status.code(), Some(0), "{same:?}");
    let other = golden_of("stall-and-kill").path;
    let parted = output(&["runs", "diff", file, other.to_str().unwrap(), "--json"]);
    let (code, found) = json_of(&parted);
    assert_eq!(code, Some(1), "{parted:?}");
    assert!(!found[0]["first"].is_null(), "{found:?}");

    let no_recording = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    refused(&["replay", no_recording], "not-a-recording", &[no_recording]);
    refused(&["replay", file, "--stage", "wheel"], "unknown-stage", &["wheel"]);

    // A run's directory stands for its recording, unless it holds none or several.
    let directory = tempfile::tempdir().unwrap();
    let run = directory.path().to_str().unwrap();
    let replay = || output(&["replay", run, "--stage", "mapper"]);
    assert_refused(&replay(), "no-recording", &[run]);
    let copy = |name: &str| fs::copy(file, directory.path().join(name)).unwrap();
    copy("recording.mcap");
    assert_eq!(replay().status.code(), Some(0));
    copy("recording-2.mcap");
    assert_refused(&replay(), "several-recordings", &[run, "recording-2.mcap"]);
}

//! Tests of recorded runs of real processes, which replay bit by bit, and of killed recorders.

use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::{Path, PathBuf},
    process::Stdio,
    thread,
    time::Duration,
};

use common::{
    grid::CellState,
    poll,
    samples::{RequestAnswer, RequestKind, name_str},
    topics,
};
use recording::{
    End, Recording,
    replay::{Options, diff::diff, replay},
};
use rustix::process::Signal;

use crate::support::{
    self, PATIENCE, Run, STAGES, assert_ended, assert_nothing_left, assert_refused, firsthand,
    golden, golden_of, json_of, operate, output, processes, refused, replayed, replayed_in,
    signal_process, wait_until,
};

fn open(directory: &Path) -> Recording {
    Recording::open(&directory.join("run/recording.mcap")).unwrap()
}

#[test]
fn a_run_is_recorded_from_its_first_sample_and_every_stage_replays_to_the_bit() {
    let run = Run::start("rec-whole", "open-room", &["--pace", "4"]);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    let recording = open(directory.path());
    assert_eq!(recording.end, End::Complete);
    assert_eq!(recording.run.mission.name, "open-room");
    assert!(recording.lost.is_empty(), "{:?}", recording.lost);
    let poses = recording.samples(&topics::POSE).unwrap();
    let ticks: Vec<u64> = poses.map(|pose| pose.unwrap().sample.stamp.tick).collect();
    let expected: Vec<u64> = (0..ticks.len() as u64).collect();
    assert_eq!(ticks, expected);
    let mut grids = recording.slices(&topics::GRID).unwrap();
    let first = grids.next().unwrap().unwrap();
    assert!(first.header.part.is_keyframe());
    assert_eq!(first.elements.len(), recording.run.mission.grid_frame().area());
    assert!(recording.counts["log"] > 5);
    assert!(recording.counts["wire"] > 2 * ticks.len() as u64);

    let report = replayed(&recording);
    assert_eq!(report.equal(), 5);
    for stage in STAGES {
        // On a loaded machine some ticks may stay unanswered.
        let least = ticks.len() as u64 / 2;
        assert!(report.stages[stage].compared > least, "{report}");
    }
    let parting = diff(&recording, &recording).unwrap();
    assert_eq!(parting.first, None);
    assert_eq!(parting.ticks, ticks.len() as u64);
    assert_nothing_left("rec-whole");
}

#[test]
fn every_order_that_was_answered_is_recorded_with_its_answer_though_its_process_has_ended() {
    // These commands take minutes on a busy machine, and the robot must arrive later.
    let slow = ["--pace", "1", "--set", "controller.speed_m_s=0.006"];
    let mut run = Run::start("rec-orders", "open-room", &slow);
    run.wait_until_driving();
    let mut asked = Vec::new();
    for _ in 0..10 {
        let words: [(&[&str], _); 4] = [
            (&["stop"], RequestKind::Stop),
            (&["resume"], RequestKind::Resume),
            (&["goto", "3", "0"], RequestKind::Goto),
            (&["stage", "restart", "planner"], RequestKind::Restart),
        ];
        for (words, kind) in words {
            let said = output(&[words, &["--robot", "rec-orders"]].concat());
            assert!(said.status.success(), "{said:?}");
            // A stop that could not reach the supervisor says so, and still holds.
            if said.stderr.is_empty() {
                asked.push((kind, RequestAnswer::Taken));
            }
        }
    }
    refused(&["goto", "99", "0", "--robot", "rec-orders"], "target-outside", &[]);
    asked.push((RequestKind::Goto, RequestAnswer::Outside));
    run.signal(Signal::TERM);
    let (_, _, directory) = run.finish_in();
    let recording = open(directory.path());
    let orders = recording.samples(&topics::ORDERS).unwrap().map(|order| order.unwrap().sample);
    let orders: Vec<_> = orders.collect();
    let answered: Vec<_> = orders.iter().map(|order| (order.kind(), order.answer())).collect();
    // An order is repeated until it is taken, possibly after its sender has ended.
    let mut rest = answered.iter();
    assert!(asked.iter().all(|order| rest.any(|it| it == order)), "{answered:?}");
    let times = orders.windows(2).map(|pair| pair[1].stamp.stamp_ns - pair[0].stamp.stamp_ns);
    assert!(times.min() > Some(0), "each has its mission time");
    assert_eq!(recording.lost.get("orders"), None);
    assert_nothing_left("rec-orders");
}

#[test]
fn the_log_time_of_a_run_in_lockstep_is_mission_time() {
    let (summary, directory) = Run::start("rec-times", "open-room", &[]).arrives_in();
    let recording = open(directory.path());
    let mission_s = summary["mission_time_s"].as_f64().unwrap();
    let pose = recording.samples(&topics::POSE).unwrap().map(Result::unwrap);
    let began: std::collections::HashSet<u64> =
        pose.map(|pose| pose.log_ns - pose.sample.stamp.stamp_ns).collect();
    assert_eq!(began.len(), 1, "{began:?}");
    let began_ns = began.into_iter().next().unwrap();
    let mut drawn = 0;
    for message in recording.messages(&[]).unwrap() {
        let message = message.unwrap();
        let at_s = (message.log_ns - began_ns) as f64 * 1e-9;
        assert!((0.0..=mission_s + 1.0).contains(&at_s), "{at_s} s on {}", message.topic);
        drawn += usize::from(&*message.topic == "foxglove/pose" && at_s > mission_s / 2.0);
    }
    assert!(drawn > 10, "{drawn} drawn poses in the second half of {mission_s} s");
    let mut beats = recording.samples(&topics::HEALTH).unwrap().map(Result::unwrap);
    assert!(beats.any(|beat| (beat.log_ns - began_ns) as f64 * 1e-9 > mission_s / 2.0));
}

#[test]
fn on_a_wall_clock_a_tick_is_answered_again_when_its_map_is_solved() {
    let run = Run::at_own_speed("rec-again", "obstacle-course", &["--pace", "2"]);
    let (_, summary, directory) = run.finish_in();
    let recording = open(directory.path());
    let guidance = recording.samples(&topics::GUIDANCE).unwrap();
    let guidance: Vec<_> = guidance.map(|guidance| guidance.unwrap().sample).collect();
    let mut pairs = guidance.windows(2);
    let again = pairs.any(|pair| {
        pair[0].stamp.tick == pair[1].stamp.tick && pair[0].full_solves < pair[1].full_solves
    });
    assert!(again, "{summary} {guidance:?}");
    replayed(&recording);
}

#[test]
fn a_run_in_lockstep_waits_for_its_recorder_and_is_recorded_from_its_first_sample() {
    let run = Run::start("rec-late", "open-room", &["--timeout", "8"]);
    let file = run.directory().join("recording.mcap");
    wait_until("the recorder has begun its file", || file.exists());
    let recorder = recorder_of(&run);
    signal_process(recorder, Signal::STOP);
    support::wait_for_status("rec-late", |status| status["order"] == "driving");
    signal_process(recorder, Signal::CONT);
    let (_, _, directory) = run.finish_in();
    let recording = open(directory.path());
    assert!(recording.lost.is_empty(), "{:?}", recording.lost);
    assert_eq!(replayed(&recording).equal(), 5);
}

fn recorder_of(run: &Run) -> u32 {
    let mut processes = processes(run.directory().to_str().unwrap()).into_iter();
    processes.find(|(_, line)| line.contains(" record ")).unwrap().0
}

#[test]
fn a_run_that_is_ended_waits_for_its_recorder_and_is_not_taken_for_one_that_hangs() {
    let run = Run::under_way("rec-held", "open-room", &["--pace", "1"], 0.5);
    let recorder = recorder_of(&run);
    signal_process(recorder, Signal::STOP);
    run.signal(Signal::TERM);
    // Longer than a hung loop may stand still.
    thread::sleep(Duration::from_secs(4));
    signal_process(recorder, Signal::CONT);
    let (code, summary, directory) = run.finish_in();
    assert_ended(code, &summary, 0, "aborted");
    assert_eq!(open(directory.path()).end, End::Complete);
}

/// Kills a recorder of `robot` after `growths` growths of its file. Returns its file.
fn killed_recorder(run: &Run, file: PathBuf, growths: usize) -> PathBuf {
    let mut recorder = firsthand(&["record", "--robot", &run.robot, "--out"])
        .arg(&file)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut attached = String::new();
    let said = recorder.stdout.take().unwrap();
    let attaches = poll::is_readable(&said, PATIENCE).unwrap();
    assert!(attaches, "the robot is gone");
    BufReader::new(said).read_line(&mut attached).unwrap();
    assert!(attached.starts_with("recording"), "{attached}");
    let length = || fs::metadata(&file).map_or(0, |file| file.len());
    for _ in 0..growths {
        let before = length();
        wait_until("a chunk is written", || length() > before);
    }
    recorder.kill().unwrap();
    recorder.wait().unwrap();
    file
}

#[test]
fn a_recorder_that_waits_for_a_robot_records_its_run_so_that_it_can_be_read() {
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("waited.mcap");
    let mut recorder = firsthand(&["record", "--robot", "rec-waits", "--out"])
        .arg(&file)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (code, summary, _) = Run::start("rec-waits", "open-room", &["--pace", "4"]).finish_in();
    assert_eq!(code, Some(0), "{summary}");
    let mut said = BufReader::new(recorder.stdout.take().unwrap()).lines().map(Result::unwrap);
    said.find(|line| line.contains("complete")).unwrap();
    signal_process(recorder.id(), Signal::INT);
    recorder.wait().unwrap();
    assert_eq!(Recording::open(&file).unwrap().run.mission.name, "open-room");
}

#[test]
fn recorders_killed_leave_readable_files_that_say_so_and_the_mission_as_it_was() {
    let run = Run::under_way("rec-shot", "obstacle-course", &["--pace", "4"], 1.0);
    // A standing robot cannot arrive before its recorders are killed.
    operate("rec-shot", &["stop"]);
    let directory = tempfile::tempdir().unwrap();
    let mut read = 0;
    for shot in 0..6 {
        let file = directory.path().join(format!("{shot}.mcap"));
        let file = killed_recorder(&run, file, shot / 2);
        let recording = Recording::open(&file).unwrap();
        assert_ne!(recording.end, End::Complete);
        let messages = recording.messages(&[]).unwrap();
        let messages: Vec<_> = messages.map(Result::unwrap).collect();
        let counted: u64 = recording.counts.values().sum();
        assert_eq!(messages.len() as u64, counted);
        read += messages.len();
    }
    assert!(read > 0, "every recorder died before its first chunk");
    operate("rec-shot", &["resume"]);
    let (code, summary, directory) = run.finish_in();
    assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()), "{summary}");
    support::assert_no_restart(&summary);
    assert_eq!(replayed_in(&directory).equal(), 5);
    assert_nothing_left("rec-shot");
}

#[test]
fn a_disk_budget_ends_files_at_a_quarter_of_it_removes_the_oldest_and_each_can_be_read_alone() {
    // The run is long enough for eight files. The budget allows one that exceeds its share by a
    // chunk.
    let slow = "controller.speed_m_s=0.15";
    let budget = ["--pace", "4", "--disk-budget", "1500kB", "--set", slow];
    let (code, summary, directory) =
        Run::start("rec-budget", "obstacle-course", &budget).finish_in();
    assert_eq!(code, Some(0), "{summary}");
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
    assert!(grids.any(|grid| grid.header.part.is_keyframe()), "{files:?}");
    assert!(replay(&largest, &all).unwrap().not_replayed() > 0, "{files:?}");
    assert_nothing_left("rec-budget");
}

/// `.ci/renew` records the golden recording again after an intended change.
#[test]
fn the_golden_recording_replays_to_the_bit() {
    let report = replayed(&golden());
    assert_eq!(report.equal(), 5);
    assert!(report.stages["planner"].compared > 20, "{report}");
}

#[test]
fn a_golden_recording_of_obstacles_a_killed_stage_and_a_stall_replays_to_the_bit() {
    let recording = golden_of("stall-and-kill");
    let stalls = recording.samples(&topics::STALLS).unwrap().count();
    let deaths = recording.samples(&topics::DEATHS).unwrap().map(|death| death.unwrap().sample);
    let killed: Vec<_> = deaths.map(|death| name_str(&death.stage).to_owned()).collect();
    assert!(stalls > 0);
    assert_eq!(killed, ["mapper"]);
    let mut grids = recording.slices(&topics::GRID).unwrap().map(Result::unwrap);
    let sensed = |cell: &u8| *cell == CellState::Sensed as u8;
    assert!(grids.any(|grid| grid.elements.iter().any(sensed)), "obstacles");
    let report = replayed(&recording);
    let generations = |stage| report.stages[stage].equal;
    let planners = 1 + stalls as u64;
    assert_eq!((generations("mapper"), generations("planner")), (2, planners), "{report}");
    assert_eq!(report.equal(), 3 + 2 + planners);
}

#[test]
fn a_constant_that_changes_makes_a_replay_fail_with_stage_tick_topic_field_and_inputs() {
    let recording = golden();
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
fn replay_and_diff_print_what_they_found_and_exit_with_1_on_a_difference() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let replayed = output(&["replay", file, "--stage", "mapper,planner", "--json"]);
    assert_eq!(replayed.status.code(), Some(0), "{replayed:?}");
    let report: serde_json::Value = serde_json::from_slice(&replayed.stdout).unwrap();
    assert_eq!(report["stages"]["planner"]["equal"], 1, "{report}");
    assert!(report["stages"].get("controller").is_none(), "{report}");
    let same = output(&["runs", "diff", file, file]);
    assert_eq!(same.status.code(), Some(0), "{same:?}");

    let other = ["--seed", "9", "--timeout", "8"];
    let (_, _, directory) = Run::start("rec-other", "open-room", &other).finish_in();
    let other = directory.path().join("run/recording.mcap");
    let parted = output(&["runs", "diff", file, other.to_str().unwrap(), "--json"]);
    assert_eq!(parted.status.code(), Some(1), "{parted:?}");
    let (_, found) = json_of(&parted);
    assert!(!found[0]["first"].is_null(), "{found:?}");

    let no_recording = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    refused(&["replay", no_recording], "not-a-recording", &[no_recording]);
    refused(&["replay", file, "--stage", "wheel"], "unknown-stage", &["wheel"]);
}

#[test]
fn a_runs_directory_stands_for_its_recording_unless_it_holds_none_or_several() {
    let directory = tempfile::tempdir().unwrap();
    let run = directory.path().to_str().unwrap();
    let replay = || output(&["replay", run, "--stage", "mapper"]);
    assert_refused(&replay(), "no-recording", &[run]);
    let copy = |name: &str| fs::copy(&golden().path, directory.path().join(name)).unwrap();
    copy("recording.mcap");
    assert_eq!(replay().status.code(), Some(0));
    copy("recording-2.mcap");
    assert_refused(&replay(), "several-recordings", &[run, "recording-2.mcap"]);
}

use common::json_wire;
use common::wire::{
    Addressing, Command, Decoder, DecoderTally, Encoder, MotorSensors, Report, StandardSensors,
    SystemSignal,
};

use clap::ValueEnum as _;

use super::*;

const fn encoder(position: u16) -> Encoder {
    Encoder { position, speed: 300, positive: true }
}

fn tick(counts: [u16; 2]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let motor = MotorSensors { encoders: counts.map(encoder), ..MotorSensors::default() };
    let standard =
        StandardSensors { ultrasonic: [90; 6], human: [2048; 4], ..StandardSensors::default() };
    for report in
        [Report::Motor(motor), Report::Standard(standard), Report::System(SystemSignal::Ack)]
    {
        report.encode(Addressing::Numbered, &mut bytes);
    }
    bytes
}

fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// Returns the passed reports, which must all be valid.
fn reports(passed: &[Late]) -> Vec<Report> {
    let mut decoder = Decoder::default();
    let mut reports = Vec::new();
    for late in passed {
        decoder.push(&late.bytes);
        while let Some(frame) = decoder.next_frame() {
            reports.push(Report::parse(&frame).unwrap());
        }
    }
    let frames = reports.len() as u64;
    let sound = DecoderTally { frames, ..DecoderTally::default() };
    assert_eq!(decoder.tally(), sound);
    reports
}

/// Returns the host's bytes of a tick from a robot at counts (100, 200) when its fault began.
fn faulted(fault: RobotFault, counts: [u16; 2]) -> (FaultInjector, Vec<Late>) {
    let mut injector = FaultInjector::new(fault, Protocol::X80, 1);
    injector.report(&tick([100, 200]), at(1.0));
    injector.begin();
    let passed = injector.report(&tick(counts), at(1.1));
    (injector, passed)
}

fn counts(passed: &[Late]) -> Option<[u16; 2]> {
    let motor = reports(passed).into_iter().find_map(|report| match report {
        Report::Motor(motor) => Some(motor),
        _ => None,
    });
    Some(motor?.encoders.map(|encoder| encoder.position))
}

fn sonar(passed: &[Late]) -> Option<u8> {
    reports(passed).into_iter().find_map(|report| match report {
        Report::Standard(standard) => Some(standard.ultrasonic[1]),
        _ => None,
    })
}

#[test]
fn bytes_pass_unchanged_until_the_fault_begins_and_every_frame_of_a_fault_is_valid() {
    let faults = RobotFault::value_variants().iter().copied();
    for fault in faults.filter(|fault| fault.has_meaning(Protocol::X80)) {
        let mut injector = FaultInjector::new(fault, Protocol::X80, 1);
        let passed = injector.report(&tick([100, 200]), at(1.0));
        assert_eq!(passed.len(), 1, "{fault:?}");
        assert_eq!((passed[0].at, &passed[0].bytes), (at(1.0), &tick([100, 200])));
        injector.begin();
        for number in 0..50 {
            let now = at(1.1 + 0.1 * f64::from(number));
            let passed = injector.report(&tick([110, 210]), now);
            let reports = reports(&passed);
            let acknowledged = reports.contains(&Report::System(SystemSignal::Ack));
            assert_eq!(acknowledged, fault != RobotFault::Silence, "{fault:?}");
        }
    }
}

#[test]
fn the_encoders_lie_as_the_table_says() {
    use RobotFault as F;
    let told = |fault| counts(&faulted(fault, [150, 190]).1);
    assert_eq!(told(F::MotorOnes), Some([0x7fff; 2]));
    assert_eq!(told(F::MotorZeros), Some([0, 0]));
    assert_eq!(told(F::MotorRepeated), Some([100, 200]));
    assert_eq!(told(F::EncodersSwapped), Some([90, 250]));
    assert_eq!(told(F::CountsReset), Some([50, 32_758]));
    assert_eq!(told(F::RangeStuck), Some([150, 190]));
    assert_eq!([told(F::StreamsStop), told(F::Silence)], [None, None]);
    let dead = told(F::EncoderDead);
    assert!(dead == Some([100, 190]) || dead == Some([150, 200]), "{dead:?}");
    let reversed = told(F::EncoderReversed);
    assert!(reversed == Some([50, 190]) || reversed == Some([150, 210]), "{reversed:?}");
    let (mut injector, first) = faulted(F::CountsRandom, [150, 190]);
    let second = injector.report(&tick([150, 190]), at(1.2));
    assert_ne!(counts(&first), counts(&second));
}

#[test]
fn the_sonar_is_wrong_as_the_table_says() {
    let told = |fault| sonar(&faulted(fault, [150, 190]).1);
    assert_eq!(told(RobotFault::RangeInvalid), Some(0));
    assert_eq!(told(RobotFault::RangeMissing), None);
    assert_eq!(told(RobotFault::RangeStuck), Some(8));
    assert_eq!(told(RobotFault::EncoderDead), Some(90));
    assert_eq!(told(RobotFault::RangeSilent), Some(255));
    let mut injector = FaultInjector::new(RobotFault::RangeFrozen, Protocol::X80, 1);
    injector.report(&tick([100, 200]), at(1.0));
    injector.begin();
    let mut later = Vec::new();
    let heard = StandardSensors { ultrasonic: [40; 6], ..StandardSensors::default() };
    Report::Standard(heard).encode(Addressing::Numbered, &mut later);
    assert_eq!(sonar(&injector.report(&later, at(1.1))), Some(90));
}

#[test]
fn frames_are_late_old_or_rare_as_the_table_says() {
    let (_, late) = faulted(RobotFault::FramesLate, [150, 190]);
    assert_eq!(late[0].at, at(1.1) + LATE);
    let (_, late) = faulted(RobotFault::LateFromBoot, [150, 190]);
    assert!((at(1.35)..at(2.1)).contains(&late[0].at), "{late:?}");

    let mut injector = FaultInjector::new(RobotFault::OldFrames, Protocol::X80, 1);
    for number in 0..40 {
        injector.report(&tick([number, 200]), at(0.1 * f64::from(number)));
    }
    injector.begin();
    let passed = injector.report(&tick([40, 200]), at(4.0));
    assert_eq!(passed.len(), 2);
    assert_eq!(counts(&passed[..1]), Some([40, 200]));
    assert_eq!(counts(&passed[1..]), Some([10, 200]), "3 s old");
    let next = injector.report(&tick([41, 200]), at(4.1));
    assert_eq!(next.len(), 1, "the next in 2 s");

    let mut injector = FaultInjector::new(RobotFault::FramesSlow, Protocol::X80, 1);
    injector.begin();
    let came = (0..30).filter(|&number| {
        let passed = injector.report(&tick([number, 200]), at(0.1 * f64::from(number)));
        counts(&passed).is_some()
    });
    assert!((7..=9).contains(&came.count()), "3 s");
}

#[test]
fn a_robot_that_does_not_stop_keeps_its_speed_until_it_is_disabled() {
    let bytes = |command: Command| {
        let mut bytes = Vec::new();
        command.encode(Addressing::Numbered, &mut bytes);
        bytes
    };
    let go = bytes(Command::velocity([Some(-400), Some(400)], 250));
    let stop = bytes(Command::velocity([Some(0), Some(0)], 250));
    let suspend = bytes(Command::Enable { on: false, channel: None });
    let mut moved = 0;
    let mut injector = FaultInjector::new(RobotFault::DoesNotStop, Protocol::X80, 1);
    let mut heard =
        |injector: &mut FaultInjector, bytes: &[u8]| injector.order(bytes, &mut || moved += 1);
    assert_eq!(heard(&mut injector, &go), go);
    assert_eq!(heard(&mut injector, &stop), stop, "the robot stops before its fault");
    injector.begin();
    assert_eq!(heard(&mut injector, &stop), go);
    assert_eq!(heard(&mut injector, &suspend), suspend);
    assert_eq!(heard(&mut injector, &stop), stop);
    assert_eq!(moved, 1, "what the host ordered, not what the robot was told");
}

/// Returns a robot's report line, and an answer.
fn said(wheels: [f64; 2], beam: f32) -> Vec<u8> {
    let report = json_wire::Report {
        wheels: Some(wheels),
        speeds: Some([1.0, 2.0]),
        ranges: [("front".to_owned(), Some(f64::from(beam)))].into(),
        scan: Some(vec![Some(beam), None]),
        ..json_wire::Report::default()
    };
    let answer = json_wire::Report { heard: Some(1), ..json_wire::Report::default() };
    [json_wire::line(&report), json_wire::line(&answer)].concat()
}

/// Returns the host's lines from a robot whose wheels had turned by 1 and 2 rad at the fault, and
/// by 4 and 3 now.
fn lines(fault: RobotFault) -> Vec<json_wire::Report> {
    let mut injector = FaultInjector::new(fault, Protocol::Json, 1);
    let before = said([1.0, 2.0], 0.5);
    assert_eq!(injector.report(&before, at(1.0))[0].bytes, before);
    injector.begin();
    let passed = injector.report(&said([4.0, 3.0], 0.75), at(1.1));
    let bytes: Vec<u8> = passed.into_iter().flat_map(|late| late.bytes).collect();
    let lines = bytes.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    lines.filter_map(|line| json_wire::parse(line).ok()).collect()
}

#[test]
fn a_robot_that_speaks_lines_of_json_lies_as_the_table_says() {
    use RobotFault as F;
    let wheels = |fault| lines(fault)[0].wheels.unwrap().map(|angle| (angle * 1e6).round() / 1e6);
    assert_eq!(wheels(F::MotorZeros), [0.0, 0.0]);
    assert_eq!(wheels(F::EncodersSwapped), [2.0, 5.0]);
    assert_eq!(wheels(F::CountsReset), [3.0, 1.0]);
    let dead = wheels(F::EncoderDead);
    assert!(dead == [1.0, 3.0] || dead == [4.0, 2.0], "{dead:?}");
    let reversed = wheels(F::EncoderReversed);
    assert!(reversed == [-2.0, 3.0] || reversed == [4.0, 1.0], "{reversed:?}");
    let repeated: json_wire::Report =
        json_wire::parse(said([1.0, 2.0], 0.5).split(|byte| *byte == b'\n').next().unwrap())
            .unwrap();
    assert_eq!(lines(F::MotorRepeated)[0], repeated);
    for (fault, beam, rest) in [
        (F::RangeInvalid, Some(-1.0), Some(-1.0)),
        (F::RangeStuck, Some(0.3), Some(0.3)),
        (F::RangeSilent, None, None),
        (F::RangeFrozen, Some(0.5), None),
    ] {
        let line = &lines(fault)[0];
        assert_eq!(line.scan, Some(vec![beam, rest]), "{fault:?}");
        assert_eq!(line.ranges["front"].map(|range| range as f32), beam, "{fault:?}");
        assert_eq!(line.wheels, Some([4.0, 3.0]));
    }
    let missing = &lines(F::RangeMissing)[0];
    assert!(missing.scan.is_none() && missing.ranges.is_empty() && missing.wheels.is_some());
    assert!(lines(F::StreamsStop).iter().all(|line| line.heard == Some(1)));
    assert_eq!(
        [lines(F::StreamsStop).len(), lines(F::Silence).len(), lines(F::Garbage).len()],
        [1, 0, 0]
    );
}

#[test]
fn a_robot_that_speaks_lines_of_json_keeps_its_speed_until_it_brakes_or_stands_where_it_is_held() {
    use json_wire::{Order, line};
    let drive =
        |speed| line(&Order::Drive { wheels: [speed; 2], twist: [speed, 0.0], for_s: 0.25 });
    let (go, stand, brake) = (drive(2.0), drive(0.0), line(&Order::Brake {}));
    let mut keeps = FaultInjector::new(RobotFault::IgnoresZero, Protocol::Json, 1);
    assert_eq!(
        keeps.order(&[go.clone(), stand.clone()].concat(), &mut || ()),
        [go.clone(), stand.clone()].concat()
    );
    keeps.begin();
    assert_eq!(keeps.order(&stand, &mut || ()), go);
    assert_eq!(
        keeps.order(&[brake.clone(), stand.clone()].concat(), &mut || ()),
        [brake, stand.clone()].concat()
    );
    let mut held = FaultInjector::new(RobotFault::HeldWheels, Protocol::Json, 1);
    held.begin();
    assert_eq!(held.order(&go, &mut || ()), stand);
    let passed = held.report(&said([1.0, 2.0], 0.5), at(1.0));
    let held = passed[0].bytes.windows(18).any(|word| word == b"\"held\":[true,true]");
    assert!(held);
}

#[test]
fn late_readings_are_those_of_a_moment_ago_while_wheels_are_those_of_now() {
    let mut injector = FaultInjector::new(RobotFault::RangeLate, Protocol::X80, 1);
    let age_s = injector.drawn(RANGE_LATE_S);
    let said = |cm: u8, counts: u16| {
        let mut bytes = Vec::new();
        let motor = MotorSensors { encoders: [encoder(counts); 2], ..MotorSensors::default() };
        let standard =
            StandardSensors { ultrasonic: [cm; 6], human: [2048; 4], ..StandardSensors::default() };
        Report::Motor(motor).encode(Addressing::Numbered, &mut bytes);
        Report::Standard(standard).encode(Addressing::Numbered, &mut bytes);
        bytes
    };
    injector.report(&said(90, 0), at(1.0));
    injector.begin();
    let passed = injector.report(&said(80, 50), at(0.9 + age_s));
    assert_eq!((sonar(&passed), counts(&passed)), (Some(80), Some([50; 2])));
    let passed = injector.report(&said(50, 100), at(1.1 + age_s));
    assert_eq!((sonar(&passed), counts(&passed)), (Some(90), Some([100; 2])));
}

#[test]
fn readings_stay_near_are_random_or_silent_in_motion_as_their_faults_say() {
    for _ in 0..50 {
        let told = |fault| sonar(&faulted(fault, [300, 500]).1).unwrap();
        assert!((85..=95).contains(&told(RobotFault::RangeNear)));
        assert!((3..=254).contains(&told(RobotFault::RangeRandom)));
        assert_eq!(told(RobotFault::RangeDeaf), 255);
    }
}

#[test]
fn the_size_of_a_fault_is_drawn_by_the_seed_from_between_the_tables_numbers() {
    let passed = |seed| {
        let mut injector = FaultInjector::new(RobotFault::LateMidway, Protocol::X80, seed);
        injector.begin();
        injector.report(&tick([100, 200]), at(1.0))[0].at.as_secs_f64() - 1.0
    };
    let mut late_s: Vec<f64> = (0..50).map(passed).collect();
    assert_eq!(passed(7), late_s[7]);
    late_s.sort_by(f64::total_cmp);
    assert!(late_s[0] >= 0.25 && late_s[49] <= 1.0, "{late_s:?}");
    assert!(late_s[0] < 0.35 && late_s[49] > 0.9, "{late_s:?}");
    let low = |seed| {
        let mut injector = FaultInjector::new(RobotFault::EncoderLow, Protocol::Json, seed);
        injector.report(&said([0.0; 2], 0.5), at(1.0));
        injector.begin();
        let passed = injector.report(&said([1.0; 2], 0.5), at(1.1));
        let line = passed[0].bytes.split(|byte| *byte == b'\n').next().unwrap();
        let report: json_wire::Report = json_wire::parse(line).unwrap();
        let wheels = report.wheels.unwrap();
        wheels.into_iter().fold(1.0, f64::min)
    };
    assert!((0..50).all(|seed| (0.9..=0.97).contains(&low(seed))));
}

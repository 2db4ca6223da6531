use clap::ValueEnum as _;
use common::{
    json_wire::{Order, line, parse},
    mission::Protocol,
    wire::{
        Addressing, Command, Decoder, DecoderTally, Encoder, MotorSensors, Report as Frame,
        StandardSensors, SystemSignal,
    },
};

use super::*;
use Frame::*;
use RobotFault::*;

fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// Returns what an X80 says in a tick.
fn tick(counts: [u16; 2], sonar: u8) -> Vec<u8> {
    let encoder = |position| Encoder { position, speed: 300, positive: true };
    let motor = MotorSensors { encoders: counts.map(encoder), ..MotorSensors::default() };
    let ultrasonic = [sonar; 6];
    let standard = StandardSensors { ultrasonic, human: [2048; 4], ..StandardSensors::default() };
    let mut bytes = Vec::new();
    for frame in [Motor(motor), Standard(standard), System(SystemSignal::Ack)] {
        frame.encode(Addressing::Numbered, &mut bytes);
    }
    bytes
}

/// Returns the frames that passed, all of them valid.
fn frames(passed: &[Late]) -> Vec<Frame> {
    let mut decoder = Decoder::default();
    let mut all = Vec::new();
    for late in passed {
        decoder.push(&late.bytes);
        while let Some(frame) = decoder.next_frame() {
            all.push(Frame::parse(&frame).unwrap());
        }
    }
    let frames = all.len() as u64;
    assert_eq!(decoder.tally(), DecoderTally { frames, ..DecoderTally::default() });
    all
}

fn counts(passed: &[Late]) -> Option<[u16; 2]> {
    frames(passed).into_iter().find_map(|frame| match frame {
        Motor(motor) => Some(motor.encoders.map(|encoder| encoder.position)),
        _ => None,
    })
}

fn sonar(passed: &[Late]) -> Option<u8> {
    frames(passed).into_iter().find_map(|frame| match frame {
        Standard(standard) => Some(standard.ultrasonic[1]),
        _ => None,
    })
}

fn injector(protocol: Protocol, seed: u64) -> FaultInjector {
    let protocol = if protocol == Protocol::X80 { "x80" } else { "json" };
    let text = format!("target = [3, 0]\nrobot.protocol = '{protocol}'");
    FaultInjector::new(&Mission::parse(&text, "m.toml").unwrap(), seed)
}

/// Returns an injector whose robot said `before` at 1 s, unchanged, and then became faulty.
fn faulty(fault: RobotFault, protocol: Protocol, seed: u64, before: &[u8]) -> FaultInjector {
    let mut injector = injector(protocol, seed);
    let passed = injector.report(before, at(1.0));
    assert_eq!((passed[0].at, &*passed[0].bytes), (at(1.0), before));
    injector.set(Some(fault));
    injector
}

/// Returns an X80 with a fault since it had counted 100 and 200 before an echo at 90 cm.
fn x80(fault: RobotFault, seed: u64) -> FaultInjector {
    faulty(fault, Protocol::X80, seed, &tick([100, 200], 90))
}

#[test]
fn every_frame_of_a_faulty_robot_is_valid_until_its_fault_ends() {
    let all = RobotFault::value_variants().iter().copied();
    for fault in all.filter(|fault| *fault != Garbage) {
        let mut injector = x80(fault, 1);
        for number in 0..50 {
            let passed = injector.report(&tick([110, 210], 90), at(1.1 + 0.1 * f64::from(number)));
            let acknowledged = frames(&passed).contains(&System(SystemSignal::Ack));
            assert_eq!(acknowledged, fault != Silence, "{fault:?}");
        }
        injector.set(None);
        let bytes = tick([120, 220], 90);
        assert_eq!(injector.report(&bytes, at(9.0))[0].bytes, bytes, "{fault:?}");
    }
}

#[test]
fn encoders_and_sonars_lie_as_the_table_says() {
    let said = |fault| x80(fault, 1).report(&tick([150, 190], 40), at(1.1));
    for (fault, told) in [
        (MotorOnes, &[[0x7fff; 2]][..]),
        (MotorZeros, &[[0, 0]]),
        (MotorRepeated, &[[100, 200]]),
        (EncodersSwapped, &[[90, 250]]),
        (CountsReset, &[[50, 32_758]]),
        (RangeStuck, &[[150, 190]]),
        (EncoderDead, &[[100, 190], [150, 200]]),
        (EncoderReversed, &[[50, 190], [150, 210]]),
    ] {
        let counts = counts(&said(fault)).unwrap();
        assert!(told.contains(&counts), "{fault:?}: {counts:?}");
    }
    assert_eq!([StreamsStop, Silence].map(|fault| counts(&said(fault))), [None, None]);
    assert_eq!(sonar(&said(RangeMissing)), None);
    for (fault, told) in [
        (RangeInvalid, 0..=0),
        (RangeStuck, 8..=8),
        (EncoderDead, 40..=40),
        (RangeSilent, 255..=255),
        (RangeFrozen, 90..=90),
        (RangeNear, 85..=95),
        (RangeRandom, 3..=254),
        (RangeDeaf, 255..=255),
    ] {
        let sonar = sonar(&said(fault)).unwrap();
        assert!(told.contains(&sonar), "{fault:?}: {sonar}");
    }
    let mut random = x80(CountsRandom, 1);
    let [first, second] =
        [1.1, 1.2].map(|time_s| counts(&random.report(&tick([150, 190], 90), at(time_s))));
    assert_ne!(first, second);
}

#[test]
fn frames_are_late_old_or_rare_as_the_table_says() {
    let late = |fault| x80(fault, 1).report(&tick([150, 190], 90), at(1.1))[0].at;
    assert_eq!(late(FramesLate), at(1.1) + LATE);
    assert!((at(1.35)..at(2.1)).contains(&late(LateFromBoot)));

    let mut old = injector(Protocol::X80, 1);
    for number in 0..40 {
        old.report(&tick([number, 200], 90), at(0.1 * f64::from(number)));
    }
    old.set(Some(OldFrames));
    let passed = old.report(&tick([40, 200], 90), at(4.0));
    let told = [&passed[..1], &passed[1..]].map(counts);
    // One of 3 s ago, too.
    assert_eq!(told, [Some([40, 200]), Some([10, 200])]);
    // The next one comes in 2 s.
    assert_eq!(old.report(&tick([41, 200], 90), at(4.1)).len(), 1);

    let mut slow = x80(FramesSlow, 1);
    let came = (0..30).filter(|&number| {
        let passed = slow.report(&tick([number, 200], 90), at(1.1 + 0.1 * f64::from(number)));
        counts(&passed).is_some()
    });
    // In 3 s.
    assert!((7..=9).contains(&came.count()));

    let mut ranges = x80(RangeLate, 1);
    let age_s = ranges.drawn(RANGE_LATE_S);
    for (after_s, told) in [(-0.1, 80), (0.1, 90)] {
        let passed = ranges.report(&tick([150, 190], 80), at(1.0 + age_s + after_s));
        assert_eq!((counts(&passed), sonar(&passed)), (Some([150, 190]), Some(told)));
    }
}

/// Returns what a JSON robot says in a tick, and its answer to a command.
fn lines(wheels: [f64; 2], beam: f32) -> Vec<u8> {
    let report = Report {
        wheels: Some(wheels),
        speeds: Some([1.0, 2.0]),
        ranges: [("front".to_owned(), Some(f64::from(beam)))].into(),
        scan: Some(vec![Some(beam), None]),
        ..Report::default()
    };
    [line(&report), line(&Report { heard: Some(1), ..Report::default() })].concat()
}

/// Returns the reports that passed.
fn reports(passed: &[Late]) -> Vec<Report> {
    let lines = passed.iter().flat_map(|late| late.bytes.split(|byte| *byte == b'\n'));
    lines.filter_map(|line| parse(line).ok()).collect()
}

/// Returns the reports of a JSON robot with a fault since its wheels had turned by 1 and 2 rad.
fn json(fault: RobotFault, seed: u64, wheels: [f64; 2]) -> Vec<Report> {
    let mut injector = faulty(fault, Protocol::Json, seed, &lines([1.0, 2.0], 0.5));
    reports(&injector.report(&lines(wheels, 0.75), at(1.1)))
}

#[test]
fn a_json_robot_lies_as_the_table_says() {
    // In other faults of wheels and ranges it differs from an X80 only by its words.
    for (fault, wheels) in [(MotorZeros, [0.0, 0.0]), (CountsReset, [3.0, 1.0])] {
        assert_eq!(json(fault, 1, [4.0, 3.0])[0].wheels, Some(wheels), "{fault:?}");
    }
    for (fault, beam, rest) in [(RangeStuck, Some(0.3), Some(0.3)), (RangeFrozen, Some(0.5), None)]
    {
        let line = &json(fault, 1, [4.0, 3.0])[0];
        assert_eq!(line.scan, Some(vec![beam, rest]), "{fault:?}");
        assert_eq!(line.ranges["front"].map(|range| range as f32), beam, "{fault:?}");
        assert_eq!(line.wheels, Some([4.0, 3.0]), "{fault:?}");
    }
    let missing = &json(RangeMissing, 1, [4.0, 3.0])[0];
    assert!(missing.scan.is_none() && missing.ranges.is_empty() && missing.wheels.is_some());
    for (fault, answers) in [(StreamsStop, 1), (Silence, 0), (Garbage, 0)] {
        let lines = json(fault, 1, [4.0, 3.0]);
        assert_eq!(lines.len(), answers, "{fault:?}");
        assert!(lines.iter().all(|line| line.heard == Some(1)), "{fault:?}");
    }
}

#[test]
fn a_gyro_lies_as_the_table_says() {
    let gyro =
        |angle| line(&Report { wheels: Some([0.0; 2]), gyro: Some(angle), ..Report::default() });
    for (fault, told) in
        [(GyroStops, 0.0..=0.0), (GyroDrifts, 2.11..=2.21), (GyroSaturates, 0.17..=0.70)]
    {
        let mut injector = faulty(fault, Protocol::Json, 1, &gyro(0.0));
        injector.report(&gyro(0.1), at(1.1));
        let angle = reports(&injector.report(&gyro(2.1), at(2.1)))[0].gyro.unwrap();
        assert!(told.contains(&angle), "{fault:?}: {angle}");
    }
}

#[test]
fn a_robot_keeps_its_speed_until_it_is_disabled_or_stands_where_it_is_held() {
    let command = |command: Command| {
        let mut bytes = Vec::new();
        command.encode(Addressing::Numbered, &mut bytes);
        bytes
    };
    let drive =
        |speed| line(&Order::Drive { wheels: [speed; 2], twist: [speed, 0.0], for_s: 0.25 });
    let x80 = [
        command(Command::velocity([Some(-400), Some(400)], 250)),
        command(Command::velocity([Some(0); 2], 250)),
        command(Command::Enable { on: false, channel: None }),
    ];
    let mut still = Vec::new();
    Motor(MotorSensors::default()).encode(Addressing::Numbered, &mut still);
    let json = [drive(2.0), drive(0.0), line(&Order::Brake {})];
    let (wheels, speeds) = (Some([1.0; 2]), Some([0.0; 2]));
    let still_line = line(&Report { wheels, speeds, ..Report::default() });
    let [_, mut held] = [(Protocol::X80, x80, still), (Protocol::Json, json, still_line)].map(
        |(protocol, [go, stand, off], still)| {
            let mut keeps = injector(protocol, 1);
            let healthy = [&*go, &stand].concat();
            assert_eq!(keeps.order(&healthy), healthy, "{protocol:?}");
            keeps.set(Some(DoesNotStop));
            assert_eq!(keeps.order(&stand), go, "{protocol:?}");
            let mut rests = injector(protocol, 1);
            rests.order(&go);
            rests.report(&still, at(1.0));
            rests.set(Some(DoesNotStop));
            assert_eq!(rests.order(&stand), stand, "{protocol:?}");
            let disabled = [&*off, &stand].concat();
            assert_eq!(keeps.order(&disabled), disabled, "{protocol:?}");
            let mut held = injector(protocol, 1);
            held.set(Some(HeldWheels));
            assert_eq!(held.order(&go), stand, "{protocol:?}");
            held
        },
    );
    let report = &reports(&held.report(&lines([1.0, 2.0], 0.5), at(1.0)))[0];
    assert_eq!(report.held, Some([true; 2]));
}

#[test]
fn the_size_of_a_fault_is_drawn_by_the_seed_from_between_the_tables_numbers() {
    let late_s = |seed| {
        let passed = x80(LateMidway, seed).report(&tick([100, 200], 90), at(1.1));
        passed[0].at.as_secs_f64() - 1.1
    };
    let mut sizes: Vec<f64> = (0..50).map(late_s).collect();
    assert_eq!(late_s(7), sizes[7]);
    sizes.sort_by(f64::total_cmp);
    let (least, most) = (sizes[0], sizes[49]);
    assert!((0.25..0.35).contains(&least) && (0.9..1.0).contains(&most), "{sizes:?}");
    for seed in 0..50 {
        let wheels = json(EncoderLow, seed, [2.0, 3.0])[0].wheels.unwrap();
        let share = (wheels[0] - 1.0).min(wheels[1] - 2.0);
        assert!((0.9..=0.97).contains(&share), "{share}");
    }
}

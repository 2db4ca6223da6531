use common::wire::{DecoderTally, Encoder, StandardSensors, SystemSignal};

use super::*;
use crate::chaos::robot_fault::TABLE;

const fn encoder(position: u16) -> Encoder {
    Encoder { position, speed: 300, positive: true }
}

/// The bytes that a robot with these counts sends in a tick.
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

/// The reports in the bytes that were passed on. All must be valid.
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

/// The bytes for the host of a tick with `counts`, from a robot that stood at (100, 200) when its fault began.
fn faulted(fault: RobotFault, counts: [u16; 2]) -> (FaultInjector, Vec<Late>) {
    let mut injector = FaultInjector::new(fault, 1);
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
    for row in TABLE {
        let mut injector = FaultInjector::new(row.fault, 1);
        let passed = injector.report(&tick([100, 200]), at(1.0));
        assert_eq!(passed.len(), 1, "{}", row.name);
        assert_eq!((passed[0].at, &passed[0].bytes), (at(1.0), &tick([100, 200])));
        injector.begin();
        for number in 0..50 {
            let now = at(1.1 + 0.1 * f64::from(number));
            let passed = injector.report(&tick([110, 210]), now);
            // It panics if a frame is invalid.
            let reports = reports(&passed);
            let acknowledged = reports.contains(&Report::System(SystemSignal::Ack));
            assert_eq!(acknowledged, row.fault != RobotFault::Silence, "{}", row.name);
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
    assert_eq!(told(F::SonarStuck), Some([150, 190]));
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
    assert_eq!(told(RobotFault::SonarZero), Some(0));
    assert_eq!(told(RobotFault::SonarMissing), None);
    assert_eq!(told(RobotFault::SonarStuck), Some(STUCK_CM));
    assert_eq!(told(RobotFault::EncoderDead), Some(90));
    assert_eq!(told(RobotFault::SonarSilent), Some(255));
    // What the robot hears after the fault began changes nothing.
    let mut injector = FaultInjector::new(RobotFault::SonarFrozen, 1);
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
    assert_eq!(late[0].at, at(1.6));

    let mut injector = FaultInjector::new(RobotFault::OldFrames, 1);
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

    let mut injector = FaultInjector::new(RobotFault::FramesSlow, 1);
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
    let mut injector = FaultInjector::new(RobotFault::DoesNotStop, 1);
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

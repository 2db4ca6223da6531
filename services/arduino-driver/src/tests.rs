use common::samples::{RangeReading, RangeStatus};

use super::*;

/// Returns two sonars at 10 Hz: a round takes at most three polls, and a request is lost after 20.
fn mission(set: &str) -> Mission {
    let text = format!(
        "target = [3, 0]\nrobot.protocol = 'arduino'\nrobot.counts_per_turn = 1200\nrobot.rate_hz = 10\nrobot.arduino.sonars = {{ front = 4, left = 5 }}\n{set}\n\
        [[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.1\nbearing_deg = 0\n\
        [[robot.sensor]]\nname = 'left'\nkind = 'cone'\nchannel = 0\nforward_m = 0.1\nbearing_deg = 40\n"
    );
    Mission::parse(&text, "m.toml").unwrap()
}

fn driver() -> Arduino {
    let mut driver = Arduino::new(&mission(""));
    driver.asks("\rb\r");
    assert!(driver.hears(" 57600\r\n").anything);
    driver
}

const ROUND: &str = "p 4\rp 5\re\r";

impl Arduino {
    #[track_caller]
    fn asks(&mut self, request: &str) {
        assert_eq!(String::from_utf8(self.poll()).unwrap(), request);
    }

    fn hears(&mut self, bytes: &str) -> Heard {
        self.hear(bytes.as_bytes())
    }

    fn round(&mut self, answers: &str) -> Heard {
        self.asks(ROUND);
        self.hears(answers)
    }

    /// Answers a round with these counts. Returns them, and the speeds.
    fn turned(&mut self, [left, right]: [i32; 2]) -> ([u16; 2], [i32; 2]) {
        let said = self.round(&format!("1\r\n1\r\n{left} {right}\r\n"));
        let wheels = said.motion.unwrap().wheels;
        (counts(&said).unwrap(), [wheels.left_counts_per_s, wheels.right_counts_per_s])
    }
}

fn is_refused(heard: &Heard, why: &str) -> bool {
    heard.refused.as_ref().is_some_and(|refused| refused.to_string().contains(why))
}

fn says_nothing(heard: &Heard) -> bool {
    heard.motion.is_none() && heard.readings.is_empty()
}

fn counts(heard: &Heard) -> Option<[u16; 2]> {
    heard.motion.map(|motion| [motion.wheels.left_counts, motion.wheels.right_counts])
}

fn ranges(heard: &Heard) -> Vec<(u8, RangeStatus, f64)> {
    let of = |reading: &RangeReading| (reading.sensor, reading.status(), reading.range_m);
    heard.readings.iter().map(of).collect()
}

#[test]
fn a_round_gives_the_range_of_each_sonar_and_the_counts_that_begin_a_tick() {
    let mut driver = driver();
    let said = driver.round("123\r\n0\r\n-5 70\r\n");
    assert_eq!(counts(&said), Some([32_763, 70]));
    let want = [(0, RangeStatus::Measured, 1.23), (1, RangeStatus::Nothing, 0.0)];
    assert_eq!((ranges(&said), said.refused), (want.to_vec(), None));
    // Beyond its reach an echo counts as none, beyond twice that as no reading.
    let said = driver.round("300\r\n17241\r\n0 0\r\n");
    let statuses = Vec::from_iter(ranges(&said).iter().map(|range| range.1));
    assert_eq!(statuses, [RangeStatus::Nothing, RangeStatus::Invalid]);
}

#[test]
fn answers_come_in_any_pieces_and_commands_are_answered_between_them() {
    let mut driver = driver();
    driver.asks(ROUND);
    for piece in ["OK\r\n12", "3\r", "\nOK\r\n7\r\nOK\r\n1", " 2\r"] {
        assert_eq!(counts(&driver.hears(piece)), None, "{piece:?}");
    }
    let said = driver.hears("\nOK\r\n");
    assert_eq!((counts(&said), said.readings.len()), (Some([1, 2]), 2));
}

#[test]
fn after_a_line_that_does_not_fit_only_a_baud_rate_is_taken() {
    for (bad, why) in [
        // A lost answer: pin 5's stands in for pin 4's.
        ("34\r\n1 2\r\n", "\"1 2\" is an unexpected answer"),
        ("12\r\n34\r\n56\r\n1 2\r\n", "\"56\" is an unexpected answer"),
        ("Invalid Command\r\n", "garbled"),
        ("1#\r\n34\r\n1 2\r\n", "\"1#\\r\" is an unknown answer"),
        ("12\r34\r\n1 2\r\n", "is an unknown answer"),
        ("57600\r\n", "is an unexpected answer"),
    ] {
        let mut driver = driver();
        let said = driver.round(bad);
        assert!(says_nothing(&said) && is_refused(&said, why), "{bad:?}: {said:?}");
        // Late answers, and an unrequested baud rate.
        let late = driver.hears("77\r\n88\r\n9 9\r\n57600\r\n");
        assert!(says_nothing(&late), "{late:?}");
        driver.asks("\rb\r");
        let late = driver.hears("77\r\n88\r\n9 9\r\nInvalid Command\r\n");
        assert!(says_nothing(&late) && !late.anything, "{late:?}");
        assert!(driver.hears("57600\r\n").anything);
        let said = driver.round("10\r\n20\r\n3 4\r\n");
        let taken = Vec::from_iter(ranges(&said).iter().map(|range| (range.0, range.2)));
        assert_eq!((counts(&said), taken), (Some([3, 4]), vec![(0, 0.1), (1, 0.2)]));
    }
}

#[test]
fn a_round_that_is_overdue_is_dropped_and_its_late_answers_are_no_answers_of_the_next() {
    let mut driver = driver();
    driver.asks(ROUND);
    assert!(driver.hears("11\r\n").readings.is_empty());
    driver.asks("");
    driver.asks("");
    driver.asks("\rb\r");
    let late = driver.hears("22\r\n1 2\r\n");
    assert!(says_nothing(&late) && is_refused(&late, "`p 5` is overdue"), "{late:?}");
    assert!(driver.hears("57600\r\n").anything);
    assert!(driver.round("1\r\n1\r\n1 2\r\n").motion.is_some());
    // A line that nobody asked for is refused too.
    assert!(driver.hears("12\r\n").refused.is_some());
    driver.asks("\rb\r");
}

#[test]
fn a_baud_rate_is_asked_for_again_only_when_its_answer_is_lost() {
    let mut driver = Arduino::new(&mission(""));
    driver.asks("\rb\r");
    // The board boots with other text: the driver waits.
    assert!(driver.hears("booting\r\n").refused.is_some());
    for _ in 1..20 {
        driver.asks("");
    }
    driver.asks("\rb\r");
}

#[test]
fn a_wire_that_opens_again_begins_anew() {
    let mut driver = driver();
    driver.asks(ROUND);
    driver.hear(b"1\r\n2");
    driver.reset();
    driver.asks("\rb\r");
    // The least rate of a board.
    let said = driver.hears("19200\r\n");
    assert!(said.refused.is_none() && said.anything, "{said:?}");
}

#[test]
fn counts_that_wrap_at_32_bits_go_on_and_their_speeds_are_those_of_the_interval_before() {
    let mut driver = driver();
    // 10 counts per tick of 0.1 s.
    for (tick, counts, speeds) in
        [(0, 32_763, [0, 0]), (1, 5, [0, 0]), (2, 15, [100, -100]), (3, 25, [100, -100])]
    {
        let left = (i32::MAX - 4).wrapping_add(10 * tick);
        let ([left, _], by) = driver.turned([left, -10 * tick]);
        assert_eq!((left, by), (counts, speeds), "{tick}");
    }
}

#[test]
fn the_speed_across_polls_without_a_round_is_by_the_time_between() {
    let mut driver = driver();
    driver.turned([0, 0]);
    driver.asks(ROUND);
    driver.asks("");
    driver.hears("1\r\n1\r\n10 10\r\n");
    // A poll without a request precedes this round.
    driver.turned([30, 30]);
    assert_eq!(driver.turned([30, 30]).1[0], 100);
}

#[test]
fn counts_that_begin_anew_are_said_as_they_are_and_their_jump_is_no_speed() {
    let mut driver = driver();
    for counts in [20_000_u16, 20_010, 0, 5] {
        let (said, speeds) = driver.turned([counts.into(); 2]);
        assert!(said == [counts; 2] && speeds[0].abs() <= 100, "{said:?} {speeds:?}");
    }
}

#[test]
fn a_flood_of_lines_or_of_bytes_without_an_end_is_bounded_and_begins_anew() {
    let mut driver = driver();
    driver.asks(ROUND);
    let said = driver.hears(&"1\r\n".repeat(100_000));
    assert!(said.readings.is_empty() && said.refused.is_some());
    driver.asks("\rb\r");
    for _ in 0..100 {
        driver.hear(&[b'1'; 10_000]);
    }
    assert!(driver.tally().bytes_dropped > 900_000);
    driver.hears("\r\n57600\r\n");
    assert!(driver.round("1\r\n1\r\n1 1\r\n").motion.is_some());
}

#[test]
fn a_command_is_said_in_counts_of_the_speed_loop_and_the_slowest_turns_a_wheel() {
    let driver = driver();
    let limit = Duration::from_millis(250);
    for (counts, said) in [
        ([0, 0], "m 0 0\r"),
        ([600, -600], "m 20 -20\r"),
        ([44, 46], "m 1 2\r"),
        // A slow wheel beside a faster one may stand.
        ([10, 300], "m 0 10\r"),
        ([1, 0], "m 1 0\r"),
        ([-2, 2], "m -1 1\r"),
        ([14, 3], "m 1 0\r"),
        ([i16::MIN, i16::MAX], "m -1092 1092\r"),
    ] {
        assert_eq!(driver.velocity(counts, limit), said.as_bytes(), "{counts:?}");
    }
    let slow = Arduino::new(&mission("robot.arduino.pid_rate_hz = 10"));
    assert_eq!(slow.velocity([600, 30], limit), b"m 60 3\r");
}

#[test]
fn a_board_acknowledges_each_velocity_and_owes_nothing_for_what_it_is_asked() {
    let mut driver = driver();
    assert_eq!(driver.hears("OK\r\nOK\r\n").acknowledged, 2);
    assert_eq!(driver.owed(&driver.velocity([100, 100], Duration::ZERO)), 1);
    let asked = driver.poll();
    assert_eq!(driver.owed(&asked), 0);
}

#[test]
fn a_third_number_is_the_angle_of_a_gyro_which_gives_the_turn_of_each_tick() {
    let mut driver = driver();
    let body = mission("").body();
    let mut turns = Vec::new();
    for tick in 0..6 {
        let side = 0.05 * f64::from(tick) * body.track_m / body.metres_per_count();
        let said =
            driver.round(&format!("0\r\n0\r\n{} {side:.0} {}\r\n", -side as i32, 1100 * tick));
        assert_eq!(said.refused, None);
        turns.extend(driver.turn_for_tick().map(|turn| (turn.turn_rad * 1e6).round() / 1e6));
    }
    assert_eq!(turns, [0.0, 0.11, 0.11]);
}

//! Tests of a robot that sends only on request: polls, and late or missing answers.

use super::*;

const POLL_MS: u64 = 100;
const ROUND: &str = "p 4\re\r";

/// Board that answers after a delay, its link and clock.
struct Scene {
    link: Link,
    ms: u64,
    delay_ms: u64,
    answers: Vec<(u64, String)>,
    sent: Vec<(u64, String)>,
    ticks: Vec<u64>,
    turned: i32,
    speed: i32,
}

impl Scene {
    fn at(pace: Pace) -> Self {
        Self {
            link: started(&mission(ARDUINO), pace, 0),
            ms: 0,
            delay_ms: 5,
            answers: Vec::new(),
            sent: Vec::new(),
            ticks: Vec::new(),
            turned: 0,
            speed: 0,
        }
    }

    fn driving() -> Self {
        let mut scene = Self::at(Pace::Rate(1.0));
        scene.run(2000);
        assert_eq!(scene.link.decision, Decision::GO);
        assert!(scene.speed > 0);
        scene
    }

    fn now(&self) -> MissionTime {
        let State { pace, next_tick } = self.link.state;
        MissionTime(match pace {
            Pace::Max => next_tick * POLL_MS * MS,
            Pace::Rate(rate) => (self.ms as f64 * rate) as u64 * MS,
        })
    }

    fn event(&mut self, event: Event<'_>) {
        for effect in self.link.step(Entry { event, machine_ns: self.ms * MS, now: self.now() }) {
            match effect {
                Effect::Send(bytes) if !bytes.is_empty() => {
                    let said = String::from_utf8(bytes).unwrap();
                    self.answer(&said);
                    self.sent.push((self.ms, said));
                }
                Effect::Tick { tick, .. } => self.ticks.push(tick),
                _ => {}
            }
        }
    }

    fn answer(&mut self, said: &str) {
        for request in said.split_terminator('\r') {
            let turned = self.turned;
            let words = Vec::from_iter(request.split(' '));
            let answer = match words[..] {
                ["e"] => format!("{turned} {turned}\r\n"),
                // Changes as the robot drives.
                ["p", "4"] => format!("{}\r\n", 200 - turned / 100),
                ["b"] => "57600\r\n".into(),
                ["m", left, _] => {
                    self.speed = left.parse().unwrap();
                    "OK\r\n".into()
                }
                _ => "Invalid Command\r\n".into(),
            };
            self.answers.push((self.ms + self.delay_ms, answer));
        }
    }

    /// Advances the machine's clock by 5 ms steps; ticks are answered at once.
    fn run(&mut self, for_ms: u64) {
        for _ in 0..for_ms / 5 {
            self.ms += 5;
            self.turned += self.speed * 30 * 5 / 1000;
            if self.ms.is_multiple_of(200) {
                self.event(Event::Order(Order::Drive, HoldReason::None));
            }
            let ms = self.ms;
            let due = Vec::from_iter(self.answers.extract_if(.., |answer| answer.0 <= ms));
            for (_, answer) in due {
                let ticks = self.ticks.len();
                self.event(Event::Datagram(answer.as_bytes()));
                if let Some(&tick) = self.ticks.get(ticks) {
                    self.event(Event::Command(command(tick, self.now().0, [2.0; 2])));
                }
            }
            self.event(Event::Quiet);
        }
    }

    fn rounds(&self) -> Vec<u64> {
        let rounds = self.sent.iter().filter(|(_, said)| said == ROUND);
        rounds.map(|(at, _)| *at).collect()
    }
}

#[test]
fn a_robot_is_polled_at_its_rate_of_mission_time_and_each_answer_begins_a_tick() {
    let mut scene = Scene::at(Pace::Rate(4.0));
    scene.run(200);
    (scene.sent, scene.ticks) = (Vec::new(), Vec::new());
    scene.run(POLL_MS / 4 * 20);
    let rounds = scene.rounds();
    assert!((19..=20).contains(&rounds.len()), "{rounds:?}");
    // The test's step is 5 ms.
    assert!(rounds.windows(2).all(|two| (two[1] - two[0]).abs_diff(25) <= 5), "{rounds:?}");
    assert!(scene.ticks.len().abs_diff(rounds.len()) <= 1, "{:?}", scene.ticks);
}

#[test]
fn a_poll_that_is_late_does_not_delay_the_next_and_none_is_made_up_for() {
    let mut scene = Scene::at(Pace::Rate(1.0));
    scene.run(310);
    scene.sent = Vec::new();
    // The link's process is not scheduled for a while; polls are due each 100 ms.
    scene.ms = 455;
    scene.run(255);
    assert_eq!(scene.rounds(), [460, 500, 600, 700]);
    scene.ms = 1155;
    scene.run(205);
    assert_eq!(scene.rounds()[4..], [1160, 1260, 1360]);
}

#[test]
fn a_closed_wire_is_not_polled_and_an_open_one_is_asked_for_its_baud_rate_first() {
    let mut scene = Scene::driving();
    scene.event(Event::Wire(false));
    scene.sent = Vec::new();
    scene.run(500);
    assert!(scene.rounds().is_empty());
    scene.event(Event::Wire(true));
    scene.run(200);
    let asked = Vec::from_iter(scene.sent.iter().filter(|(_, said)| !said.starts_with('m')));
    assert_eq!((&*asked[0].1, &*asked[1].1), ("\rb\r", ROUND), "{asked:?}");
}

#[test]
fn answers_later_than_a_command_lasts_begin_no_tick_and_the_robot_stands() {
    let mut scene = Scene::driving();
    scene.delay_ms = 400;
    scene.run(1000);
    scene.ticks = Vec::new();
    scene.run(2000);
    assert!(scene.ticks.is_empty() && scene.speed == 0 && scene.link.decision.stops());
}

#[test]
fn in_lockstep_each_command_and_ping_is_followed_by_one_poll_and_one_tick() {
    let mut scene = Scene::at(Pace::Max);
    scene.event(Event::Order(Order::Drive, HoldReason::None));
    scene.run(300);
    let commands = scene.sent.iter().filter(|(_, said)| said.starts_with('m')).count();
    assert!(commands >= 20, "{:?}", scene.sent);
    assert_eq!(scene.ticks, Vec::from_iter(0..scene.ticks.len() as u64));
    assert!(scene.rounds().len().abs_diff(scene.ticks.len()) <= 1, "{:?}", scene.sent);
    assert_eq!(scene.link.tally.repeated_ticks, 0);
}

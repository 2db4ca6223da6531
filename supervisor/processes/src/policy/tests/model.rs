//! Random and all short event sequences, compared with a model of the rules.

use std::{collections::HashSet, iter};

use rand_pcg::{Pcg64, rand_core::Rng as _};

use super::*;

/// Process, with a state independent of the policy's phases, and its policy.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Model {
    policy: Policy,
    now: Now,
    generation: Option<Generation>,
    wanted: bool,
    /// Whether the stage is held until a start request.
    held: bool,
    /// Times of deaths. `row` counts those without a stable generation, `wait` is the last pause.
    deaths: Vec<Now>,
    row: usize,
    wait: Duration,
    blocked_starts: u32,
}

#[derive(Clone, Default, PartialEq, Eq, Hash)]
struct Generation {
    ready: Option<Now>,
    /// Last sign of life, including the start.
    sign: Now,
    /// Whether the process was asked to stop.
    stopping: bool,
    aborted: bool,
    kill: Option<Now>,
}

/// Activities since the last sign of life.
const SLEPT: Activity = Activity { ran: ms(0), starved: ms(0), state: State::Asleep };
const RAN: Activity = Activity { ran: ms(3000), state: State::Ready, ..SLEPT };
const STOPPED: Activity = Activity { state: State::Stopped, ..SLEPT };
const STARVED: Activity = Activity { starved: Duration::MAX, state: State::Ready, ..SLEPT };
const STARVED_THEN_WAITED: Activity = Activity { state: State::Asleep, ..STARVED };

impl Generation {
    const fn deadline(&self) -> Duration {
        if self.ready.is_some() { ms(750) } else { ms(3000) }
    }
}

const EVENTS: [Event; 14] = [
    Start,
    StartFailed,
    BeatReady,
    OutputStale,
    Exited,
    Refused,
    Replace,
    Stop,
    Time(None),
    Time(Some(RAN)),
    Time(Some(SLEPT)),
    Time(Some(STOPPED)),
    Time(Some(STARVED)),
    Time(Some(STARVED_THEN_WAITED)),
];

impl Model {
    fn new() -> Self {
        Self {
            policy: Policy::new(TABLE[0].deadlines),
            now: ms(0),
            generation: None,
            wanted: false,
            held: false,
            deaths: Vec::new(),
            row: 0,
            wait: ms(0),
            blocked_starts: 0,
        }
    }

    fn can(&self, event: Event) -> bool {
        match event {
            Start => self.generation.is_none(),
            // A start fails at once.
            StartFailed => self.generation.as_ref().is_some_and(|generation| {
                generation.sign == self.now && generation.ready.is_none() && !generation.stopping
            }),
            BeatReady | OutputStale | Exited | Refused => self.generation.is_some(),
            Replace | Stop | Time(_) => true,
        }
    }

    fn due(&self) -> Option<Now> {
        match &self.generation {
            Some(generation) => {
                Some(generation.kill.unwrap_or(generation.sign + generation.deadline()))
            }
            None if self.wanted && !self.held => {
                Some(self.deaths.last().copied().unwrap_or_default() + self.wait)
            }
            None => None,
        }
    }

    /// Returns the abort time of a sleeping process by the rules alone.
    fn blocked(&self) -> Option<Now> {
        let generation = self.generation.as_ref()?;
        Some(generation.sign + generation.deadline() * 4)
    }

    fn expect(&mut self, event: Event) -> Option<Action> {
        let now = self.now;
        let due = self.due().is_some_and(|due| now >= due);
        let blocked = self.blocked().is_some_and(|blocked| now >= blocked);
        let Some(generation) = &mut self.generation else {
            let starts = match event {
                Start if !self.held => true,
                Start | Replace if self.wanted => {
                    (self.row, self.blocked_starts) = (0, 0);
                    self.deaths.clear();
                    true
                }
                Time(_) => self.wanted && !self.held && due,
                _ => false,
            };
            if event == Stop {
                (self.wanted, self.held) = (false, false);
            }
            return starts.then(|| self.begin());
        };
        match event {
            BeatReady if generation.kill.is_none() => {
                generation.ready.get_or_insert(now);
                generation.sign = now;
                self.blocked_starts = 0;
                None
            }
            Time(_) if due && generation.kill.is_some() => {
                generation.kill = Some(now + ms(100));
                Some(Action::Kill)
            }
            Time(Some(STARVED | STARVED_THEN_WAITED)) => None,
            Time(Some(SLEPT)) if !blocked => None,
            Time(_) if due => self.abort(),
            OutputStale if generation.kill.is_none() && generation.ready.is_some() => {
                generation.sign = now;
                self.abort()
            }
            Replace if self.wanted && !generation.stopping => {
                generation.stopping = true;
                let running = generation.kill.is_none();
                generation.kill.get_or_insert(now + ms(300));
                running.then_some(Action::Terminate)
            }
            Stop if self.wanted => {
                (generation.stopping, generation.kill) = (true, Some(now + ms(300)));
                self.wanted = false;
                Some(Action::Terminate)
            }
            StartFailed => self.death(true, false),
            Exited => {
                let blocked = generation.aborted && generation.ready.is_none();
                self.death(false, blocked)
            }
            Refused => {
                let blocked = generation.ready.is_none();
                self.death(false, blocked)
            }
            _ => None,
        }
    }

    fn begin(&mut self) -> Action {
        (self.wanted, self.held) = (true, false);
        self.generation = Some(Generation { sign: self.now, ..Generation::default() });
        Action::Start
    }

    fn abort(&mut self) -> Option<Action> {
        let generation = self.generation.as_mut().unwrap();
        (generation.aborted, generation.kill) = (true, Some(self.now + ms(100)));
        Some(Action::Abort)
    }

    fn death(&mut self, start_failed: bool, blocked: bool) -> Option<Action> {
        let now = self.now;
        let generation = self.generation.take().unwrap();
        if generation.stopping {
            return self.wanted.then(|| self.begin());
        }
        let until = if generation.aborted { generation.sign } else { now };
        if generation.ready.is_some_and(|since| until - since >= ms(500)) {
            self.row = 0;
        }
        self.row += 1;
        if start_failed {
            self.row = self.row.max(2);
        }
        self.deaths.retain(|then| now - *then < ms(10_000));
        self.deaths.push(now);
        self.blocked_starts += u32::from(blocked);
        if self.deaths.len() >= 12 || self.row >= 12 {
            self.held = true;
            return None;
        }
        let waits = [0, 0, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000];
        self.wait = ms(waits[self.row.min(11)]);
        if blocked && self.blocked_starts == 2 {
            return Some(Action::RecreateBus);
        }
        self.wait.is_zero().then(|| self.begin())
    }

    /// Applies `event` to model and policy, and compares.
    fn step(&mut self, event: Event) {
        let expected = self.expect(event);
        let action = self.policy.step(event, self.now);
        let (phase, now) = (self.policy.phase(), self.now);
        assert_eq!(action, expected, "{event:?} at {now:?}, now {phase:?}");
        assert_eq!(self.policy.deadline(), self.due(), "{event:?}: {phase:?}");
        let no_process = matches!(phase, Phase::Down | Phase::Held | Phase::BackingOff { .. });
        let none = self.generation.is_none();
        assert_eq!(
            [phase == Phase::Held, phase == Phase::Down, no_process],
            [self.held, none && !self.wanted, none],
            "{event:?}: {phase:?}"
        );
    }

    /// Returns pauses to and around the due times, and a very long one.
    fn moments(&self) -> Vec<Duration> {
        let mut pauses = vec![ms(0), ms(20), ms(11_000)];
        for then in [self.due(), self.blocked()].into_iter().flatten() {
            let left = then.saturating_sub(self.now);
            pauses.extend([left.saturating_sub(ms(1)), left]);
        }
        pauses
    }

    /// Returns this model with its clock set back, to compare models of equal ages.
    fn at_zero(&self) -> Self {
        // A common origin keeps past times in the past.
        const ORIGIN: Duration = Duration::from_secs(100);
        let back = |then: &mut Now| *then = (*then + ORIGIN).saturating_sub(self.now);
        let mut same = self.clone();
        same.deaths.retain(|then| self.now - *then < ms(10_000) || self.wanted);
        same.deaths.iter_mut().for_each(back);
        same.policy.recent.iter_mut().for_each(back);
        match &mut same.policy.phase {
            Phase::Down | Phase::Held => {}
            Phase::BackingOff { until: then }
            | Phase::Starting { since: then }
            | Phase::Aborted { kill: then, .. }
            | Phase::Replaced { kill: then }
            | Phase::Stopping { kill: then } => back(then),
            Phase::Running { since, beat } => {
                back(since);
                back(beat);
            }
        }
        if let Some(generation) = &mut same.generation {
            back(&mut generation.sign);
            generation.ready.iter_mut().for_each(back);
            generation.kill.iter_mut().for_each(back);
        }
        same.now = ORIGIN;
        same
    }
}

#[test]
fn every_short_history_keeps_every_rule() {
    let mut seen = HashSet::new();
    let mut newest = vec![Model::new().at_zero()];
    for _ in 0..6 {
        let mut next = Vec::new();
        for model in newest {
            for pause in model.moments() {
                for event in EVENTS {
                    let mut model = model.clone();
                    model.now += pause;
                    if model.can(event) {
                        model.step(event);
                        let model = model.at_zero();
                        if seen.insert(model.clone()) {
                            next.push(model);
                        }
                    }
                }
            }
        }
        newest = next;
    }
}

#[test]
fn two_million_steps_of_long_histories_keep_every_rule() {
    let mut chance = Pcg64::new(5, 5);
    let mut phases = HashSet::new();
    let mut actions = 0_u64;
    for history in 0..2_000 {
        let mut model = Model::new();
        // Each history has its own event probabilities.
        let choices: Vec<_> = EVENTS
            .into_iter()
            .flat_map(|event| iter::repeat_n(event, chance.next_u64() as usize % 100))
            .collect();
        for _ in 0..1_000 {
            let moments = model.moments();
            let pause = moments[chance.next_u64() as usize % moments.len()];
            // Short pauses are more frequent, because a long one makes earlier events irrelevant.
            if pause < ms(5_000) || chance.next_u64().is_multiple_of(50) {
                model.now += pause;
            }
            let event = choices[chance.next_u64() as usize % choices.len()];
            if model.can(event) {
                model.step(event);
                actions += 1;
                phases.insert(std::mem::discriminant(&model.policy.phase()));
            }
            assert!(model.policy.recent_deaths() <= 12, "history {history}");
        }
    }
    assert_eq!(phases.len(), 8);
    assert!(actions > 1_000_000, "{actions}");
}

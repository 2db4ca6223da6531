//! The data of the screen.

use std::collections::VecDeque;

use common::{domain::RobotName, process_usage::Usage, samples::name_str};
use robot_state::{Event, RobotState, Sample};

const MOST_EVENTS: usize = 50;

#[derive(Debug)]
pub(super) struct View {
    pub(super) robot: RobotName,
    /// Whether a run of the robot goes on.
    pub(super) connected: bool,
    pub(super) state: RobotState,
    /// The usage of each stage's process, and of the supervisor's behind them; empty before it was looked at.
    pub(super) usage: Vec<Usage>,
    /// Samples a second on the first output of each stage; none before they were counted.
    pub(super) rates_hz: Vec<Option<f64>>,
    /// The row of the stage that the keys concern.
    pub(super) chosen: usize,
    /// Deaths and stalls, the newest first. What the failsafe does has a line of its own.
    pub(super) events: VecDeque<Event>,
    /// The result of the last key.
    pub(super) message: String,
}

impl View {
    /// The view before `robot` was seen.
    pub(super) fn new(robot: RobotName) -> Self {
        Self {
            robot,
            connected: false,
            state: RobotState::default(),
            usage: Vec::new(),
            rates_hz: Vec::new(),
            chosen: 0,
            events: VecDeque::new(),
            message: String::new(),
        }
    }

    /// Note that a run of the robot began, and drop the data of the last run.
    pub(super) fn on_connected(&mut self) {
        let chosen = self.chosen;
        *self = Self::new(self.robot.clone());
        (self.connected, self.chosen) = (true, chosen);
    }

    /// The name of the chosen stage; none before the first roster.
    pub(super) fn chosen_stage(&self) -> Option<&str> {
        let stage = self.state.stages.get(self.chosen);
        stage.map(|entry| name_str(&entry.stage))
    }

    pub(super) fn choose(&mut self, down: isize) {
        let last = self.state.stages.len().saturating_sub(1);
        self.chosen = self.chosen.saturating_add_signed(down).min(last);
    }

    pub(super) fn processes(&self) -> Vec<u32> {
        let supervisor = self.state.supervisor.map_or(0, |header| header.supervisor_pid);
        self.state.stages.iter().map(|entry| entry.pid).chain([supervisor]).collect()
    }

    pub(super) fn apply(&mut self, sample: &Sample) {
        self.state.apply(sample);
        if let Sample::Roster(..) = sample {
            self.choose(0);
        }
        for event in self.state.take_events() {
            if event.is_recovery() {
                self.events.push_front(event);
            }
        }
        self.events.truncate(MOST_EVENTS);
    }
}

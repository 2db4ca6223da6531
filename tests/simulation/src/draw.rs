//! Draws what disturbs a run.

use std::time::Duration;

use clap::ValueEnum as _;
use common::mission::Mission;
use processes::stages;

use crate::{
    disturbance::{
        Disturbance,
        Request::{self, *},
        What::*,
    },
    load::Load,
    random::Random,
    robot_fault::RobotFault,
    wire::{Quality, Way},
};

/// Most disturbances of one run.
const MOST: usize = 8;
/// Time in which they begin.
const WITHIN: Duration = Duration::from_secs(14);

/// Greatest mean delay of a wire. A command that is under way for seconds moves a robot that was
/// already seen at rest, which nobody can promise to prevent.
const LONGEST_DELAY: Duration = Duration::from_millis(200);
/// Share of robots that stay, and what is asked of each.
const STAYS: f64 = 0.1;
const ASKED: usize = 2;
/// Time at which an operator resumes whatever stands.
const RESUMED: Duration = Duration::from_secs(50);

/// Draws a time up to 3 s, seldom up to 30 s.
pub fn a_while(random: &mut Random, least_s: f64) -> Duration {
    let longest_s = if random.chance(0.2) { 30.0 } else { 3.0 };
    Duration::from_secs_f64(random.within(least_s, longest_s))
}

pub fn load(random: &mut Random) -> Load {
    let loads = [Load::IDLE, Load::IDLE, Load::BUSY, Load::OVERLOADED, Load::STARVED];
    loads[random.below(loads.len())]
}

/// Draws how the robot takes commands: some keep the last one when none follows. Some robots stay.
pub fn robot(random: &mut Random, mission: &mut Mission) {
    mission.simulation.ignores_time |= random.chance(0.3);
    mission.stay |= random.chance(STAYS);
}

/// Draws what an operator asks of a robot that stays and waits.
pub fn while_waiting(random: &mut Random, mission: &Mission) -> Vec<Request> {
    let asked = if mission.stay { ASKED } else { 0 };
    let ask = |_| match random.below(3) {
        0 => Hand([random.within(-1.0, 1.0), random.within(-1.0, 1.0)]),
        _ => Goto(on_the_way(random, mission)),
    };
    (0..asked).map(ask).collect()
}

fn on_the_way(random: &mut Random, Mission { target, .. }: &Mission) -> [f64; 2] {
    [target.x * random.share(), target.y * random.share()]
}

pub fn disturbances(random: &mut Random, mission: &Mission) -> Vec<Disturbance> {
    let mut all = Vec::new();
    for _ in 0..random.below(MOST + 1) {
        let at = WITHIN.mul_f64(random.share());
        one(random, mission, at, &mut all);
    }
    // A robot that an operator has stopped, or that does not obey, would wait for ever.
    all.push(Disturbance { at: RESUMED, what: Fault(None) });
    all.push(Disturbance { at: RESUMED, what: Ask(Resume) });
    all
}

fn one(random: &mut Random, mission: &Mission, at: Duration, all: &mut Vec<Disturbance>) {
    let stage = stages::TABLE[random.below(stages::TABLE.len())].name;
    let operations = random.below(200) as u32;
    let lasts = a_while(random, 0.05);
    let now = Duration::ZERO;
    let mut add = |after: Duration, what| all.push(Disturbance { at: at + after, what });
    match random.below(15) {
        0..=2 => add(now, Kill(stage)),
        3..=4 => add(now, KillAfter(stage, operations)),
        5 => {
            // The whole machine may stand still.
            let is_frozen = |it: &str| it == stage || operations < 80;
            for stage in stages::TABLE.iter().map(|stage| stage.name).filter(|it| is_frozen(it)) {
                add(now, Freeze(stage));
                add(lasts, Thaw(stage));
            }
        }
        6 => add(now, Hang(stage)),
        7 => add(now, KillSupervisor(operations)),
        8..=9 => {
            let mut share = || match random.below(4) {
                0..=1 => 0.0,
                2 => random.within(0.0, 1.0),
                _ => 1.0,
            };
            let (lost, doubled, reordered) = (share(), share(), share());
            let delay = LONGEST_DELAY.mul_f64(share());
            let way = if share() > 0.0 { Way::ToRobot } else { Way::ToHost };
            add(now, Wire(way, Quality { lost, doubled, reordered, delay }));
            add(lasts, Wire(way, Quality::default()));
        }
        10 => {
            add(now, Ask(Stop));
            if random.chance(0.5) {
                add(lasts / 2, Ask(Place));
            }
            add(lasts, Ask(Resume));
        }
        11..=12 => {
            let faults = RobotFault::value_variants().iter().copied();
            let faults: Vec<_> = faults.filter(|fault| fault.has_meaning(mission)).collect();
            if let Some(fault) = faults.get(random.below(faults.len())) {
                add(now, Fault(Some(*fault)));
                add(lasts, Fault(None));
            }
        }
        13 => {
            let place = on_the_way(random, mission);
            add(now, Ask(AddZone(place)));
            add(lasts, Ask(RemoveZone(place)));
        }
        _ => {
            let place = on_the_way(random, mission);
            let requests = [Goto(place), Append(place), Restart(stage)];
            add(now, Ask(requests[random.below(requests.len())]));
        }
    }
}

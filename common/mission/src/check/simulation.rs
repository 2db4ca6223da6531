use super::{Checker, MAX_TIMEOUT_S, Result, all_within, point, refuse_if, within};
use crate::simulation::{Block, Person, Ranger, Shove, Simulation, Thing};

/// Limits that catch mistakes in a file.
const MAX_THINGS: usize = 1000;
const MAX_PEOPLE: usize = 100;
const MAX_BLOCKS: usize = 100;
const MAX_MOVES: usize = 1000;

impl Checker {
    pub(super) fn simulation(&mut self, simulation: &Simulation) -> Result {
        for (key, value, range) in simulation.ranges() {
            let problem = format!("{value} is out of range");
            let remedy = format!("give {} to {}", range.start(), range.end());
            refuse_if(!range.contains(&value), key, problem, remedy)?;
        }
        let silence = simulation.stops_when_silent_s.unwrap_or(1.0);
        within("simulation.stops_when_silent_s", silence, 0.01..=3600.0, "s")?;
        simulation.ring.iter().try_for_each(ranger)?;
        at_most("simulation.thing", simulation.things.len(), MAX_THINGS, "things come and go")?;
        for thing in &simulation.things {
            self.thing(thing)?;
        }
        at_most("simulation.person", simulation.people.len(), MAX_PEOPLE, "people walk")?;
        simulation.people.iter().try_for_each(person)?;
        if let Some(name) = &simulation.other {
            let allowed = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-');
            let is_name = (1..=16).contains(&name.len()) && name.bytes().all(allowed);
            let problem = format!("{name:?} cannot name a robot");
            refuse_if(
                !is_name,
                "simulation.other",
                problem,
                "use 1 to 16 characters of a-z, 0-9 and '-'",
            )?;
        }
        at_most("simulation.hole", simulation.holes.len(), MAX_THINGS, "holes")?;
        for hole in &simulation.holes {
            point("simulation.hole", hole.at)?;
            point("simulation.hole", hole.size_m)?;
        }
        at_most("simulation.block", simulation.blocks.len(), MAX_BLOCKS, "blocks of wheels")?;
        simulation.blocks.iter().try_for_each(block)?;
        at_most("simulation.shove", simulation.shoves.len(), MAX_BLOCKS, "shoves")?;
        simulation.shoves.iter().try_for_each(shove)
    }

    fn thing(&mut self, thing: &Thing) -> Result {
        const KEY: &str = "simulation.thing";
        self.shapes(KEY, &thing.shape)?;
        span(KEY, thing.from_s, thing.until_s)?;
        at_most(KEY, thing.moves.len(), MAX_MOVES, "moves of one thing")?;
        let mut earliest = 0.0;
        for station in &thing.moves {
            within(KEY, station.at_s, earliest..=MAX_TIMEOUT_S, "s of at_s (ascending)")?;
            point(KEY, station.by)?;
            earliest = station.at_s;
        }
        Ok(())
    }
}

fn at_most(key: &'static str, count: usize, most: usize, what: &str) -> Result {
    refuse_if(count > most, key, format!("more than {most} {what}"), "give fewer")
}

fn person(person: &Person) -> Result {
    const KEY: &str = "simulation.person";
    let problem = format!("{} goals of one person", person.goals.len());
    let are_some = (1..=MAX_MOVES).contains(&person.goals.len());
    refuse_if(!are_some, KEY, problem, format!("give 1 to {MAX_MOVES}"))?;
    point(KEY, person.at)?;
    person.goals.iter().try_for_each(|goal| point(KEY, *goal))?;
    all_within([
        (KEY, person.speed_m_s, 0.05..=5.0, "m/s of speed_m_s"),
        (KEY, person.radius_m, 0.05..=1.0, "m of radius_m"),
    ])
}

fn span(key: &'static str, from_s: f64, until_s: Option<f64>) -> Result {
    all_within([
        (key, from_s, 0.0..=MAX_TIMEOUT_S, "s"),
        (key, until_s.unwrap_or(from_s), from_s..=MAX_TIMEOUT_S, "s of until_s"),
    ])
}

fn block(block: &Block) -> Result {
    span("simulation.block", block.from_s, block.until_s)
}

fn shove(shove: &Shove) -> Result {
    const KEY: &str = "simulation.shove";
    span(KEY, shove.from_s, shove.until_s)?;
    point(KEY, shove.velocity_m_s)?;
    all_within([
        (KEY, shove.slip, 0.0..=1.0, "as the share of slip"),
        (KEY, shove.turn_deg_s, -720.0..=720.0, "degrees/s"),
    ])
}

fn ranger(ranger: &Ranger) -> Result {
    const KEY: &str = "simulation.ring";
    all_within([
        (KEY, f64::from(ranger.index), 0.0..=5.0, "as the index"),
        (KEY, ranger.forward_m, -5.0..=5.0, "m of forward_m"),
        (KEY, ranger.bearing_deg, -180.0..=180.0, "degrees"),
    ])
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_refused, mission, read_back};

    #[test]
    fn a_written_key_overrides_its_preset_and_leaves_the_others() {
        let measured = "[simulation]\nrealism = 'measured'\n[simulation.sonar]\nnoise_m = 0.02\n[simulation.wheels]\ngain = 1";
        let physics = read_back(measured).simulation.physics();
        assert_eq!((physics.sonar.noise_m, physics.sonar.wall_limit_deg), (0.02, 22.5));
        assert_eq!((physics.wheels.gain, physics.wheels.lag_s), (1.0, 0.08));
        let sonar = mission("").simulation.physics().sonar;
        assert_eq!((sonar.cone_deg, sonar.noise_m, sonar.noise_per_m), (15.0, 0.01, 0.005));
    }

    #[test]
    fn every_refusal_names_line_and_key() {
        assert_refused([
            ("[simulation.sonar]\ncone_deg = 80", "m.toml:3: simulation.sonar.cone_deg: "),
            ("[simulation.wheels]\nlag_s = nan", "m.toml:3: simulation.wheels.lag_s: "),
            ("[simulation.radio]\noutage_share = 1", "m.toml:3: simulation.radio.outage_share: "),
            ("[simulation.sonar]\ncone = 8", "m.toml:3: unknown field `cone`"),
            ("[simulation]\nstops_when_silent_s = 0", "m.toml:3: simulation.stops_when_silent_s: "),
            (
                "[[simulation.thing]]\nfrom_s = 3\nuntil_s = 2\nshape = {}",
                "m.toml:2: simulation.thing: 2 s of until_s is out of range",
            ),
            (
                "[[simulation.thing]]\nshape = {}\nmoves = [{ at_s = 4, by = [0, 0] }, { at_s = 3, by = [1, 0] }]",
                "m.toml:2: simulation.thing: 3 s of at_s",
            ),
            (
                "[[simulation.thing]]\nshape.drum = [{ at = [nan, 0], radius_m = 1 }]",
                "m.toml:2: simulation.thing: ",
            ),
            (
                "[[simulation.thing]]\nshape.drum = [{ at = [2, 0], radius_m = 1, bottom_m = 0.3, top_m = 0.2 }]",
                "m.toml:2: simulation.thing: top_m = 0.2 is not above bottom_m = 0.3",
            ),
            (
                "[[simulation.shove]]\nslip = 1.5",
                "m.toml:2: simulation.shove: 1.5 as the share of slip is out of range",
            ),
            (
                "[[simulation.person]]\nat = [1, 0]\ngoals = []",
                "m.toml:2: simulation.person: 0 goals of one person",
            ),
            (
                "[[simulation.person]]\nat = [1, 0]\ngoals = [[1, 0]]\nspeed_m_s = nan",
                "m.toml:2: simulation.person: NaN m/s of speed_m_s",
            ),
            ("[simulation]\nother = '../b'", "m.toml:3: simulation.other: "),
            (
                "[[simulation.block]]\nwheels = 'left'\nfrom_s = 3\nuntil_s = 2",
                "m.toml:2: simulation.block: 2 s of until_s is out of range",
            ),
            (
                "[[world.wall]]\npoints = [[2, 0], [2, 1]]\necho = 2",
                "m.toml:2: world: 2 as echo is out of range",
            ),
            (
                "[[simulation.ring]]\nindex = 6\nforward_m = 0\nbearing_deg = 0",
                "m.toml:2: simulation.ring: ",
            ),
        ]);
    }
}

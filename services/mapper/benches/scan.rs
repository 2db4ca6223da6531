//! Time per laser scan, matched with a reference and mapped: `cargo bench -p mapper`.
#![allow(clippy::print_stdout, reason = "the result of a benchmark")]

use std::{path::Path, time::Instant};

use common::{
    clock::MissionTime,
    mission::{Mission, MissionError},
    samples::{PoseSample, Stamp},
};
use mapper::step::{Input, Mapper, Scan, Tick};

/// A Jackal with a UST-10LX on 12 m by 12 m in cells of 5 cm.
const MISSION: &str = "target = [4, 0]\nrobot.model = 'jackal'\nrobot.rate_hz = 20\nperimeter = { width_m = 12.0, cells = 240 }";
const SCANS: u64 = 2000;
/// Half the side of the room.
const ROOM_M: f64 = 5.0;

fn main() -> Result<(), MissionError> {
    let mut mapper = Mapper::new(&Mission::parse(MISSION, Path::new("bench.toml"))?);
    let mut times: Vec<f64> = (0..SCANS)
        .map(|tick| {
            let x_m = 0.5 * (tick as f64 * 0.004).sin();
            let stamp = Stamp { tick, ..Stamp::default() };
            let pose = PoseSample { stamp, x_m, ..PoseSample::default() };
            let scans = vec![Scan { beams: scan(x_m, tick), ..Scan::default() }];
            let input = Input::Tick(Tick { pose, scans, ..Tick::default() });
            let began = Instant::now();
            mapper.step(input, MissionTime(tick * 50_000_000));
            began.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let share = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!(
        "a scan of 1081 beams in cells of 5 cm: p50 {:.0} us, p99 {:.0} us",
        share(0.5),
        share(0.99)
    );
    Ok(())
}

/// Returns the scan of a robot at (x, 0) in a square room with four posts, with 2 cm noise.
fn scan(x_m: f64, tick: u64) -> Vec<f32> {
    let beam = |beam: u64| {
        let (sin, cos) = (-135.0 + 0.25 * beam as f64).to_radians().sin_cos();
        let wall = ((ROOM_M * cos.signum() - x_m) / cos).min(ROOM_M / sin.abs());
        let posts =
            [(2.0, 1.0), (2.0, -1.2), (-2.0, 2.0), (3.5, 0.4)].into_iter().filter_map(|(x, y)| {
                let (ahead, aside) = ((x - x_m) * cos + y * sin, y * cos - (x - x_m) * sin);
                (ahead > 0.0 && aside.abs() < 0.075).then_some(ahead)
            });
        let noise = (beam * 7919 + tick * 104_729) % 1000;
        (posts.fold(wall, f64::min) + 0.07 * (noise as f64 / 1000.0 - 0.5)) as f32
    };
    (0..1081).map(beam).collect()
}

//! Measures the speed of the simulated robot: `cargo run --release -p x80-sim --example pace`
#![allow(clippy::print_stdout, clippy::expect_used, reason = "its one purpose is to print")]

use std::{fmt::Write, path::Path, time::Instant};

use common::{
    mission::Mission,
    wire::{Addressing, Command, Decoder},
};
use x80_sim::robot::Robot;

fn main() {
    println!("| things | realism | mission seconds a second |");
    println!("|---|---|---|");
    for drums in [10, 100, 1000] {
        for realism in ["laboratory", "measured"] {
            let mission = mission(drums, realism);
            println!("| {drums} drums | {realism} | {:.0} |", pace(&mission));
        }
    }
}

/// A robot that turns on the spot among `drums` drums.
fn mission(drums: u32, realism: &str) -> Mission {
    let mut text = format!("target = [1, 0]\n[simulation]\nrealism = '{realism}'\n");
    for number in 0..drums {
        let angle = f64::from(number) * 2.4;
        let (sin, cos) = angle.sin_cos();
        let range = 1.5 + f64::from(number % 40) / 10.0;
        let (x, y) = (range * cos, range * sin);
        writeln!(text, "[[world.drum]]\nat = [{x}, {y}]\nradius_m = 0.1").expect("a string");
    }
    Mission::parse(&text, Path::new("pace")).expect("a mission")
}

fn pace(mission: &Mission) -> f64 {
    let mut bytes = Vec::new();
    Command::velocity([Some(300), Some(300)], None).encode(Addressing::Numbered, &mut bytes);
    let mut decoder = Decoder::default();
    decoder.push(&bytes);
    let mut robot = Robot::new(mission);
    if let Some(frame) = decoder.next_frame() {
        robot.on_frame(&frame, &mut bytes);
    }
    let began = Instant::now();
    let mut frames = Vec::new();
    while began.elapsed().as_secs_f64() < 0.5 {
        robot.advance_to_next_tick();
        frames.clear();
        robot.stream(&mut frames);
    }
    robot.time_s() / began.elapsed().as_secs_f64()
}

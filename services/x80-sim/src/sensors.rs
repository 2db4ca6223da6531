//! Readings of the robot's sensors at a tick.

use common::{
    mission::{INFRARED_RANGERS, Mission, Physics, SONARS, SensorKind, SonarPhysics},
    sonar::Mount,
    wire::{COUNT_CYCLE, CustomSensors, Encoder, LOGIC_SCALE_V, MOTOR_SCALE_V, StandardSensors},
};

use crate::{
    body::Body,
    infrared,
    motor::Motor,
    noise::{Noise, Source},
    silence::Silence,
    sonar,
    world::World,
};

/// Reading in ordinary surroundings, AD counts.
pub const MIDDLE: u16 = 2048;
/// AD supply by which drivers convert, AD counts.
const REFERENCE: u16 = 2048;
/// Current of a standing motor, and current per count per second, AD counts; nominal.
const CURRENT: (f64, f64) = (20.0, 0.2);
/// Additional current of a stalled motor, AD counts; nominal. It is several times a rolling
/// motor's.
pub const STALL_CURRENT: f64 = 1500.0;

pub struct Ranging {
    front: usize,
    mounts: [Option<Mount>; SONARS],
    infrared: [Option<Mount>; INFRARED_RANGERS],
    pub silence: Silence,
    sonar_noise: Noise,
    infrared_noise: Noise,
    /// Echoes for the next tick, if the ultrasonic rangers have listened.
    pub heard: Option<[u8; 6]>,
}

impl Ranging {
    /// Includes sonars of `simulation.ring`.
    pub fn new(mission: &Mission, seed: u64) -> Self {
        let (table, front) = (mission.sensor_table(), mission.front_sonar());
        let (mut mounts, mut infrared) = ([None; SONARS], [None; INFRARED_RANGERS]);
        for sensor in &table {
            let mounts = match sensor.kind {
                SensorKind::Cone => &mut mounts[..],
                SensorKind::Ray => &mut infrared[..],
                SensorKind::Scan => continue,
            };
            if let Some(mount) = mounts.get_mut(usize::from(sensor.channel)) {
                *mount = Some(sensor.mount);
            }
        }
        let front_channel = usize::from(front.channel) % SONARS;
        for ranger in &mission.simulation.ring {
            let (forward_m, bearing_rad) = (ranger.forward_m, ranger.bearing_deg.to_radians());
            mounts[usize::from(ranger.index) % SONARS] =
                Some(Mount { forward_m, bearing_rad, turned_rad: 0.0 });
        }
        // Without sonars, this row is another sensor.
        if front.kind == SensorKind::Cone {
            mounts[front_channel] = Some(front.mount);
        }
        Self {
            front: front_channel,
            mounts,
            infrared,
            silence: Silence::new(
                &mission.simulation.physics().sonar,
                1.0 / mission.robot.rate_hz,
                seed,
            ),
            sonar_noise: Noise::new(seed, Source::Sonar),
            infrared_noise: Noise::new(seed, Source::Infrared),
            heard: None,
        }
    }

    pub fn front(&self, sensors: &StandardSensors) -> u8 {
        sensors.ultrasonic[self.front]
    }

    pub fn listen(&mut self, world: &World, body: &Body, physics: &SonarPhysics) {
        self.heard = Some(self.heard_now(world, body, physics));
    }

    fn heard_now(&mut self, world: &World, body: &Body, physics: &SonarPhysics) -> [u8; 6] {
        let silent = self.silence.step();
        let noise = &mut self.sonar_noise;
        let mut ranges: [f64; 6] = std::array::from_fn(|index| {
            let range = self.mounts[index].map_or(f64::INFINITY, |mount| {
                let centre = body.pose.position;
                sonar::listen(world, centre, mount.on(body.pose), physics, noise)
            });
            if silent[index] { f64::INFINITY } else { range }
        });
        let heard = ranges;
        for (index, range) in ranges.iter_mut().enumerate() {
            let neighbour = heard[(index + 1) % 6].min(heard[(index + 5) % 6]);
            let listens = self.mounts[index].is_some() && !silent[index];
            if listens && noise.chance(physics.crosstalk_share) {
                *range = range.min(neighbour);
            }
        }
        ranges.map(|range| sonar::byte(range, physics, noise))
    }

    /// Ultrasonic rangers that have not listened yet do so now.
    pub fn measure(
        &mut self,
        world: &World,
        body: &Body,
        time: f64,
        physics: &Physics,
    ) -> (StandardSensors, CustomSensors) {
        let heard = self.heard.take();
        let ultrasonic = heard.unwrap_or_else(|| self.heard_now(world, body, &physics.sonar));
        let infrared = infrared::read(
            world,
            body.pose,
            &self.infrared,
            &physics.infrared,
            &mut self.infrared_noise,
        );
        let drained = physics.battery.drain_v_per_min * time / 60.0;
        let volts = (physics.battery.start_v - drained).max(0.0);
        let standard = StandardSensors {
            ultrasonic,
            human: [MIDDLE; 4],
            tilt: [MIDDLE; 2],
            overheat: [MIDDLE; 2],
            temperature: MIDDLE,
            infrared: infrared[0],
            infrared_code: [0; 4],
            board_battery: ad(volts, LOGIC_SCALE_V),
            motor_battery: ad(volts, MOTOR_SCALE_V),
            servo_battery: ad(volts, LOGIC_SCALE_V),
            reference: REFERENCE,
        };
        let mut custom = CustomSensors::default();
        custom.ad[2..].copy_from_slice(&infrared[1..]);
        (standard, custom)
    }
}

fn ad(volts: f64, full_scale: f64) -> u16 {
    (volts / full_scale * 4095.0).round().clamp(0.0, 4095.0) as u16
}

pub fn encoder(motor: &Motor, error: f64) -> Encoder {
    let position = (motor.turned + error).round();
    Encoder {
        position: position.rem_euclid(f64::from(COUNT_CYCLE)) as u16,
        speed: motor.speed.abs().round().min(f64::from(u16::MAX)) as u16,
        positive: motor.speed >= 0.0,
    }
}

/// Returns AD counts.
pub fn currents(motors: &[Motor; 6]) -> [u16; 6] {
    motors.each_ref().map(|motor| {
        if !motor.enabled {
            return 0;
        }
        let (standing, per_speed) = CURRENT;
        let current = standing + per_speed * motor.speed.abs() + STALL_CURRENT * motor.load;
        current.min(4095.0) as u16
    })
}

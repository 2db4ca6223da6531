//! Robot as a pure state machine: commands in, mission time forward, frames out.

use common::{
    geometry::wrap_angle,
    ground_truth::GroundTruthTick,
    json_wire::Order,
    kinematics::Twist,
    mission::{BlockedWheels, Mission, Physics, Protocol, Simulation, TouchKind, TouchRow, lasts},
    wire::{
        Addressing, COUNT_CYCLE, Command, CustomSensors, Frame, Motion, MotorSensors, Report,
        StandardSensors, SystemSignal,
    },
};

use glam::DVec2;

use crate::{
    arduino_words::{ArduinoWords, Request},
    body::Body,
    car::Car,
    drivetrain::{self, Drivetrain},
    gyro::Gyro,
    json_words::JsonWords,
    laser::Laser,
    motor::Motor,
    noise::{Noise, Source},
    rplidar::Rplidar,
    saved_state::SavedState,
    sensors::{self, Ranging},
    streams::Streams,
    wheel_errors::WheelErrors,
    world::World,
};

const STEP_S: f64 = 0.005;

/// Driving time at the end of the process if the last command does not expire.
const COMES_TO_REST_S: f64 = 3.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Frame for a different addressee.
    Foreign,
    Ack,
    Ping,
    Motion,
    Other,
}

/// Host's message in the robot's protocol.
#[derive(Clone, Copy)]
pub(crate) enum Said<'a> {
    Frame(&'a Frame<'a>),
    Order(&'a Order),
    Request(Request),
}

impl Said<'_> {
    pub(crate) fn kind(self) -> Heard {
        use Heard::*;
        match self {
            Self::Frame(frame) if Addressing::of_robot(frame.rid).is_none() => Foreign,
            Self::Frame(frame) => match Command::parse(frame) {
                Ok(Command::System(SystemSignal::Ack)) => Ack,
                Ok(Command::System(SystemSignal::Ping)) => Ping,
                Ok(Command::Motion(_)) if !Addressing::is_multimedia(frame.rid) => Motion,
                Ok(_) | Err(_) => Other,
            },
            Self::Order(Order::Drive { .. }) | Self::Request(Request::Speeds(_)) => Motion,
            Self::Order(Order::Ping {}) => Ping,
            Self::Order(_) | Self::Request(_) => Other,
        }
    }

    pub(crate) fn told(self, robot: &mut Robot, answer: &mut Vec<u8>) -> Heard {
        match self {
            Self::Frame(frame) => robot.on_frame(frame, answer),
            Self::Order(order) => robot.on_order(order, answer),
            Self::Request(request) => robot.on_request(request, answer),
        }
    }
}

pub struct Robot {
    physics: Physics,
    simulation: Simulation,
    pub(crate) rate_hz: f64,
    drivetrain: Drivetrain,
    car: Option<Car>,
    longest_step: f64,

    pub(crate) world: World,
    body: Body,
    motors: [Motor; 6],
    streams: Streams,
    ranging: Ranging,
    wheel_noise: Noise,
    count_noise: Noise,

    /// Mission time, seconds.
    pub(crate) time: f64,
    tick: u64,
    heard_at: f64,
    ordered_at: f64,
    stopping_time: f64,
    addressing: Addressing,
    least_clearance: f64,
    standard: StandardSensors,
    custom: CustomSensors,
    motor: MotorSensors,
    json: Option<JsonWords>,
    gyro: Option<Gyro>,
    arduino: Option<ArduinoWords>,
    lasers: Vec<Laser>,
    pub(crate) rplidar: Option<Rplidar>,
    touches: Vec<TouchRow>,
    felt: Vec<bool>,
    told: Vec<bool>,
}

impl Robot {
    pub fn new(mission: &Mission) -> Self {
        Self::with_noise(mission, mission.seed)
    }

    fn with_noise(mission: &Mission, seed: u64) -> Self {
        let mut physics = mission.simulation.physics();
        physics.wheels = mission.wheel_physics();
        let size = mission.body();
        let counts_per_m = 1.0 / size.metres_per_count();
        let top_counts = size.top_speed_m_s * counts_per_m;
        let longest_step = STEP_S.min(0.5 * size.radius_m / size.top_speed_m_s);
        assert!(longest_step > 0.0);
        let world = World::new(mission);
        let wheel_errors = WheelErrors::of(mission);
        physics.wheels.slip_share = wheel_errors.slip_share;
        let car = Car::new(mission, &wheel_errors);
        let rplidar = Rplidar::new(mission, seed);
        let top_counts = |channel| match &car {
            Some(car) if car.steers_by(channel) => car.top_steering_counts(),
            _ => top_counts,
        };
        let body = Body::new(mission, &world, wheel_errors.track);
        let mut robot = Self {
            physics,
            simulation: mission.simulation.clone(),
            rate_hz: mission.robot.rate_hz,
            drivetrain: Drivetrain::new(mission, wheel_errors.diameter),
            longest_step,
            world,
            motors: std::array::from_fn(|channel| {
                Motor::new(physics.wheels, top_counts(channel), counts_per_m)
            }),
            car,
            streams: Streams::default(),
            ranging: Ranging::new(mission, seed),
            wheel_noise: Noise::new(seed, Source::Wheels),
            count_noise: Noise::new(seed, Source::Counts),
            time: 0.0,
            tick: 0,
            heard_at: 0.0,
            ordered_at: 0.0,
            stopping_time: 0.0,
            addressing: Addressing::default(),
            least_clearance: body.clearance,
            body,
            standard: StandardSensors::default(),
            custom: CustomSensors::default(),
            motor: MotorSensors::default(),
            json: (mission.robot.protocol() == Protocol::Json).then(|| JsonWords::new(mission)),
            gyro: mission.robot.gyro().then(|| Gyro::new(mission, seed)),
            arduino: (mission.robot.protocol() == Protocol::Arduino)
                .then(|| ArduinoWords::new(mission)),
            lasers: Laser::all(mission, seed),
            rplidar,
            felt: Vec::new(),
            told: Vec::new(),
            touches: mission.touches(),
        };
        robot.measure();
        robot
    }

    /// Boots at the place and counts of an earlier process.
    pub fn restored(mission: &Mission, saved: &SavedState) -> Self {
        // The mission's seed would repeat the noise of the first readings.
        let seed = mission.seed.wrapping_add(saved.tick + 1);
        let mut robot = Self::with_noise(mission, seed);
        robot.tick = saved.tick;
        robot.time = saved.time_s;
        (robot.heard_at, robot.ordered_at) = (saved.time_s, saved.time_s);
        robot.stopping_time = saved.stopping_time_s;
        robot.ranging.silence.silent = saved.silent;
        for (motor, turned) in robot.motors.iter_mut().zip(saved.turned) {
            motor.turned = turned;
        }
        let (centre, radius) = (saved.pose.position, robot.body.radius);
        robot.world.advance(saved.time_s, centre, radius);
        robot.body.put(saved.pose, saved.contacts, &robot.world);
        robot.least_clearance = robot.body.clearance;
        robot.measure();
        robot
    }

    pub fn saved_state(&self) -> SavedState {
        SavedState {
            tick: self.tick,
            time_s: self.time,
            pose: self.body.pose,
            turned: std::array::from_fn(|channel| self.motors[channel].turned),
            contacts: self.body.contacts,
            stopping_time_s: self.stopping_time,
            silent: self.ranging.silence.silent,
        }
    }

    /// Advances without frames until the robot rests, and halts one that would never rest.
    pub fn come_to_rest(&mut self, mut on_tick: impl FnMut(&mut Self)) {
        let latest = self.time + COMES_TO_REST_S;
        while self.time < latest && self.is_moving() {
            self.advance_to_next_tick();
            on_tick(self);
        }
        self.motors.iter_mut().for_each(Motor::halt);
    }

    fn is_moving(&self) -> bool {
        let ordered = self.motors.iter().any(|motor| motor.ends_at().is_some());
        ordered || self.rims() != [0.0; 2]
    }

    pub fn next_tick_s(&self) -> f64 {
        (self.tick + 1) as f64 / self.rate_hz
    }

    pub fn on_frame(&mut self, frame: &Frame<'_>, replies: &mut Vec<u8>) -> Heard {
        let Some(addressing) = Addressing::of_robot(frame.rid) else {
            return Heard::Foreign;
        };
        self.addressing = addressing;
        self.heard_at = self.time;
        let heard = Said::Frame(frame).kind();
        // Even unknown frames are acknowledged; acknowledgements are not.
        if heard != Heard::Ack {
            Report::System(SystemSignal::Ack).encode(addressing, replies);
        }
        if !Addressing::is_multimedia(frame.rid)
            && let Ok(command) = Command::parse(frame)
        {
            self.take(command);
        }
        heard
    }

    fn take(&mut self, command: Command) {
        match command {
            Command::Motion(motion) => self.obey(&motion),
            Command::Parameter { channel, parameter } => {
                if let Some(motor) = self.motors.get_mut(usize::from(channel)) {
                    motor.configure(parameter);
                }
            }
            Command::Enable { on, channel } => {
                for (number, motor) in self.motors.iter_mut().enumerate() {
                    if channel.is_none_or(|only| usize::from(only) == number) {
                        motor.enable(on);
                    }
                }
            }
            Command::Stream { stream, request } => self.streams.request(stream, request),
            Command::System(_) => {}
        }
    }

    fn obey(&mut self, motion: &Motion) {
        self.ordered_at = self.time;
        let until = motion
            .limit_ms
            .filter(|_| !self.simulation.ignores_time)
            .map(|limit| self.time + f64::from(limit) / 1000.0);
        for (number, motor) in (0_u8..).zip(&mut self.motors) {
            if let Some(value) = motion.targets.of(number) {
                motor.order(motion.quantity, value, until);
            }
        }
    }

    pub fn on_order(&mut self, order: &Order, replies: &mut Vec<u8>) -> Heard {
        let Some(json) = &mut self.json else {
            return Heard::Foreign;
        };
        let commands = json.commands(order);
        replies.extend(json.acknowledgement());
        self.heard_at = self.time;
        for command in commands {
            self.take(command);
        }
        Said::Order(order).kind()
    }

    pub fn on_request(&mut self, request: Request, replies: &mut Vec<u8>) -> Heard {
        let Some(arduino) = &mut self.arduino else {
            return Heard::Foreign;
        };
        if arduino.hears(self.time, &self.motors) {
            let gyro = self.gyro.as_mut();
            let gyro = gyro.map(|gyro| gyro.read(self.time, self.body.pose.heading));
            let (answer, command) = arduino.answer(request, &self.standard, &self.motors, gyro);
            replies.extend(answer.into_bytes());
            self.heard_at = self.time;
            command.into_iter().for_each(|command| self.take(command));
        }
        Said::Request(request).kind()
    }

    /// Opening its line reboots an Arduino.
    pub fn on_opened(&mut self) {
        if let Some(arduino) = &mut self.arduino {
            self.motors.iter_mut().for_each(Motor::halt);
            arduino.boot(self.time);
        }
    }

    pub fn laser_measured(&mut self) -> Vec<u8> {
        let (now, pose) = (self.time, self.body.pose);
        let rplidar = self.rplidar.as_mut();
        rplidar.map_or_else(Vec::new, |rplidar| rplidar.measured(&self.world, pose, now))
    }

    /// Returns when the ultrasonic rangers listen for the next tick, if still ahead.
    fn listens_at(&self) -> Option<f64> {
        let age = self.physics.sonar.age_s;
        (age > 0.0 && self.ranging.heard.is_none()).then(|| self.next_tick_s() - age)
    }

    /// Advances in short steps, which never cross the end of a timed command or the time of a
    /// range.
    pub fn advance_to(&mut self, end: f64) {
        while self.time < end {
            if self.listens_at().is_some_and(|moment| moment <= self.time) {
                self.ranging.listen(&self.world, &self.body, &self.physics.sonar);
            }
            let ends = self.motors.iter().filter_map(Motor::ends_at);
            let until = ends
                .chain(self.listens_at())
                .filter(|moment| *moment > self.time)
                .fold(end, f64::min);
            assert!(until > self.time && until <= end);
            let span = until - self.time;
            let steps = (span / self.longest_step).ceil().max(1.0);
            let from = self.time;
            for step in 1..=steps as u64 {
                self.step(span / steps);
                self.feel();
                self.time = from + span * step as f64 / steps;
                let own = self.rplidar.as_mut().map(|rplidar| &mut rplidar.laser);
                for laser in self.lasers.iter_mut().chain(own) {
                    laser.follow(self.time, self.body.pose);
                }
            }
            // Exact time ends a command that expires now.
            self.time = until;
        }
    }

    fn step(&mut self, dt: f64) {
        let limit = self.simulation.stops_when_silent_s;
        if limit.is_some_and(|limit| self.time >= self.heard_at + limit) {
            self.motors.iter_mut().for_each(Motor::halt);
        }
        let (centre, radius) = (self.body.pose.position, self.body.radius);
        self.world.advance(self.time + dt, centre, radius);

        let mut wheels = self.physics.wheels;
        for shove in
            self.simulation.shoves.iter().filter(|it| lasts(self.time, it.from_s, it.until_s))
        {
            wheels.slip_share = 1.0 - (1.0 - wheels.slip_share) * (1.0 - shove.slip);
            self.body.shove(shove, dt, &self.world);
        }
        let (now, noise) = (self.time, &mut self.wheel_noise);
        let drivetrain = self.drivetrain;
        if let Some(car) = &self.car {
            let world = &self.world;
            car.step(&mut self.motors, &mut self.body, world, &wheels, (now, dt), noise);
        } else {
            let asked = drivetrain.step(&mut self.motors, now, dt, noise);
            let ground =
                drivetrain.rims(asked).map(|metres| drivetrain::slipped(metres, &wheels, noise));
            let blocked = self.blocked_wheels();
            let ground = [0, 1].map(|wheel| if blocked[wheel] { 0.0 } else { ground[wheel] });
            let went = self.body.roll(ground, &self.world);
            let at_contact = drivetrain::grip(went != ground, &wheels);
            // A blocked wheel cannot slip.
            let grip = blocked.map(|blocked| if blocked { Some(1.0) } else { at_contact });
            drivetrain.turn(&mut self.motors, asked, went, grip, dt);
        }
        self.least_clearance = self.least_clearance.min(self.body.clearance);
        let [left, right] = self.rims();
        if left.abs().max(right.abs()) > GroundTruthTick::AT_REST_M_S {
            self.stopping_time = self.stopping_time.max(now + dt - self.ordered_at);
        }
    }

    fn blocked_wheels(&self) -> [bool; 2] {
        let now =
            || self.simulation.blocks.iter().filter(|it| lasts(self.time, it.from_s, it.until_s));
        [BlockedWheels::Right, BlockedWheels::Left]
            .map(|other| now().any(|block| block.wheels != other))
    }

    fn rims(&self) -> [f64; 2] {
        match &self.car {
            Some(car) => [car.twist(&self.motors).v; 2],
            None => self.drivetrain.rim_speeds(&self.motors),
        }
    }

    fn twist(&self) -> Twist {
        if let Some(car) = &self.car {
            return car.twist(&self.motors);
        }
        let [left, right] = self.rims();
        Twist { v: (left + right) / 2.0, omega: (right - left) / self.body.track }
    }

    pub fn advance_to_next_tick(&mut self) {
        self.advance_to(self.next_tick_s());
        self.tick += 1;
        self.measure();
    }

    fn feel(&mut self) {
        let (pose, at) = (self.body.pose, self.body.touched_at(&self.world));
        self.felt.resize(self.touches.len(), false);
        for (row, felt) in self.touches.iter().zip(&mut self.felt) {
            let bearing = row.bearing_deg.to_radians();
            *felt |= match row.kind {
                TouchKind::Bumper => at.is_some_and(|at| {
                    wrap_angle(at - bearing).abs() <= row.wide_deg.to_radians() / 2.0
                }),
                TouchKind::Cliff => {
                    let along = DVec2::from_angle(pose.heading + bearing);
                    let forward_m = row.forward_m.unwrap_or(self.body.radius);
                    self.world.is_hole(pose.position + forward_m * along)
                }
            };
        }
    }

    /// Sensor noise is drawn only here.
    fn measure(&mut self) {
        let noise = self.physics.wheels.count_noise;
        for (encoder, motor) in self.motor.encoders.iter_mut().zip(&self.motors) {
            *encoder = sensors::encoder(motor, self.count_noise.normal(noise));
        }
        self.motor.currents = sensors::currents(&self.motors);
        self.motor.pots = [sensors::MIDDLE; 6];
        (self.standard, self.custom) =
            self.ranging.measure(&self.world, &self.body, self.time, &self.physics);
        if let Some(gyro) = &mut self.gyro {
            gyro.read(self.time, self.body.pose.heading);
        }
        self.told = std::mem::take(&mut self.felt);
        self.feel();
        for laser in &mut self.lasers {
            laser.measure(&self.world, self.body.pose, (self.tick, self.time));
        }
    }

    /// Returns a frame of every running stream, the motor frame last, and counts them.
    pub fn stream(&mut self) -> Vec<u8> {
        let due = self.streams.take_due();
        self.written(due)
    }

    /// Frames are not counted again.
    pub fn repeat(&self) -> Vec<u8> {
        self.written(self.streams.running())
    }

    fn written(&self, due: [bool; 3]) -> Vec<u8> {
        if let Some(json) = &self.json {
            let sensors = (&self.standard, &self.custom, &self.motor);
            let touched = self.touches.iter().map(|row| row.name.clone()).zip(self.told.clone());
            let touched = touched.collect();
            let gyro = self.gyro.as_ref().map(|gyro| gyro.angle);
            return json.report(sensors, &self.lasers, touched, &self.motors, gyro);
        }
        let mut out = Vec::with_capacity(256);
        if self.arduino.is_some() {
            // This robot only answers requests.
            return out;
        }
        let standard = Report::Standard(self.standard);
        let reports = [standard, Report::Custom(self.custom), Report::Motor(self.motor)];
        for (report, _) in reports.iter().zip(due).filter(|(_, is_due)| *is_due) {
            report.encode(self.addressing, &mut out);
        }
        out
    }

    pub fn ground_truth(&mut self) -> GroundTruthTick {
        let pose = self.body.pose;
        let Twist { v, omega } = self.twist();
        // The summary finds a pose's tick by these counts, which the host hears.
        let [left_counts, right_counts] = match &self.arduino {
            Some(arduino) => arduino
                .counts(&self.motors)
                .map(|counts| counts.rem_euclid(i32::from(COUNT_CYCLE)) as u16),
            None => self.drivetrain.counts(&self.motor.encoders),
        };
        let clearance_m = self.least_clearance.min(GroundTruthTick::NOTHING_NEAR);
        self.least_clearance = self.body.clearance;
        GroundTruthTick {
            tick: self.tick,
            time_s: self.time,
            x: pose.position.x,
            y: pose.position.y,
            heading: pose.heading,
            v,
            omega,
            clearance_m,
            contacts: self.body.contacts,
            left_counts,
            right_counts,
            sonar_cm: self.ranging.front(&self.standard),
            stopping_time_s: self.stopping_time,
            radio: None,
        }
    }
}

#[cfg(test)]
mod tests;

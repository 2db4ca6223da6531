//! Infrared ring: seven rangers that look straight ahead.

use common::{
    kinematics::Pose2,
    mission::{INFRARED_RANGERS, InfraredPhysics},
    sonar::Mount,
    wire::infrared_ad,
};

use crate::{noise::Noise, world::World};

/// Reading without an obstacle in reach.
const NOTHING_M: f64 = 0.81;

/// AD counts; 0 without a mount.
pub fn read(
    world: &World,
    pose: Pose2,
    mounts: &[Option<Mount>; INFRARED_RANGERS],
    physics: &InfraredPhysics,
    noise: &mut Noise,
) -> [u16; INFRARED_RANGERS] {
    mounts.map(|mount| {
        let Some(ranger) = mount.map(|mount| mount.on(pose)) else {
            return 0;
        };
        let height_m = world.heights.infrared_m;
        let range = if world.is_between(pose.position, ranger.position, height_m) {
            // A ranger pressed against an object that the body touches sees only that.
            0.0
        } else {
            let hit = world.first_hit(ranger.position, ranger.axis(), height_m);
            hit.map_or(NOTHING_M, |(range, _)| range)
        };
        let counts = f64::from(infrared_ad(range)) + noise.normal(physics.noise_counts);
        counts.round().clamp(0.0, 4095.0) as u16
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Source;
    use crate::testing::{mission, near};
    use common::wire::infrared_m;

    #[test]
    fn each_ranger_reads_what_stands_straight_ahead_of_it() {
        let mission = mission(
            "robot.radius_m = 0.2\nworld.wall = [{ points = [[-1, 0.6], [1, 0.6]] }, { points = [[-1, 0.5], [1, 0.5]], top_m = 0.1 }, { points = [[-0.5, -1], [-0.5, 1]] }]",
        );
        let physics = InfraredPhysics { noise_counts: 0.0 };
        let mut noise = Noise::new(1, Source::Infrared);
        let world = World::new(&mission);
        let mut mounts = [None; INFRARED_RANGERS];
        for sensor in mission.sensor_table().into_iter().skip(3) {
            mounts[usize::from(sensor.channel)] = Some(sensor.mount);
        }
        let read = read(&world, Pose2::default(), &mounts, &physics, &mut noise).map(infrared_m);
        // They look over a low wall. The left ranger, 0.127 m off the centre, is 0.473 m from the upper wall. The one at 33.75
        // degrees is 0.6 / sin - 0.2 m away, out of reach. The rear one is 0.3 m from the wall.
        let want = [0.81, 0.81, 0.81, 0.81, 0.81, 0.3, 0.473];
        for (read, want) in read.iter().zip(want) {
            near(*read, want, 0.005);
        }
    }
}

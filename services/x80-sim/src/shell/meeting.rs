//! Link to the world's other robot, which is a separate run.
//!
//! After every tick, simulators exchange their robots' poses over datagram sockets in the robots'
//! directories. The stages never see them.
//!
//! In lockstep a tick waits for the other's pose at the previous tick, so that paired runs repeat
//! bit for bit. Within a tick the other continues at its stated velocity.

use std::{
    collections::VecDeque,
    io::ErrorKind,
    os::{
        fd::{AsFd, OwnedFd},
        unix::net::UnixDatagram,
    },
    path::PathBuf,
    time::{Duration, Instant},
};

use common::{
    file,
    geometry::{Light, Profile},
    ground_truth::GroundTruthTick,
    kinematics::{Pose2, Twist},
    mission::{Footprint, Mission},
    poll, stop_socket,
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    error::{Result, SimError},
    world::Other,
};

/// Maximum wait for the other robot, by wall clock: below the time after which a run without ticks
/// is given up.
const PATIENCE: Duration = Duration::from_secs(10);
/// Interval for resending a pose to a robot that may not listen yet.
const AGAIN: Duration = Duration::from_millis(20);
const SAME_S: f64 = 1e-6;
/// Mission time without poses after which the other stands at its last place.
const FRESH_S: f64 = 0.5;
/// Maximum datagram.
const LONGEST: usize = 4096;
const MOST_AT_ONCE: usize = 64;

/// Pose in the shared mission frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Place {
    time_s: f64,
    at: DVec2,
    heading: f64,
    v: f64,
    omega: f64,
    radius_m: f64,
    /// Corners of a polygonal body; empty for a disc.
    footprint: Vec<DVec2>,
    bottom_m: f64,
    top_m: f64,
    /// Whether the robot's run is over; it stays here.
    ended: bool,
}

impl Place {
    fn parse(datagram: &[u8]) -> Option<Self> {
        let place: Self = serde_json::from_slice(datagram).ok()?;
        let is_sound = place.at.abs().max_element() < 1e6
            && place.heading.abs() < 1e6
            && place.v.abs().max(place.omega.abs()) < 100.0
            && (place.footprint.is_empty() || Footprint::new(&place.footprint).is_ok())
            && (0.01..=10.0).contains(&place.radius_m)
            && (0.0..=10.0).contains(&place.bottom_m)
            && (place.bottom_m..=10.0).contains(&place.top_m)
            && place.time_s >= 0.0;
        is_sound.then_some(place)
    }

    fn other(&self, now_s: f64) -> Other {
        let Self { time_s, at, heading, v, omega, radius_m, bottom_m, top_m, .. } = *self;
        let goes = if now_s - time_s < FRESH_S { 1.0 } else { 0.0 };
        Other {
            time_s,
            pose: Pose2 { position: at, heading },
            twist: Twist { v: goes * v, omega: goes * omega },
            radius_m,
            footprint: Footprint::new(&self.footprint).ok(),
            profile: Profile { bottom_m, top_m, echo: 1.0, light: Light::default() },
        }
    }
}

pub struct Meeting {
    socket: UnixDatagram,
    other: PathBuf,
    stop: OwnedFd,
    waits: bool,
    goes_on_after_contact: bool,
    own: Place,
    is_told: bool,
    newest: Option<Place>,
    later: VecDeque<Place>,
    is_missed: bool,
    refused: u64,
}

impl Meeting {
    /// Binds the socket `own`; `other` is the other robot's. A readable `stop` ends waits.
    pub fn open(
        mission: &Mission,
        [own, other]: [PathBuf; 2],
        stop: &impl AsFd,
        waits: bool,
    ) -> Result<Self> {
        let listen = || {
            // An earlier simulator may have left its socket.
            file::remove(&own)?;
            Ok((stop_socket::bind(&own)?, stop.as_fd().try_clone_to_owned()?))
        };
        let (socket, stop) =
            listen().map_err(|source| SimError::Meet { socket: own.clone(), source })?;
        let body = mission.body();
        let heights = mission.simulation.physics().heights;
        Ok(Self {
            socket,
            other,
            stop,
            waits,
            goes_on_after_contact: mission.simulation.goes_on_after_contact,
            own: Place {
                radius_m: body.radius_m,
                footprint: body.footprint.map_or_else(Vec::new, |it| it.corners().to_vec()),
                bottom_m: heights.ground_clearance_m,
                top_m: heights.body_top_m,
                ..Place::default()
            },
            is_told: false,
            newest: None,
            later: VecDeque::new(),
            is_missed: false,
            refused: 0,
        })
    }

    pub fn other_at(&mut self, now_s: f64) -> Result<Option<Other>> {
        let began = Instant::now();
        loop {
            self.take(now_s);
            if !self.is_told {
                self.send();
            }
            if !self.waits || self.is_missed || self.knows(now_s) {
                break;
            }
            if began.elapsed() > PATIENCE {
                self.is_missed = true;
                tracing::warn!(other = %self.other.display(), last = ?self.newest, "the other robot no longer sends its pose; it stays at its last pose, and this robot continues");
                break;
            }
            let came = poll::readable(&[self.socket.as_fd(), self.stop.as_fd()], Some(AGAIN));
            if came.map_err(SimError::Wait)?.get(1) == Some(&true) {
                break;
            }
        }
        Ok(self.newest.as_ref().map(|newest| newest.other(now_s)))
    }

    fn knows(&self, now_s: f64) -> bool {
        let has = |place: &Place| place.ended || place.time_s > now_s - SAME_S;
        !self.later.is_empty() || self.newest.as_ref().is_some_and(has)
    }

    /// Those after `now_s` wait.
    fn take(&mut self, now_s: f64) {
        let mut bytes = [0; LONGEST];
        while self.later.len() < MOST_AT_ONCE
            && let Ok(length) = self.socket.recv(&mut bytes)
        {
            let Some(mut place) = bytes.get(..length).and_then(Place::parse) else {
                self.refused += 1;
                tracing::warn!(refused = self.refused, "a datagram is not the pose of a robot");
                continue;
            };
            // On a wall clock the two missions began at different times.
            if !self.waits {
                place.time_s = now_s;
            }
            self.later.push_back(place);
        }
        while let Some(place) = self.later.pop_front_if(|it| it.time_s <= now_s + SAME_S) {
            self.is_missed &= !place.ended && place.time_s < now_s - SAME_S;
            self.newest = Some(place);
        }
    }

    /// A contact ends its mission, and it stays there.
    pub fn tell(&mut self, truth: &GroundTruthTick, ended: bool) {
        if self.own.ended {
            return;
        }
        let ended = ended || (truth.contacts > 0 && !self.goes_on_after_contact);
        let goes = if ended { 0.0 } else { 1.0 };
        let own = &mut self.own;
        let pose = truth.pose();
        (own.time_s, own.at, own.heading) = (truth.time_s, pose.position, pose.heading);
        (own.v, own.omega, own.ended) = (goes * truth.v, goes * truth.omega, ended);
        self.send();
    }

    fn send(&mut self) {
        let bytes = serde_json::to_vec(&self.own).unwrap_or_default();
        let began = Instant::now();
        self.is_told = loop {
            match self.socket.send_to(&bytes, &self.other) {
                // In lockstep every place must arrive.
                Err(error) if error.kind() == ErrorKind::WouldBlock && self.waits => {
                    if self.is_missed || began.elapsed() > PATIENCE {
                        self.is_missed = true;
                        break false;
                    }
                    // Waiting for room requires a connected socket, which would only hear the
                    // present other.
                    let has_room = UnixDatagram::unbound().and_then(|asks| {
                        asks.connect(&self.other)?;
                        poll::is_writable(asks, AGAIN)
                    });
                    if has_room.is_err() {
                        break false;
                    }
                }
                sent => break sent.is_ok(),
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;
    use std::{os::unix::net::UnixStream, path::Path};

    /// Returns two robots that meet; `waits` is in lockstep.
    fn pair(folder: &Path, waits: bool) -> [Meeting; 2] {
        let mission = mission("");
        let sockets = ["one", "two"].map(|robot| folder.join(robot));
        // Waits end at once, because the other end is closed.
        let (stop, _) = UnixStream::pair().unwrap();
        [[0, 1], [1, 0]].map(|order| {
            Meeting::open(&mission, order.map(|at| sockets[at].clone()), &stop, waits).unwrap()
        })
    }

    fn truth(time_s: f64, x: f64) -> GroundTruthTick {
        GroundTruthTick { time_s, x, v: 0.5, ..GroundTruthTick::default() }
    }

    fn x_and_speed(other: Option<Other>) -> Option<(f64, f64)> {
        let Other { pose, twist, profile, radius_m, .. } = other?;
        assert_eq!((radius_m, profile.bottom_m, profile.top_m), (0.19, 0.03, 0.255));
        Some((pose.position.x, twist.v))
    }

    #[test]
    fn a_malformed_datagram_is_refused_and_counted_and_the_place_before_it_stays() {
        let folder = tempfile::tempdir().unwrap();
        let [mut one, mut two] = pair(folder.path(), false);
        one.tell(&truth(0.1, 4.0), false);
        for hostile in ["", "{}", "\0\0", &"[".repeat(5000)] {
            one.socket.send_to(hostile.as_bytes(), &one.other).unwrap();
        }
        let sound = serde_json::to_string(&one.own).unwrap();
        for (key, value) in [
            ("\"time_s\":0.1", "\"time_s\":-1"),
            ("4.0", "1e300"),
            ("0.19", "0"),
            ("0.255", "0.01"),
            ("[]", "[[0.0,0.0],[1.0,0.0]]"),
            ("}", ",\"more\":1}"),
        ] {
            assert!(sound.contains(key), "{sound}");
            one.socket.send_to(sound.replace(key, value).as_bytes(), &one.other).unwrap();
        }
        assert_eq!(x_and_speed(two.other_at(0.2).unwrap()), Some((4.0, 0.5)));
        assert_eq!(two.refused, 10);
    }

    #[test]
    fn in_lockstep_a_place_of_a_later_time_waits_until_then_and_one_that_ended_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let [mut one, mut two] = pair(folder.path(), true);
        // Nothing was told.
        assert_eq!(two.other_at(0.0).unwrap(), None);
        assert!(!two.knows(0.0));
        for (time_s, x) in [(0.0, 4.0), (0.1, 3.95)] {
            one.tell(&truth(time_s, x), false);
        }
        assert_eq!(x_and_speed(two.other_at(0.0).unwrap()), Some((4.0, 0.5)));
        assert_eq!(x_and_speed(two.other_at(0.1).unwrap()), Some((3.95, 0.5)));
        two.other_at(0.2).unwrap();
        assert!(!two.knows(0.2));
        one.tell(&GroundTruthTick { contacts: 1, ..truth(0.2, 3.9) }, false);
        one.tell(&truth(0.3, 3.8), false);
        // It stays there.
        assert_eq!(x_and_speed(two.other_at(0.2).unwrap()), Some((3.9, 0.0)));
        two.other_at(9.0).unwrap();
        assert!(two.knows(9.0));
    }
}

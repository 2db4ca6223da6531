//! Recordings: all samples of a robot's bus in one file, written by a consumer, read by reports and
//! replays.
//!
//! # The file
//! MCAP in chunks compressed with Zstandard, each written whole, at least once a second. The file
//! of a killed recorder ends after its last whole chunk.
//!
//! - A channel for each topic that the topic table marks as `logged`, under the topic's name. A
//!   message is one sample in the CDR encoding of ROS 2. Its schema is the text of a ROS 2 message
//!   (`ros2msg`), made from the topic's layout. Topics of slices have a `header` and `elements`.
//! - Channels for viewers, in Foxglove's schemas as Protobuf: `foxglove/transforms`
//!   (`FrameTransforms`: `map`, `base_link`, sensors), `foxglove/pose` (`PoseInFrame`),
//!   `foxglove/odometry` (`Odometry`: with covariance), `foxglove/grid` (`Grid`), `foxglove/scene`
//!   (`SceneUpdate`: trajectory, targets, body, uncertainty), `foxglove/movers` (`SceneUpdate`),
//!   `foxglove/scan/SENSOR` (`LaserScan`), `log` (`Log`: the logs of the stages and the
//!   supervisor).
//! - A channel `recorder` (JSON): samples lost so far by topic, whenever they grow.
//! - A metadata record `run`: robot, mission, seed, build, machine, date, and `run_toml`, the run
//!   file of the stages.
//!
//! Times are mission time, counted from the mission's start in nanoseconds since 1970, so that
//! viewers play a run at its speed, even in lockstep. A message has its sample's publish time and
//! sequence. The log time is the time of reading, in lockstep the publish time.
//!
//! Each new run of the robot begins a new file: `F.mcap`, `F-2.mcap`.
//!
//! # Reading
//! ```no_run
//! use common::topics;
//! use recording::{End, Recording};
//!
//! let recording = Recording::open("recording.mcap".as_ref())?;
//! println!("{} with seed {}", recording.run.mission.name, recording.run.mission.seed);
//! if let End::Cut { after, problem } = &recording.end {
//!     println!("cut off after {:.1} s: {problem}", after.as_secs_f64());
//! }
//! for pose in recording.samples(&topics::POSE)? {
//!     let pose = pose?;
//!     println!("{:.3} {:.3}", pose.x_m, pose.y_m);
//! }
//! # Ok::<(), recording::RecordingError>(())
//! ```

mod bag;
mod budget;
mod error;
mod file;
pub mod log_files;
mod losses;
mod places;
mod protobuf;
pub mod reader;
pub mod recorder;
pub mod replay;
pub mod schema;
pub mod viewers;

pub(crate) use self::error::Result;
pub use self::{
    bag::Bag,
    error::RecordingError,
    file::now_ns,
    places::{files, next_place, parts},
    reader::{End, Message, Recording, messages},
    recorder::{Options, Tape, record},
    viewers::log_line,
};

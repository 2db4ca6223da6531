//! The frames of `/tf` and `/tf_static`, in the plane. Pure.

use std::{collections::BTreeMap, time::Instant};

use glam::DAffine2;
use ros2::cdr::Reader;

/// The most frames that are known, and that a message has.
const MOST_FRAMES: usize = 1024;

#[derive(Debug)]
struct Place {
    parent: String,
    pose: DAffine2,
    /// None for a frame that stays.
    heard: Option<Instant>,
}

#[derive(Default)]
pub struct Frames(BTreeMap<String, Place>);

impl Frames {
    /// Take a `tf2_msgs/TFMessage` that was `heard` then, or is of frames that stay. The error says why it is refused.
    pub fn take(&mut self, payload: &[u8], heard: Option<Instant>) -> Result<(), String> {
        let mut reader = Reader::new(payload)?;
        for _ in 0..reader.length(MOST_FRAMES)? {
            let (_stamp_ns, parent) = reader.header()?;
            let frame = reader.text()?;
            let (at, heading) = reader.pose()?;
            let pose = DAffine2::from_angle_translation(heading.unwrap_or(f64::NAN), at.into());
            let is_known = self.0.contains_key(name(frame));
            if pose.is_finite() && (is_known || self.0.len() < MOST_FRAMES) {
                let parent = name(parent).to_owned();
                self.0.insert(name(frame).to_owned(), Place { parent, pose, heard });
            }
        }
        Ok(())
    }

    /// The pose of `frame` in `root`, from transforms that are not older than `since`. The error says what is missing.
    pub fn find(
        &self,
        frame: &str,
        root: &str,
        since: Option<Instant>,
    ) -> Result<DAffine2, String> {
        let (mut at, mut pose) = (name(frame), DAffine2::IDENTITY);
        for _ in 0..=MOST_FRAMES {
            if at == name(root) {
                return Ok(pose);
            }
            let Some(place) = self.0.get(at) else {
                return Err(format!("no transform from {at:?} towards {root:?} was published"));
            };
            if place.heard.is_some_and(|heard| Some(heard) < since) {
                return Err(format!("the transform from {at:?} to {:?} is old", place.parent));
            }
            pose = place.pose * pose;
            at = &place.parent;
        }
        Err(format!("the transforms from {frame:?} lead in a circle"))
    }
}

/// Older nodes write a slash before the name.
fn name(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

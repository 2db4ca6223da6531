//! Frames of `/tf` and `/tf_static`, in the plane. A frame that is upside down is mirrored.

use std::{collections::BTreeMap, time::Instant};

use crate::{
    cdr::Cdr as _,
    msg::{Quaternion, TFMessage, TransformStamped},
};
use glam::{DAffine2, dvec2};

const MOST_FRAMES: usize = 1024;

#[derive(Debug)]
struct Place {
    parent: String,
    pose: DAffine2,
    /// `None` for a static frame.
    heard: Option<Instant>,
}

#[derive(Debug, Default)]
pub struct Frames(BTreeMap<String, Place>);

impl Frames {
    /// Takes a `tf2_msgs/TFMessage` that arrived at `heard`, or is static.
    pub fn take(&mut self, payload: &[u8], heard: Option<Instant>) -> Result<(), String> {
        for TransformStamped { header, child_frame_id, transform } in
            TFMessage::decode(payload)?.transforms
        {
            let at = [transform.translation.x, transform.translation.y];
            let Quaternion { x, y, .. } = transform.rotation;
            let up = (1.0 - 2.0 * (x * x + y * y)).signum();
            let pose = placed(at, transform.rotation.heading().unwrap_or(f64::NAN))
                * DAffine2::from_scale(dvec2(1.0, up));
            let [parent, frame] = [&header.frame_id, &child_frame_id].map(|frame| name(frame));
            let is_known = self.0.contains_key(frame);
            if pose.is_finite() && (is_known || self.0.len() < MOST_FRAMES) {
                let parent = parent.to_owned();
                self.0.insert(frame.to_owned(), Place { parent, pose, heard });
            }
        }
        Ok(())
    }

    /// Returns the pose of `frame` in `root` via their common ancestor, from transforms since
    /// `since`.
    pub fn find(
        &self,
        frame: &str,
        root: &str,
        since: Option<Instant>,
    ) -> Result<DAffine2, String> {
        let [(ends, of_frames), (also_ends, of_roots)] =
            [frame, root].map(|it| self.climb(it, since));
        of_frames
            .iter()
            .find_map(|(common, pose)| {
                let (_, of_root) = of_roots.iter().find(|(other, _)| other == common)?;
                Some(of_root.inverse() * *pose)
            })
            .ok_or_else(|| {
                format!("no transforms join {frame:?} and {root:?}: {ends}, {also_ends}")
            })
    }

    /// Returns the pose of `frame` in each ancestor, and why the chain ends.
    fn climb<'a>(
        &'a self,
        frame: &'a str,
        since: Option<Instant>,
    ) -> (String, Vec<(&'a str, DAffine2)>) {
        let mut passed = vec![(name(frame), DAffine2::IDENTITY)];
        let mut last = passed[0];
        while let Some(place) = self.0.get(last.0) {
            let Place { parent, pose, heard } = place;
            if heard.is_some_and(|heard| Some(heard) < since) {
                return (
                    format!("the transform from {:?} to {parent:?} is outdated", last.0),
                    passed,
                );
            }
            if passed.len() > MOST_FRAMES {
                return (format!("the transforms from {frame:?} form a loop"), passed);
            }
            last = (parent, *pose * last.1);
            passed.push(last);
        }
        (format!("{:?} has no parent", last.0), passed)
    }
}

pub fn placed(at: [f64; 2], heading: f64) -> DAffine2 {
    DAffine2::from_angle_translation(heading, at.into())
}

/// Strips the leading slash of older nodes.
fn name(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

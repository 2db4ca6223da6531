//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.

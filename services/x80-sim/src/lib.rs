//! A simulated X80: the robot's side of the wire, its body, its sonar and the world around it.

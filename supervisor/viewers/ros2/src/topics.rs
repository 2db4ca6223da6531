//! Table of the bridge's topics, from which writers, readers and the guide's list are made.

use clap::ValueEnum;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Id {
    Tf,
    TfStatic,
    Pose,
    Odom,
    Map,
    MapUpdates,
    Path,
    Field,
    Movers,
    /// Scan of the sensor in this row of the mission. In the table, any row.
    Scan(usize),
    /// Range of the sensor in this row.
    Range(usize),
    Battery,
    Diagnostics,
    Rosout,
    Clock,
    GoalPose,
    InitialPose,
    Teleop,
    Stop,
}

/// Requests of other nodes that need the user's permission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Accept {
    /// Send the robot to targets: `goal_pose` and the action `navigate_to_pose`.
    Goals,
    /// Set the robot's pose: `initialpose`.
    Pose,
    /// Drive the robot by hand: `teleop`.
    Hand,
    /// Stop and resume the robot: `stop`.
    Stop,
}

/// Published transforms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Frames {
    /// `map` to `odom` to `base_link`.
    #[default]
    All,
    /// `map` to `odom`.
    Map,
}

pub struct Spec {
    pub id: Id,
    pub name: &'static str,
    pub message: [&'static str; 2],
    pub type_name: &'static str,
    pub definition: &'static str,
    /// Whether late readers get the newest message.
    pub is_latched: bool,
    /// Required permission, or `None` for a published topic.
    pub accepted_by: Option<Accept>,
    pub meaning: &'static str,
}

macro_rules! table {
    ($($id:expr => $name:literal, $package:ident / $message:ident, $latched:literal, $accept:expr, $meaning:literal;)*) => {
        pub const TABLE: &[Spec] = &[$(Spec {
            id: $id,
            name: $name,
            message: [stringify!($package), stringify!($message)],
            type_name: concat!(stringify!($package), "::msg::dds_::", stringify!($message), "_"),
            definition: ros2::msg::$message::DEFINITION,
            is_latched: $latched,
            accepted_by: $accept,
            meaning: $meaning,
        }),*];
    };
}

table! {
    Id::Tf => "tf", tf2_msgs / TFMessage, false, None,
        "transforms from `map` to `odom` to `base_link` (REP 105); with `--frames map` only `map` to `odom`, computed from the robot's pose in `odom`";
    Id::TfStatic => "tf_static", tf2_msgs / TFMessage, true, None,
        "transform from `base_link` to each sensor's frame, which has the sensor's name";
    Id::Pose => "pose", geometry_msgs / PoseWithCovarianceStamped, false, None,
        "estimated pose of the robot";
    Id::Odom => "odom", nav_msgs / Odometry, false, None,
        "pose without the corrections of fixes, and speeds; covariances from the mission's `[robot.odometry]`";
    Id::Map => "map", nav_msgs / OccupancyGrid, true, None,
        "safety map, at most once a second: 100 hazard, 99 its margin, 0 seen free, -1 unobserved";
    Id::MapUpdates => "map_updates", map_msgs / OccupancyGridUpdate, false, None,
        "changed windows of `map`";
    Id::Path => "path", nav_msgs / Path, false, None,
        "path along the field from the robot to its target";
    Id::Field => "field", visualization_msgs / MarkerArray, false, None,
        "directions of the field, one for several cells, and targets";
    Id::Movers => "movers", visualization_msgs / MarkerArray, false, None,
        "moving objects seen by the laser: a disc and the path of the next second; paler, the area within two standard deviations";
    Id::Scan(0) => "scan/SENSOR", sensor_msgs / LaserScan, false, None,
        "beams of each laser that the mission uses; `scan` if there is only one";
    Id::Range(0) => "range/SENSOR", sensor_msgs / Range, false, None,
        "each sonar and infrared ranger that the mission uses; too far and too near are infinite, as in scans (REP 117)";
    Id::Battery => "battery_state", sensor_msgs / BatteryState, false, None,
        "voltage of the motors' battery";
    Id::Diagnostics => "diagnostics", diagnostic_msgs / DiagnosticArray, false, None,
        "failsafe, battery, and each stage with its generation and last death";
    Id::Rosout => "/rosout", rcl_interfaces / Log, true, None,
        "events: deaths and stalls as errors, orders and arrivals as information";
    Id::Clock => "/clock", rosgraph_msgs / Clock, false, None,
        "with `--clock`: mission time, which is then also the stamp of every message";
    Id::GoalPose => "goal_pose", geometry_msgs / PoseStamped, false, Some(Accept::Goals),
        "goal, as RViz sends it; also enables the action `navigate_to_pose` (`nav2_msgs/NavigateToPose`)";
    Id::InitialPose => "initialpose", geometry_msgs / PoseWithCovarianceStamped, false, Some(Accept::Pose),
        "pose of a standing robot, as RViz sends it: sets the pose and resets the map";
    Id::Teleop => "teleop", geometry_msgs / Twist, false, Some(Accept::Hand),
        "drives a staying robot by hand and keeps it out of believed hazards; ends 0.3 s after the last message; to go back, the robot turns around";
    Id::Stop => "stop", std_msgs / Bool, false, Some(Accept::Stop),
        "true: stops the robot; false: lets it continue";
}

pub fn spec(id: Id) -> Option<&'static Spec> {
    let id = match id {
        Id::Range(_) => Id::Range(0),
        Id::Scan(_) => Id::Scan(0),
        id => id,
    };
    TABLE.iter().find(|spec| spec.id == id)
}

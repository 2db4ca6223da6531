//! Table of the bridge's topics. Writers, readers and the guide's list are made from it.

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
    /// Range of the sensor in this row, likewise.
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
    /// Message definition, as in recordings.
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
        "`map` to `odom` to `base_link`, as REP 105 has them; with `--frames map` the first alone, by the robot's place in the second";
    Id::TfStatic => "tf_static", tf2_msgs / TFMessage, true, None,
        "`base_link` to a frame of each sensor's name";
    Id::Pose => "pose", geometry_msgs / PoseWithCovarianceStamped, false, None,
        "where the robot believes it is";
    Id::Odom => "odom", nav_msgs / Odometry, false, None,
        "the pose without what fixes corrected, and the speeds, with covariances by the mission's `[robot.odometry]`";
    Id::Map => "map", nav_msgs / OccupancyGrid, true, None,
        "the safety map, at most once a second: 100 a hazard, 99 its margin, 0 seen free, -1 not looked at";
    Id::MapUpdates => "map_updates", map_msgs / OccupancyGridUpdate, false, None,
        "windows of it as they change";
    Id::Path => "path", nav_msgs / Path, false, None,
        "the way along the field from the robot to its target";
    Id::Field => "field", visualization_msgs / MarkerArray, false, None,
        "the field's directions, one for several cells, and the targets";
    Id::Movers => "movers", visualization_msgs / MarkerArray, false, None,
        "what moves, by the laser: its disc and its way of the next second; paler, where it is within two deviations";
    Id::Scan(0) => "scan/SENSOR", sensor_msgs / LaserScan, false, None,
        "the beams of each laser that the mission uses; `scan` of one alone";
    Id::Range(0) => "range/SENSOR", sensor_msgs / Range, false, None,
        "each sonar and infrared ranger that the mission uses; as in scans, too far and too near are infinite (REP 117)";
    Id::Battery => "battery_state", sensor_msgs / BatteryState, false, None,
        "the voltage of the battery that the motors drive on";
    Id::Diagnostics => "diagnostics", diagnostic_msgs / DiagnosticArray, false, None,
        "the failsafe, each stage with its generation and its last death, the battery";
    Id::Rosout => "/rosout", rcl_interfaces / Log, true, None,
        "what happens: deaths and stalls are errors, orders and arrivals are information";
    Id::Clock => "/clock", rosgraph_msgs / Clock, false, None,
        "with `--clock`: mission time, which the stamps of all messages are then";
    Id::GoalPose => "goal_pose", geometry_msgs / PoseStamped, false, Some(Accept::Goals),
        "where to go, as RViz's button sends it; the action `navigate_to_pose` (`nav2_msgs/NavigateToPose`) is taken too";
    Id::InitialPose => "initialpose", geometry_msgs / PoseWithCovarianceStamped, false, Some(Accept::Pose),
        "where the robot, which stands, is, as RViz's button sends it: its pose is set, and its map reset";
    Id::Teleop => "teleop", geometry_msgs / Twist, false, Some(Accept::Hand),
        "drive by hand a robot that stays, into no hazard that is believed, until 0.3 s pass without a message; it turns around to go back";
    Id::Stop => "stop", std_msgs / Bool, false, Some(Accept::Stop),
        "true: the robot stands; false: it goes on";
}

pub fn spec(id: Id) -> Option<&'static Spec> {
    let id = match id {
        Id::Range(_) => Id::Range(0),
        Id::Scan(_) => Id::Scan(0),
        id => id,
    };
    TABLE.iter().find(|spec| spec.id == id)
}

//! A topic as DDS knows it.

#[derive(Clone, Debug)]
pub struct Topic {
    /// The name in ROS, from the root.
    pub name: String,
    pub type_name: String,
    /// Beginning and end of its name in DDS.
    ends: [&'static str; 2],
}

impl Topic {
    /// The type is named as `nav_msgs::msg::dds_::Odometry_`.
    pub fn new(name: &str, type_name: &str) -> Self {
        Self { name: absolute(name), type_name: type_name.to_owned(), ends: ["rt", ""] }
    }

    /// A name in DDS, outside of the names of ROS.
    pub fn plain(name: &str, type_name: &str) -> Self {
        Self { name: name.to_owned(), type_name: type_name.to_owned(), ends: ["", ""] }
    }

    /// The requests and the replies of a service; its type is named as `action_msgs::srv::dds_::CancelGoal`.
    pub fn service(name: &str, type_name: &str) -> [Self; 2] {
        [("Request", ["rq", "Request"]), ("Response", ["rr", "Reply"])].map(|(part, ends)| Self {
            name: absolute(name),
            type_name: format!("{type_name}_{part}_"),
            ends,
        })
    }

    pub fn dds_name(&self) -> String {
        format!("{}{}{}", self.ends[0], self.name, self.ends[1])
    }
}

fn absolute(name: &str) -> String {
    format!("/{}", name.trim_start_matches('/'))
}

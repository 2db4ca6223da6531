//! Topic in DDS terms.

#[derive(Clone, Debug)]
pub struct Topic {
    /// ROS name from the root.
    pub name: String,
    pub type_name: String,
    /// Prefix and suffix of its DDS name.
    ends: [&'static str; 2],
}

impl Topic {
    /// Creates a topic with a type name such as `nav_msgs::msg::dds_::Odometry_`.
    pub fn new(name: &str, type_name: &str) -> Self {
        Self { name: absolute(name), type_name: type_name.to_owned(), ends: ["rt", ""] }
    }

    /// Creates a DDS topic outside the ROS names.
    pub fn plain(name: &str, type_name: &str) -> Self {
        Self { name: name.to_owned(), type_name: type_name.to_owned(), ends: ["", ""] }
    }

    /// Returns the topics of a service's requests and replies, with a type name such as
    /// `action_msgs::srv::dds_::CancelGoal`.
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

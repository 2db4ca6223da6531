//! A topic as DDS knows it.

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// The name in ROS, from the root.
    pub name: String,
    pub type_name: &'static str,
    /// Beginning and end of its name in DDS.
    ends: [&'static str; 2],
}

impl Topic {
    /// The type is named as `nav_msgs::msg::dds_::Odometry_`.
    pub fn new(name: &str, type_name: &'static str) -> Self {
        Self { name: absolute(name), type_name, ends: ["rt", ""] }
    }

    /// A name in DDS, outside of the names of ROS.
    pub fn plain(name: &str, type_name: &'static str) -> Self {
        Self { name: name.to_owned(), type_name, ends: ["", ""] }
    }

    pub fn service(name: &str, [request, reply]: [&'static str; 2]) -> [Self; 2] {
        [
            Self { name: absolute(name), type_name: request, ends: ["rq", "Request"] },
            Self { name: absolute(name), type_name: reply, ends: ["rr", "Reply"] },
        ]
    }

    pub fn dds_name(&self) -> String {
        format!("{}{}{}", self.ends[0], self.name, self.ends[1])
    }
}

fn absolute(name: &str) -> String {
    format!("/{}", name.trim_start_matches('/'))
}

//! A topic as DDS knows it.

/// A topic of messages, or one that carries the requests or the replies of a service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// The name in ROS, from the root.
    pub name: String,
    /// The name of its type in DDS.
    pub type_name: &'static str,
    /// The beginning and the end of its name in DDS.
    ends: [&'static str; 2],
}

impl Topic {
    /// A topic of messages of this type, such as `nav_msgs::msg::dds_::Odometry_`.
    pub fn new(name: &str, type_name: &'static str) -> Self {
        Self { name: absolute(name), type_name, ends: ["rt", ""] }
    }

    /// A topic outside of the names of ROS, by its name in DDS.
    pub fn plain(name: &str, type_name: &'static str) -> Self {
        Self { name: name.to_owned(), type_name, ends: ["", ""] }
    }

    /// The topics of a service: the requests of clients, and the replies.
    pub fn service(name: &str, [request, reply]: [&'static str; 2]) -> [Self; 2] {
        [
            Self { name: absolute(name), type_name: request, ends: ["rq", "Request"] },
            Self { name: absolute(name), type_name: reply, ends: ["rr", "Reply"] },
        ]
    }

    /// The name in DDS.
    pub fn dds_name(&self) -> String {
        format!("{}{}{}", self.ends[0], self.name, self.ends[1])
    }
}

fn absolute(name: &str) -> String {
    format!("/{}", name.trim_start_matches('/'))
}

//! The one executable.

#[cfg(test)]
mod picture;

fn main() {}

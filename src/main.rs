//! The command line of lloydar.

fn main() {}

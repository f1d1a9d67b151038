//! anisomap on the command line.

fn main() {}

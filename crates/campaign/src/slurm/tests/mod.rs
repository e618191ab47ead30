//! The executor against commands that lie, fail and hang.

mod fake;
mod losses;
mod submissions;

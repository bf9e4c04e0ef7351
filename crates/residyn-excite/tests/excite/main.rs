//! Designed motions, what they tell, and what logs do not tell.

// In tests a panic is the message.
#![allow(clippy::unwrap_used)]

mod expected;
mod figures;
mod limits;
mod logged;
mod support;

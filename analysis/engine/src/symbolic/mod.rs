//! The symbolic state space: sets of markings as decision diagrams, and the questions to them.
//!
//! Ten thousand machines have more markings than there are atoms, and yet a diagram of a few nodes for each place. Here
//! is the method for such nets: zero-suppressed decision diagrams (`zdd`, `algebra`, `cache`), one place a level in an
//! order that keeps neighbours together (`order`, `race`), transitions as lists of literals (`events`), reachability by
//! saturation (`saturation`), one step of all transitions (`image`), exact numbers (`count`), firing sequences (`walk`),
//! and what is found of a net as one value (`space`).
//!
//! Everything is written with stacks of its own, because nets have half a million levels, and everything that grows
//! claims its bytes, so that running out of either is a return value. Several places a level, by the invariants of the
//! net, would make smaller diagrams with larger nodes; it was put off, because one place a level needs no theory of the
//! net and is already fast.

pub mod algebra;
pub mod cache;
pub mod count;
pub mod events;
mod hubs;
pub mod image;
pub mod order;
pub mod race;
pub mod saturation;
pub mod space;
pub mod walk;
pub mod zdd;

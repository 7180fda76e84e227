//! The symbolic state space: sets of markings as decision diagrams, and the questions to them.
//!
//! Ten thousand machines have more markings than there are atoms, and yet a diagram of a few nodes for each place. Here
//! is the method for such nets: zero-suppressed decision diagrams (`zdd`, `algebra`, `cache`), one place a level in an
//! order that keeps neighbours together (`order`, `spectral`, `race`) or units whole (`units`), transitions
//! as lists of literals (`events`), reachability by saturation (`saturation`, `firing`), which takes several places at
//! once (`blocks`, `values`, `parts`), on a net whose places were merged (`merging`, `trial`) and are told apart in what
//! is found (`standing`, `exploring`), one step of all transitions (`image`), runs that go on for ever (`endless`), exact
//! numbers (`count`, `passing`), the fullest markings (`greatest`), firing sequences (`walk`, `layerwise`, `blockwise`),
//! sets as rows for others to read (`listing`), and what is found of a net as one value (`space`, `ordered`).
//!
//! Everything is written with stacks of its own, because nets have half a million levels, and everything that grows
//! claims its bytes, so that running out of either is a return value. Nodes with several places each, in a store of their
//! own, were rejected: what is many-valued in a net is a search's to know, and all else is simpler with one place a level.

mod abreast;
pub mod algebra;
mod blocks;
mod blockwise;
pub mod cache;
pub mod count;
mod endless;
pub mod events;
mod exploring;
mod firing;
mod greatest;
mod hubs;
pub mod image;
mod layerwise;
pub mod listing;
mod merging;
mod numbering;
pub mod order;
mod ordered;
mod parts;
mod passing;
pub mod race;
mod racer;
mod saturation;
pub mod space;
mod spectral;
mod standing;
mod thinning;
mod trial;
mod units;
mod values;
pub mod walk;
pub mod zdd;

//! Local CTL: does a formula hold in M0, decided by looking only at the markings that it asks about.
//!
//! Fixpoints over sets of markings need all markings. Whether one marking satisfies a formula often takes a few: a way to
//! a marking, a cycle, a deadlock. So each subformula is evaluated where it is asked for, depth first, and what was found
//! is kept by subformula and marking (Vergauwen, Lewi, "A linear local model checking algorithm for CTL", 1993):
//!
//! - `E[l U r]` looks for a marking with `r` through markings with `l`. All that is open on the way leads to the one that
//!   is found; a strongly connected component that is left without having met one leads to none. So each marking is
//!   settled the first time it is met (Gabow's version of Tarjan's algorithm).
//! - `A[l U r]` looks for a run that fails: a marking with neither, a deadlock without `r`, or a cycle without `r`. What is
//!   on the way then fails; what is left has succeeded.
//! - `EX p` looks at the next markings; all else is Boolean.
//!
//! A search inside a search may take all markings where the outer one needs it for nothing. So values are three: a search
//! that meets as many markings as it may ends *open*, whoever asks for it goes on without, and what was missed for it
//! is open too, never false (`search.rs`). Budgets grow from round to round, and what was settled in one stays.
//!
//! Rejected: dependency graphs with certain-zero values (Dalsgaard, Enevoldsen, Fogh, Jensen, Jepsen, Kaufmann, Larsen,
//! Nielsen, Olesen, Pastva, Srba 2017), which settle the same pairs by passing values along edges that all have to be
//! stored; games, which need as many.

pub mod formula;
pub mod search;
mod until;

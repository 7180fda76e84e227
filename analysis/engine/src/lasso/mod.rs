//! Lassos: does a run of the net satisfy an automaton, decided while the product of both is being walked.
//!
//! The automaton is a generalised Büchi automaton with marks on its edges. A *vertex* is a marking and a state of the
//! automaton; an edge of the product is a firing, or the stutter in a deadlock, together with an edge of the automaton
//! that admits it. A run is accepted iff some strongly connected component that is reached holds an edge with each mark.
//! The search goes depth first and keeps, for the components on its way, the marks that they hold so far; the moment one
//! has them all it ends (Couvreur 1999, "On-the-fly verification of linear temporal logic"; compared with its rivals by
//! Couvreur, Duret-Lutz, Poitrenaud 2005, "On-the-fly emptiness checks for generalized Büchi automata"). So a formula that
//! fails is refuted by the part of the space that was met up to then, often a few hundred markings of a net that no
//! memory holds; one that holds takes them all.
//!
//! A way found depth first is as long as the search was deep. So what is shown is looked for anew (`shortest.rs`):
//! breadth first, among the vertices that the search left open, from M0 to the component and around in it. All of it
//! lies there: from a closed vertex only closed ones are reached.
//!
//! Rejected: nested depth-first search (Courcoubetis, Vardi, Wolper, Yannakakis 1992), which knows one mark only, so
//! the automaton would have to be copied for each, and finds the cycle later; it would save the number of a vertex, four
//! bytes beside a marking and its slot.
//!
//! On request firings that can wait do (`sparing.rs`): a search that is quicker where it finds a run, and shows nothing
//! where it does not.

pub mod automaton;
mod product;
pub mod search;
mod shortest;
mod sparing;

//! Stubborn sets: from each marking only some of the firable transitions are fired, so few that independent firings
//! are followed in one order and not in all, and enough that what is asked for stays reachable.
//!
//! Sources: Valmari, "Stubborn sets for reduced state space generation" (1990); Kristensen, Schmidt, Valmari,
//! "Question-guided stubborn set methods for state properties" (2006); Valmari, Hansen, "Stubborn set intuition
//! explained" (2017). The rules are derived here anew, for exactly our firing rule.
//!
//! **Terms.** A literal is a place and a value. By Eq. (1) a transition is firable where its *conditions* are true: the
//! places of I and Gp full, those of O and Gi empty. Firing it *flips* the places of I and O, whose conditions become
//! false, and changes nothing else. *Needers* of a literal are the transitions with this condition, *makers* those whose
//! firing makes it true. Under the contact rule a maker of a literal needs its negation: (1) makers(not l) are among
//! needers(l). Transitions that never fire (a self-loop, a place wanted both full and empty by gates, contradicting
//! external literals) are left out of all this; other external gates are free.
//!
//! **Rules.** Let G be the markings asked for and M one outside of G. A set S of transitions is *stubborn* at M if
//! - (goal) every firing sequence from M into G fires some member of S;
//! - (disabled) for each member that is not firable, all makers of one of its false conditions are members;
//! - (firable) for each member that is firable and each place that it flips, all needers of the condition on that
//!   place are members.
//!
//! **Lemma.** If u1 ... un are no members, t is one, and u1 ... un t can be fired from M, then so can t u1 ... un, to the
//! same marking. Proof: were t not firable at M, then one of its conditions is false at M and, by (disabled), stays so
//! during u1 ... un, and t cannot be fired after. So t is firable at M. Let l be the condition on a place that t
//! flips. It is true at M. No ui needs l, by (firable), so none makes it false, by (1). So l is true all along, and no
//! ui, being firable there, needs its negation. Hence no ui has a condition on a place that t flips, nor flips one,
//! by (1): firing t first takes no condition from them, and flips commute.
//!
//! **Theorem.** If a marking of G can be reached from M by n firings, n > 0, then it can be reached by n - 1 firings
//! after some firable member of S. Proof: the sequence fires a member, by (goal); move the first one to the front. So
//! the graph in which only firable members are fired reaches G from M0 if the whole graph does, and at the same
//! distance; and if no firing leaves G, as with deadlocks, it holds *every* marking of G.
//!
//! The proof counts the firings that are left. So nothing can be put off for ever, no proviso on cycles is needed, and
//! breadth first gives shortest witnesses. S need not hold a firable transition: if it holds none, G cannot be reached.
//!
//! **The goals.** What satisfies (goal):
//! - a formula that is false at M: for a literal its makers, for a disjunction what its operands ask for together, for
//!   a conjunction what one of its false operands asks for;
//! - deadlock: the *key*, any transition firable at M, must lose a condition: the makers of the negations of its
//!   conditions;
//! - the firing of some of the transitions U, none of them firable at M: all of U, which (disabled) then serves. U may
//!   shrink in the course of a search: a set that is stubborn for U is so for less.
//!
//! Rejected: *strong* stubborn sets, in which every firable member must stay firable; they need the makers that close a
//! gate of any member too, here wanted of the key alone. The usual *weak* ones, in which the key is told from other
//! members by rules of its own, invite the error of an implementation without any key: here it is part of the
//! goal, and the lemma needs none. A relation of pairs of transitions "t can disable u" has the square of its size on a
//! place that many share; literals as nodes between them keep the closure linear in the net.

pub mod closure;
pub mod cover;
pub mod deletion;
pub mod dependencies;
pub mod effort;
pub mod formula;
pub mod marks;
pub mod relaxed;
pub mod search;
pub mod walk;
pub mod walker;

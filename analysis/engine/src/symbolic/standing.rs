//! What the places of a smaller net stand for.
//!
//! The places that one place stands for have levels of their own, one after the other, where it had one. So each node
//! of the small diagram becomes as many as it stands for places, and the diagram is larger by no more than that,
//! whatever the number of markings that come back.
//!
//! What stands in what is as deep as there were rounds of merging, so the recursion over that is bounded.

use super::zdd::{EMPTY, Node, Store};
use crate::budget::Stop;

/// What a place of the smaller net stands for, when it holds a token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stands {
    /// A place of the net.
    Place(u32),
    /// A token on exactly one of these.
    One(Vec<Stands>),
    /// A token on all of these.
    All(Vec<Stands>),
}

impl Stands {
    /// The places of the net, in the order of their levels from the highest to the lowest.
    pub(super) fn places(&self, found: &mut Vec<u32>) {
        match self {
            Stands::Place(place) => found.push(*place),
            Stands::One(all) | Stands::All(all) => all.iter().for_each(|each| each.places(found)),
        }
    }

    /// The markings in which it holds with those of one set below it, and is empty with those of the other one.
    pub(super) fn over(&self, store: &mut Store, level_of: &[u32], with: Node, without: Node) -> Result<Node, Stop> {
        match self {
            Stands::Place(place) => store.node(level_of[*place as usize], without, with),
            Stands::One(all) => {
                all.iter().rev().try_fold(without, |without, each| each.over(store, level_of, with, without))
            }
            Stands::All(all) => all.iter().enumerate().rev().try_fold(with, |with, (at, each)| {
                each.over(store, level_of, with, if at == 0 { without } else { EMPTY })
            }),
        }
    }
}

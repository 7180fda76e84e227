//! Numberings of the graph of places and transitions from one end to the other: Sloan's and Cuthill and McKee's.
//!
//! Both begin at a vertex that is far from another one, found by going to the farthest and back a few times. *Sloan* (1986)
//! takes next what keeps the front small and is far from the other end; *Cuthill and McKee* (1969) go by distance alone, of
//! lower degree first, and what they number is reversed. Exact numberings of least width were rejected: they are
//! intractable, and what comes out here is only where FORCE begins.

use std::collections::{BinaryHeap, VecDeque};

use super::order::{Graph, Order};

impl Graph {
    /// The vertices that can be reached, by distance; `distance` of those was `u32::MAX` and is set.
    fn by_distance(&self, from: u32, distance: &mut [u32]) -> Vec<u32> {
        let mut found = vec![from];
        distance[from as usize] = 0;
        let mut at = 0;
        while at < found.len() {
            let vertex = found[at];
            at += 1;
            for &next in self.next_to(vertex) {
                if distance[next as usize] == u32::MAX {
                    distance[next as usize] = distance[vertex as usize] + 1;
                    found.push(next);
                }
            }
        }
        found
    }

    /// One of two vertices of a component that are far from each other, and all of the component; leaves the distances
    /// from the other one.
    fn end_of(&self, from: u32, distance: &mut [u32]) -> (u32, Vec<u32>) {
        let (mut start, mut far) = (from, 0);
        let mut found = self.by_distance(start, distance);
        for _ in 0..4 {
            let last = found[found.len() - 1];
            let reach = distance[last as usize];
            let end = found
                .iter()
                .rev()
                .take_while(|&&vertex| distance[vertex as usize] == reach)
                .copied()
                .min_by_key(|&vertex| self.degree(vertex))
                .unwrap_or(last);
            if reach <= far && far > 0 {
                break;
            }
            found.iter().for_each(|&vertex| distance[vertex as usize] = u32::MAX);
            (start, far) = (end, reach);
            found = self.by_distance(start, distance);
        }
        let end = found[found.len() - 1];
        found.iter().for_each(|&vertex| distance[vertex as usize] = u32::MAX);
        (start, self.by_distance(end, distance))
    }

    fn only_places(&self, vertices: Vec<u32>) -> Order {
        vertices.into_iter().filter(|&vertex| (vertex as usize) < self.places).collect()
    }

    pub(super) fn sloan(&self) -> Order {
        const DEGREE: i32 = 2;
        const DISTANCE: i32 = 1;
        #[derive(Clone, Copy, PartialEq)]
        enum Status {
            Inactive,
            Preactive,
            Active,
            Numbered,
        }
        let count = self.vertices();
        let (mut distance, mut status) = (vec![u32::MAX; count], vec![Status::Inactive; count]);
        // What each vertex has, and what it has in the queue.
        let mut priority = vec![(0_i32, i32::MIN); count];
        let mut numbered = Vec::with_capacity(count);
        // Those of the greatest priority first, and of these the one with the least number.
        let mut queue: BinaryHeap<i64> = BinaryHeap::new();
        let entry = |priority: i32, vertex: u32| i64::from(priority) << 32 | i64::from(!vertex);
        let mut raised = Vec::new();
        for seed in 0..self.places as u32 {
            if status[seed as usize] != Status::Inactive {
                continue;
            }
            let (start, component) = self.end_of(seed, &mut distance);
            for &vertex in &component {
                let far = distance[vertex as usize] as i32;
                priority[vertex as usize].0 = DISTANCE * far - DEGREE * (self.degree(vertex) as i32 + 1);
            }
            status[start as usize] = Status::Preactive;
            queue.push(entry(priority[start as usize].0, start));
            while let Some(first) = queue.pop() {
                let vertex = !(first as u32);
                if status[vertex as usize] == Status::Numbered || first != entry(priority[vertex as usize].0, vertex) {
                    continue; // an older entry of a vertex whose priority rose
                }
                let mut raise = |at: u32, status: &mut [Status]| {
                    priority[at as usize].0 += DEGREE;
                    if status[at as usize] == Status::Inactive {
                        status[at as usize] = Status::Preactive;
                    }
                    raised.push(at);
                };
                if status[vertex as usize] == Status::Preactive {
                    for &next in self.next_to(vertex) {
                        if status[next as usize] != Status::Numbered {
                            raise(next, &mut status);
                        }
                    }
                }
                status[vertex as usize] = Status::Numbered;
                numbered.push(vertex);
                for &next in self.next_to(vertex) {
                    if status[next as usize] == Status::Preactive {
                        raise(next, &mut status);
                        status[next as usize] = Status::Active;
                        for &beyond in self.next_to(next) {
                            if status[beyond as usize] != Status::Numbered {
                                raise(beyond, &mut status);
                            }
                        }
                    }
                }
                // Most are raised several times at once.
                for at in raised.drain(..) {
                    let (now, queued) = &mut priority[at as usize];
                    if now != queued {
                        *queued = *now;
                        queue.push(entry(*now, at));
                    }
                }
            }
        }
        self.only_places(numbered)
    }

    pub(super) fn cuthill_mckee(&self) -> Order {
        let count = self.vertices();
        let mut distance = vec![u32::MAX; count];
        let mut seen = vec![false; count];
        let mut numbered = Vec::with_capacity(count);
        for seed in 0..self.places as u32 {
            if seen[seed as usize] {
                continue;
            }
            let (start, _) = self.end_of(seed, &mut distance);
            let mut queue = VecDeque::from([start]);
            seen[start as usize] = true;
            while let Some(vertex) = queue.pop_front() {
                numbered.push(vertex);
                let mut next: Vec<u32> =
                    self.next_to(vertex).iter().copied().filter(|&next| !seen[next as usize]).collect();
                next.sort_by_key(|&next| self.degree(next));
                for next in next {
                    if !std::mem::replace(&mut seen[next as usize], true) {
                        queue.push_back(next);
                    }
                }
            }
        }
        numbered.reverse();
        self.only_places(numbered)
    }
}

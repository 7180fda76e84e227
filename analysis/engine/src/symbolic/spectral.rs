//! An order of places along the slowest vibration of the net.
//!
//! Let each transition pull its places together by springs, one between each two. Of all ways in which the net can swing,
//! the slowest has the two ends of it move against each other, and what lies between in between: by how far a place moves,
//! it has its place in a row (Barnard, Pothen, Simon 1995: the eigenvector of the second smallest eigenvalue of the
//! Laplacian). Nothing local decides it. So where a net is a chain of parts that are all alike, each part comes out whole
//! and laid out like its neighbours. Numberings from an end, and FORCE, which only ever looks at what is next, fold such
//! parts into each other, and what that costs in the search grows with each part.
//!
//! The vector is found by inverse iteration: the matrix is factored once, row by row from the first entry that is not
//! zero (an envelope), in an order that is good already, so that the rows are short; each round is two passes over
//! them. Nets with long rows are left out: they have no order with short arcs. Rejected: Lanczos' method, which needs as
//! many passes over the arcs as the net is long, and more to keep its vectors apart.

use super::order::{Graph, Order};
use crate::budget::{Stop, Watch};

/// The entries that the envelope may have, and the multiplications that factoring it may take.
const ENTRIES_MAX: usize = 1 << 21;
const WORK_MAX: usize = 1 << 28;
/// The multiplications that are as much work as a look at the watch stands for.
const TICK: usize = 8;
/// The rounds of inverse iteration. Each shrinks what is left of the next eigenvector by the quotient of the two
/// eigenvalues; where they are equal, as of a ring, any mixture of both does.
const ROUNDS: usize = 30;
/// Added to the diagonal: to move a part of the net as a whole has the eigenvalue 0, and the factor needs them positive.
const SHIFT: f64 = 1e-9;

/// A symmetric matrix, of which each row begins with its first entry and ends on the diagonal.
struct Envelope {
    /// The column of the first entry of each row.
    first: Vec<usize>,
    /// Where each row begins, and one more for the end.
    starts: Vec<usize>,
    entries: Vec<f64>,
}

impl Envelope {
    /// An empty matrix with rows from these columns on; None where it is too large.
    fn new(first: Vec<usize>) -> Option<Self> {
        let (mut starts, mut work) = (vec![0], 0_usize);
        for (row, &column) in first.iter().enumerate() {
            let width = row + 1 - column;
            work = work.saturating_add(width * width);
            starts.push(starts[row] + width);
            if starts[row + 1] > ENTRIES_MAX || work > WORK_MAX {
                return None;
            }
        }
        let entries = vec![0.0; starts[first.len()]];
        Some(Envelope { first, starts, entries })
    }

    fn add(&mut self, row: usize, column: usize, value: f64) {
        self.entries[self.starts[row] + column - self.first[row]] += value;
    }

    /// The entries of a row from a column on, without the diagonal.
    fn row(&self, row: usize, from: usize) -> &[f64] {
        &self.entries[self.starts[row] + from - self.first[row]..self.starts[row + 1] - 1]
    }

    fn diagonal(&self, row: usize) -> f64 {
        self.entries[self.starts[row + 1] - 1]
    }

    /// Replaces the matrix by its Cholesky factor.
    fn factor(&mut self, watch: &mut Watch<'_>) -> Result<(), Stop> {
        for row in 0..self.first.len() {
            let width = row + 1 - self.first[row];
            watch.tick(1 + width * width / TICK)?;
            for column in self.first[row]..row {
                let from = self.first[row].max(self.first[column]);
                let pairs = self.row(row, from).iter().zip(self.row(column, from));
                let sum: f64 = pairs.map(|(a, b)| a * b).sum();
                let at = self.starts[row] + column - self.first[row];
                self.entries[at] = (self.entries[at] - sum) / self.diagonal(column);
            }
            let sum: f64 = self.row(row, self.first[row]).iter().map(|a| a * a).sum();
            self.entries[self.starts[row + 1] - 1] = (self.diagonal(row) - sum).max(SHIFT).sqrt();
        }
        Ok(())
    }

    /// Solves a system by the factor.
    fn solve(&self, vector: &mut [f64]) {
        for row in 0..self.first.len() {
            let known = &vector[self.first[row]..row];
            let sum: f64 = self.row(row, self.first[row]).iter().zip(known).map(|(a, b)| a * b).sum();
            vector[row] = (vector[row] - sum) / self.diagonal(row);
        }
        for row in (0..self.first.len()).rev() {
            let value = vector[row] / self.diagonal(row);
            vector[row] = value;
            let first = self.first[row];
            self.row(row, first).iter().zip(&mut vector[first..row]).for_each(|(a, other)| *other -= a * value);
        }
    }
}

impl Graph {
    /// The places along the slowest vibration, part by part where the net falls into parts; None where that is too large
    /// in the order that it begins with.
    pub(super) fn spectral(&self, order: &Order, watch: &mut Watch<'_>) -> Result<Option<Order>, Stop> {
        let mut position = vec![0; self.places];
        order.iter().enumerate().for_each(|(at, &place)| position[place as usize] = at);
        let mut first: Vec<usize> = (0..self.places).collect();
        let mut pairs = 0_usize;
        for t in self.places..self.vertices() {
            let ends = self.next_to(t as u32);
            pairs = pairs.saturating_add(ends.len() * ends.len());
            let least = ends.iter().map(|&place| position[place as usize]).min().unwrap_or(0);
            for &place in ends {
                let row = position[place as usize];
                first[row] = first[row].min(least);
            }
        }
        let Some(mut matrix) = Envelope::new(first).filter(|_| pairs <= WORK_MAX) else { return Ok(None) };
        let joined: Vec<Vec<usize>> = (self.places..self.vertices())
            .map(|t| {
                let mut at: Vec<usize> = self.next_to(t as u32).iter().map(|&place| position[place as usize]).collect();
                at.sort_unstable();
                at.dedup();
                at
            })
            .filter(|at| at.len() > 1)
            .collect();
        let part = parts(self.places, &joined);
        for at in &joined {
            watch.tick(1 + at.len() * at.len() / TICK)?;
            let pull = 1.0 / (at.len() - 1) as f64;
            for (end, &row) in at.iter().enumerate() {
                matrix.add(row, row, 1.0);
                at[..end].iter().for_each(|&column| matrix.add(row, column, -pull));
            }
        }
        (0..self.places).for_each(|row| matrix.add(row, row, SHIFT));
        matrix.factor(watch)?;
        let mut moves: Vec<f64> = (0..self.places).map(|at| at as f64).collect();
        for _ in 0..ROUNDS {
            watch.tick(1 + matrix.entries.len() / TICK)?;
            level_out(&mut moves, &part);
            matrix.solve(&mut moves);
        }
        let mut along: Vec<usize> = (0..self.places).collect();
        along.sort_by(|&a, &b| part[a].cmp(&part[b]).then(moves[a].total_cmp(&moves[b])));
        Ok(Some(along.into_iter().map(|at| order[at]).collect()))
    }
}

/// For each position the lowest one of those that hang together with it.
fn parts(places: usize, joined: &[Vec<usize>]) -> Vec<usize> {
    let mut part: Vec<usize> = (0..places).collect();
    fn root(part: &mut [usize], mut at: usize) -> usize {
        while part[at] != at {
            part[at] = part[part[at]];
            at = part[at];
        }
        at
    }
    for at in joined {
        for pair in at.windows(2) {
            let (one, other) = (root(&mut part, pair[0]), root(&mut part, pair[1]));
            part[one.max(other)] = one.min(other);
        }
    }
    (0..places).map(|at| root(&mut part, at)).collect()
}

/// Takes out of a vector what moves a part as a whole, and gives what is left of each part the length 1.
fn level_out(vector: &mut [f64], part: &[usize]) {
    let mut sums = vec![(0.0, 0.0); vector.len()];
    for (&value, &of) in vector.iter().zip(part) {
        sums[of] = (sums[of].0 + value, sums[of].1 + 1.0);
    }
    vector.iter_mut().zip(part).for_each(|(value, &of)| *value -= sums[of].0 / sums[of].1);
    sums.fill((0.0, 0.0));
    vector.iter().zip(part).for_each(|(&value, &of)| sums[of].0 += value * value);
    vector
        .iter_mut()
        .zip(part)
        .filter(|&(_, &of)| sums[of].0 > 0.0)
        .for_each(|(value, &of)| *value /= sums[of].0.sqrt());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::unwatched;
    use crate::net::Transition;

    fn along(net: &Graph, order: &Order) -> Option<Order> {
        let mut poll = unwatched;
        net.spectral(order, &mut Watch::new(None, &mut poll)).unwrap()
    }

    #[test]
    fn a_long_factorization_ends_in_time() {
        // Two thousand places of which each is joined to the one that comes a hundred later.
        let net = graph(2000, (0..1900).map(|at| (at, at + 100)));
        let order: Order = (0..2000).collect();
        let mut poll = |_| Err(Stop::Cancelled);
        assert_eq!(net.spectral(&order, &mut Watch::new(None, &mut poll)), Err(Stop::Cancelled));
    }

    fn graph(places: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Graph {
        let moves: Vec<Transition> =
            pairs.into_iter().map(|(from, to)| Transition::new(&[from], &[to], &[], &[], &[])).collect();
        Graph::new(places, &moves)
    }

    fn shuffled(places: u32) -> Order {
        (0..places).map(|at| at * 7 % places).collect()
    }

    #[test]
    fn a_chain_is_laid_out_along_itself_whatever_it_began_with() {
        let chain = graph(30, (0..29).map(|at| (at, at + 1)));
        let mut found = along(&chain, &shuffled(30)).unwrap();
        if found[0] != 0 {
            found.reverse();
        }
        assert!(found.is_sorted(), "{found:?}");
    }

    #[test]
    fn the_parts_of_a_net_come_one_after_the_other_each_along_itself() {
        // Two chains of ten, one of even and one of odd places, and two places that nothing joins.
        let apart = graph(22, (0..18).map(|at| (at, at + 2)));
        let found = along(&apart, &shuffled(22)).unwrap();
        let chains: Vec<Vec<u32>> =
            [0, 1].map(|odd| found.iter().copied().filter(|&at| at < 20 && at % 2 == odd).collect()).into();
        for mut chain in chains {
            let begin = found.iter().position(|place| *place == chain[0]).unwrap();
            assert_eq!(found[begin..begin + 10], chain);
            if chain[0] > chain[9] {
                chain.reverse();
            }
            assert!(chain.is_sorted(), "{found:?}");
        }
    }

    #[test]
    fn the_factor_solves_the_system() {
        let mut matrix = Envelope::new(vec![0, 0, 1, 0]).unwrap();
        let full = [[4.0, -1.0, 0.0, -2.0], [-1.0, 5.0, -1.0, 0.0], [0.0, -1.0, 3.0, -1.0], [-2.0, 0.0, -1.0, 6.0]];
        for (row, values) in full.iter().enumerate() {
            (matrix.first[row]..=row).for_each(|column| matrix.add(row, column, values[column]));
        }
        let mut poll = unwatched;
        matrix.factor(&mut Watch::new(None, &mut poll)).unwrap();
        let wanted = [1.0, -2.0, 3.0, 0.5];
        let mut vector = full.map(|row| row.iter().zip(wanted).map(|(a, b)| a * b).sum::<f64>());
        matrix.solve(&mut vector);
        assert!(vector.iter().zip(wanted).all(|(found, value)| (found - value).abs() < 1e-9), "{vector:?}");
    }

    #[test]
    fn long_rows_are_left_out() {
        let places = 1 << 12;
        let star = graph(places, (1..places as u32).map(|at| (0, at)));
        let order: Order = (0..places as u32).collect();
        assert!(along(&star, &order).is_none());
        assert!(along(&graph(0, []), &Vec::new()).unwrap().is_empty());
    }
}

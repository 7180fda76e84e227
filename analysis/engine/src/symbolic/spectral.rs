//! An order of places along the slowest vibration of the net.
//!
//! Let each transition pull its places together by springs, one between each two. Of all ways in which the net can swing,
//! the slowest has the two ends of it move against each other, and what lies between in between: by how far a place moves,
//! it has its place in a row (Barnard, Pothen, Simon 1995: the eigenvector of the second smallest eigenvalue of the
//! Laplacian). Nothing local decides it. So where a net is a chain of parts that are all alike, each part comes out whole and
//! laid out like its neighbours, where numberings from an end, and FORCE, which only ever looks at what is next, fold parts
//! into each other; of ten such parts one is hardly noticed, and all ten are a thousand times the work.
//!
//! The vector is found by inverse iteration: the matrix is factored once, row by row from the first entry that is not
//! zero (an envelope), in an order that is good already, so that the rows are short; each round is two passes over
//! them. Nets with long rows are left out: they have no order with short arcs. Rejected: Lanczos' method, which needs as
//! many passes over the arcs as the net is long, and more to keep its vectors apart.

use super::order::{Graph, Order};

/// The entries that the envelope may have, and the multiplications that factoring it may take.
const ENTRIES_MAX: usize = 1 << 21;
const WORK_MAX: usize = 1 << 28;
/// The rounds of inverse iteration: ends are nearer to each other than all else, so few are enough.
const ROUNDS: usize = 30;
/// What makes the matrix regular; the parts of a net that hang together would else be as loose as they are.
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
    fn factor(&mut self) {
        for row in 0..self.first.len() {
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
    pub(super) fn spectral(&self, order: &Order) -> Option<Order> {
        let mut position = vec![0; self.places];
        order.iter().enumerate().for_each(|(at, &place)| position[place as usize] = at);
        let joined: Vec<Vec<usize>> = (self.places..self.vertices())
            .map(|t| {
                let mut at: Vec<usize> = self.next_to(t as u32).iter().map(|&place| position[place as usize]).collect();
                at.sort_unstable();
                at.dedup();
                at
            })
            .filter(|at| at.len() > 1)
            .collect();
        let mut first: Vec<usize> = (0..self.places).collect();
        for at in &joined {
            at.iter().for_each(|&row| first[row] = first[row].min(at[0]));
        }
        let part = parts(self.places, &joined);
        let mut matrix = Envelope::new(first)?;
        if joined.iter().map(|at| at.len() * at.len()).sum::<usize>() > WORK_MAX {
            return None;
        }
        for at in &joined {
            let pull = 1.0 / (at.len() - 1) as f64;
            for (end, &row) in at.iter().enumerate() {
                matrix.add(row, row, 1.0);
                at[..end].iter().for_each(|&column| matrix.add(row, column, -pull));
            }
        }
        (0..self.places).for_each(|row| matrix.add(row, row, SHIFT));
        matrix.factor();
        let mut moves: Vec<f64> = (0..self.places).map(|at| at as f64).collect();
        for _ in 0..ROUNDS {
            level_out(&mut moves, &part);
            matrix.solve(&mut moves);
        }
        let mut along: Vec<usize> = (0..self.places).collect();
        along.sort_by(|&a, &b| part[a].cmp(&part[b]).then(moves[a].total_cmp(&moves[b])));
        Some(along.into_iter().map(|at| order[at]).collect())
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
    use crate::net::Transition;

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
        let mut found = chain.spectral(&shuffled(30)).unwrap();
        if found[0] != 0 {
            found.reverse();
        }
        assert!(found.is_sorted(), "{found:?}");
    }

    #[test]
    fn the_parts_of_a_net_come_one_after_the_other_each_along_itself() {
        // Two chains of ten, one of even and one of odd places, and two places that nothing joins.
        let apart = graph(22, (0..18).map(|at| (at, at + 2)));
        let found = apart.spectral(&shuffled(22)).unwrap();
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
        matrix.factor();
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
        assert!(star.spectral(&order).is_none());
        assert!(graph(0, []).spectral(&Vec::new()).unwrap().is_empty());
    }
}

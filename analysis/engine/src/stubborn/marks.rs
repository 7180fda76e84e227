//! A set of small numbers that is emptied in one step: each member bears the stamp of the present round.

/// A set of numbers below a bound.
#[derive(Clone, Debug)]
pub struct Marks {
    stamps: Vec<u32>,
    now: u32,
}

impl Marks {
    /// The empty set of numbers below `count`.
    pub fn new(count: usize) -> Self {
        Marks { stamps: vec![0; count], now: 1 }
    }

    /// The bound: how many numbers there are.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether there are no numbers at all.
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// Empties the set.
    pub fn clear(&mut self) {
        if self.now == u32::MAX {
            self.stamps.fill(0);
            self.now = 0;
        }
        self.now += 1;
    }

    /// Whether a number is in the set.
    #[inline(always)]
    pub fn has(&self, i: u32) -> bool {
        self.stamps[i as usize] == self.now
    }

    /// Adds a number; true if it is new.
    #[inline(always)]
    pub fn insert(&mut self, i: u32) -> bool {
        std::mem::replace(&mut self.stamps[i as usize], self.now) != self.now
    }

    /// Takes a number out.
    #[inline(always)]
    pub fn remove(&mut self, i: u32) {
        self.stamps[i as usize] = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cleared_set_is_empty_even_where_the_stamps_run_out() {
        let mut marks = Marks::new(3);
        marks.now = u32::MAX - 1;
        for _ in 0..3 {
            assert!(marks.insert(1) && !marks.insert(1) && marks.insert(2));
            marks.remove(2);
            assert!(marks.has(1) && !marks.has(0) && !marks.has(2));
            marks.clear();
            assert!(!marks.has(1) && !marks.has(2));
        }
    }
}

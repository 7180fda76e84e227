//! Effort: whether a costly attempt to make stubborn sets smaller is still worth making.
//!
//! What makes sets smaller depends on the net: on some a deep look at prices divides the markings by ten, on others it
//! never helps and doubles the time. So the successes of each attempt are counted, and one that hardly ever succeeds is
//! made now and then only. The count is of markings, not of time: the same net gives the same markings every time.

/// An attempt and its successes of late.
#[derive(Clone, Copy, Debug, Default)]
pub struct Effort {
    tried: u32,
    won: u32,
    asked: u32,
}

/// Successes that make an attempt worth it: one in so many.
const WORTH_ONE_IN: u32 = 16;
/// A hopeless attempt is made once in so many markings.
const HOPELESS_ONE_IN: u32 = 32;

impl Effort {
    /// Whether to make the attempt this time.
    pub fn is_worth_it(&mut self) -> bool {
        self.asked += 1;
        let hopeful = self.tried < 2 * WORTH_ONE_IN || self.won * WORTH_ONE_IN >= self.tried;
        if hopeful || self.asked >= HOPELESS_ONE_IN {
            self.asked = 0;
            return true;
        }
        false
    }

    /// How the attempt ended; old ones count less and less.
    pub fn note(&mut self, success: bool) {
        self.tried += 1;
        self.won += u32::from(success);
        if self.tried >= 16 * WORTH_ONE_IN {
            self.tried /= 2;
            self.won /= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_succeeds_is_tried_now_and_then_and_what_succeeds_again_often() {
        let mut effort = Effort::default();
        let mut tries = |markings: u32, success: bool| {
            (0..markings).filter(|_| effort.is_worth_it().then(|| effort.note(success)).is_some()).count()
        };
        tries(100, false);
        assert_eq!(tries(3200, false), 100);
        tries(1000, true);
        assert_eq!(tries(100, true), 100);
    }
}

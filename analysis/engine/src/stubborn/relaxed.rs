//! Relaxed plans: which transitions lead from a marking to some literals, if nothing that became true ever ceased to be.
//!
//! The relaxation of planning that ignores deletes (Hoffmann and Nebel, "The FF planning system", 2001): layer by layer,
//! each transition whose conditions all became true somewhere makes its literals true; then from the goal backwards, for
//! each literal one transition that made it true first. What comes out says which of many firable transitions have
//! something to do with the goal, through all that must happen before it, where counting false literals sees the last
//! step alone. That a literal is reached in no layer proves that it cannot become true after this marking.
//!
//! Among the transitions that make a literal true in the same layer one is drawn, so that plans from one marking differ.
//!
//! Cost: linear in the net for each plan. The rejected alternative, a plan for each successor to choose the best, as
//! planners do, looks at a hundred markings for one step of a walk.

use super::dependencies::{Dependencies, Literal, is_true, literal, negation};
use super::formula::Formula;
use super::marks::Marks;
use super::walker::{Target, Walker};
use crate::random::Random;

/// Firings along one relaxed plan before the next is made.
const PLAN_STEPS: usize = 64;
/// How many transitions are drawn before one is fired that moves what is to stay.
const DRAWS: usize = 8;
/// The work of plans after which a strict one looks for no more tokens that may stay: some hundredths of a second.
const HALVING: usize = 1 << 22;
const NEVER: u32 = u32::MAX;

/// Room for plans in one net.
pub(super) struct Relaxed<'a> {
    net: &'a Dependencies,
    /// For each literal the layer in which it becomes true, and a transition that makes it true there.
    layer: Vec<u32>,
    maker: Vec<u32>,
    missing: Vec<u32>,
    queue: Vec<Literal>,
    wanted: Marks,
    planned: Marks,
    /// Transitions that no plan may have.
    still: Marks,
}

impl<'a> Relaxed<'a> {
    /// For a net of so many places and transitions.
    pub(super) fn new(net: &'a Dependencies, places: usize, transitions: usize) -> Self {
        Relaxed {
            net,
            layer: vec![NEVER; 2 * places],
            maker: vec![NEVER; 2 * places],
            missing: vec![0; transitions],
            queue: Vec::new(),
            wanted: Marks::new(2 * places),
            planned: Marks::new(transitions),
            still: Marks::new(transitions),
        }
    }

    /// The transitions of a plan from a marking to all of some literals; false where there is none.
    pub(super) fn plan(&mut self, marking: &[u64], goal: &[Literal], random: &mut Random, into: &mut Vec<u32>) -> bool {
        into.clear();
        self.spread(marking, random);
        if goal.iter().any(|&l| self.layer[l as usize] == NEVER) {
            return false;
        }
        self.extract(goal, into);
        true
    }

    /// Lets no plan change these places, which make the literals true.
    fn hold(&mut self, places: &[&[Literal]]) {
        self.still.clear();
        for &l in places.iter().copied().flatten() {
            self.net.makers.of(negation(l)).iter().for_each(|&t| _ = self.still.insert(t));
        }
    }

    fn extract(&mut self, goal: &[Literal], into: &mut Vec<u32>) {
        into.clear();
        self.wanted.clear();
        self.planned.clear();
        let mut todo: Vec<Literal> = goal.to_vec();
        while let Some(l) = todo.pop() {
            if self.layer[l as usize] == 0 || !self.wanted.insert(l) {
                continue;
            }
            let t = self.maker[l as usize];
            if self.planned.insert(t) {
                into.push(t);
                todo.extend(self.net.conditions(t));
            }
        }
    }

    /// The literals of a formula that are the fewest layers away from a marking; false where there is no plan to any.
    fn nearest(
        &mut self,
        formula: &mut Formula,
        marking: &[u64],
        random: &mut Random,
        goal: &mut Vec<Literal>,
    ) -> bool {
        goal.clear();
        self.spread(marking, random);
        formula.cheapest(|l| u64::from(self.layer[l as usize]), random, goal)
    }

    /// The transitions of a plan from a marking to one that satisfies a formula; false where there is none.
    pub(super) fn plan_to(
        &mut self,
        formula: &mut Formula,
        marking: &[u64],
        random: &mut Random,
        into: &mut Vec<u32>,
    ) -> bool {
        let mut goal = Vec::new();
        let reached = self.nearest(formula, marking, random, &mut goal);
        self.extract(&goal, into);
        reached
    }

    /// The transitions of a plan from a marking to one in which no transition is firable, if places had the values that
    /// are drawn for this.
    ///
    /// Of each transition, in an order that is drawn, one condition must become false, or be so: the one that takes the
    /// fewest layers, unless it contradicts what was wanted before. False where nothing is left to want of one.
    pub(super) fn plan_to_deadlock(&mut self, marking: &[u64], random: &mut Random, into: &mut Vec<u32>) -> bool {
        self.spread(marking, random);
        let net = self.net;
        let count = self.missing.len();
        let mut chosen = Marks::new(self.layer.len());
        let mut goal: Vec<Literal> = Vec::new();
        let first = random.below(count.max(1));
        for t in (0..count).map(|k| ((k + first) % count) as u32).filter(|&t| net.able(t)) {
            let mut refused = net.conditions(t).iter().map(|&l| negation(l));
            if refused.clone().any(|l| chosen.has(l)) {
                continue;
            }
            let possible = refused.by_ref().filter(|&l| self.layer[l as usize] != NEVER && !chosen.has(negation(l)));
            match possible.min_by_key(|&l| (self.layer[l as usize], random.below(1 << 16))) {
                Some(l) => {
                    chosen.insert(l);
                    goal.push(l);
                }
                None => return false,
            }
        }
        self.extract(&goal, into);
        true
    }

    /// What the work of one plan is, for whoever counts it.
    pub(super) fn size(&self) -> usize {
        self.layer.len() + self.missing.len()
    }

    fn spread(&mut self, marking: &[u64], random: &mut Random) {
        let net = self.net;
        self.queue.clear();
        for l in 0..self.layer.len() as u32 {
            let holds = is_true(l, marking);
            self.layer[l as usize] = if holds { 0 } else { NEVER };
            if holds {
                self.queue.push(l);
            }
        }
        for t in 0..self.missing.len() as u32 {
            self.missing[t as usize] = if self.still.has(t) { NEVER } else { net.conditions(t).len() as u32 };
        }
        let mut next = 0;
        while let Some(&l) = self.queue.get(next) {
            next += 1;
            let layer = self.layer[l as usize] + 1;
            for &t in net.needers.of(l) {
                self.missing[t as usize] -= 1;
                if self.missing[t as usize] > 0 {
                    continue;
                }
                for &needed in net.flipped(t) {
                    let made = needed ^ 1;
                    let known = &mut self.layer[made as usize];
                    if *known == NEVER {
                        *known = layer;
                        self.maker[made as usize] = t;
                        self.queue.push(made);
                    } else if *known == layer && random.below(2) == 0 {
                        self.maker[made as usize] = t;
                    }
                }
            }
        }
    }
}

/// A relaxed plan that a walk follows, and is made anew when it has been followed for a while.
pub(super) struct Plan<'a> {
    relaxed: Relaxed<'a>,
    left: Vec<u32>,
    steps: usize,
    /// What the target was replaced by for this walk, in a strict one.
    goal: Vec<Literal>,
    /// What may be left as it is where it is so: tokens, and places empty that something only reads.
    restful: Vec<Literal>,
    /// Whether some of it is.
    strict: bool,
    /// Whether now and then something is fired that is not of the plan.
    stray: bool,
}

impl<'a> Plan<'a> {
    pub(super) fn new(net: &'a Dependencies, places: usize, transitions: usize) -> Self {
        let reads_empty = |p: u32| {
            let empty = literal(p, false);
            net.needers.of(empty).iter().any(|&t| !net.flipped(t).contains(&empty))
        };
        Plan {
            relaxed: Relaxed::new(net, places, transitions),
            left: Vec::new(),
            steps: 0,
            goal: Vec::new(),
            restful: (0..places as u32)
                .flat_map(|p| [Some(literal(p, true)), reads_empty(p).then_some(literal(p, false))])
                .flatten()
                .collect(),
            strict: false,
            stray: true,
        }
    }

    /// Lets go of the plan; the next may have all transitions.
    pub(super) fn forget(&mut self) {
        self.left.clear();
        self.relaxed.still.clear();
        self.strict = false;
        self.stray = true;
    }

    /// Lets go of the plan, and makes one to some literals that moves as few tokens of a marking as can be; the next leave
    /// the others where they are, too. False where there is no plan. Also the work.
    ///
    /// Where many do the same, a plan for one has others do a part of it, as if what they are asked for had no price. One
    /// that must find all others at rest is then on no such way. With these at rest it is. Who is at rest may also be seen
    /// by an empty place alone, above all in a reduced net. Which of all this must change is found by halving (Junker,
    /// "QuickXplain", 2004), in an order that is drawn. Each takes some plans, so where they are thousands, those that were
    /// not found by then may move with all that was not looked at.
    pub(super) fn freeze(&mut self, marking: &[u64], goal: &[Literal], random: &mut Random) -> (bool, usize) {
        self.forget();
        self.strict = true;
        self.stray = random.below(2) == 0;
        self.steps = PLAN_STEPS;
        let mut now: Vec<Literal> = self.restful.iter().copied().filter(|&l| is_true(l, marking)).collect();
        for i in (1..now.len()).rev() {
            now.swap(i, random.below(i + 1));
        }
        let mut work = 0;
        let mut there_is = |frozen: &[&[Literal]], plan: &mut Self, work: &mut usize| {
            *work += plan.size();
            plan.relaxed.hold(frozen);
            plan.relaxed.plan(marking, goal, random, &mut plan.left)
        };
        if !there_is(&[], self, &mut work) {
            return (false, work);
        }
        // What is behind `open` stays; before it, one after the other is found that must not.
        let mut open = now.len();
        let mut rest: Vec<Literal> = Vec::new();
        while !there_is(&[&now[..open], &rest], self, &mut work) {
            let (mut low, mut high) = (0, open);
            while high - low > 1 {
                let middle = (low + high) / 2;
                if there_is(&[&now[middle..open], &rest], self, &mut work) { high = middle } else { low = middle }
            }
            rest.extend(&now[high..open]);
            open = if work < HALVING { high - 1 } else { 0 };
        }
        (true, work)
    }

    /// Whether there is something left to do for the plan; of a strict one, now.
    pub(super) fn is_fresh(&self, walker: &Walker<'_>) -> bool {
        self.steps > 0 && self.left.iter().any(|&t| !self.strict || walker.may_fire(t))
    }

    /// Makes a plan from where a walk stands to some literals; false where there is none.
    pub(super) fn towards(&mut self, walker: &Walker<'_>, goal: &[Literal], random: &mut Random) -> bool {
        self.steps = PLAN_STEPS;
        self.relaxed.plan(&walker.marking, goal, random, &mut self.left)
    }

    /// What the work of making one is.
    pub(super) fn size(&self) -> usize {
        self.relaxed.size()
    }

    /// A transition of the plan that is firable, which is taken out of it; now and then, and where there is none, any.
    pub(super) fn follow(&mut self, walker: &Walker<'_>, random: &mut Random) -> u32 {
        self.steps = self.steps.saturating_sub(1);
        if (!self.stray || random.below(16) > 0) && !self.left.is_empty() {
            let (begin, count) = (random.below(self.left.len()), self.left.len());
            let firable = (begin..begin + count).map(|k| k % count).find(|&at| walker.may_fire(self.left[at]));
            if let Some(at) = firable {
                return self.left.swap_remove(at);
            }
        }
        for _ in 0..DRAWS {
            let t = walker.firable[random.below(walker.firable.len())];
            if !self.relaxed.still.has(t) {
                return t;
            }
        }
        walker.firable[random.below(walker.firable.len())]
    }

    /// Begins a walk from a marking along strict plans to literals that make a formula true; the work of it.
    pub(super) fn begin_strictly(&mut self, marking: &[u64], formula: &mut Formula, random: &mut Random) -> usize {
        let mut goal = std::mem::take(&mut self.goal);
        let is_near = self.relaxed.nearest(formula, marking, random, &mut goal);
        let work = if is_near { self.freeze(marking, &goal, random).1 } else { 0 };
        self.goal = goal;
        self.size() + formula.size() + work
    }

    /// The next transition of a plan to the target, none where a strict one cannot go on, and the work of finding it.
    pub(super) fn next(
        &mut self,
        walker: &Walker<'_>,
        target: &mut Target,
        random: &mut Random,
    ) -> (Option<u32>, usize) {
        let mut work = 0;
        if !self.is_fresh(walker) {
            self.steps = PLAN_STEPS;
            work = self.size() + target.size();
            let (marking, left) = (&walker.marking, &mut self.left);
            let is_planned = match target {
                Target::Formula(_) if self.strict => self.relaxed.plan(marking, &self.goal, random, left),
                Target::Formula(formula) => self.relaxed.plan_to(formula, marking, random, left),
                Target::Deadlock => self.relaxed.plan_to_deadlock(marking, random, left),
            };
            if self.strict && !is_planned {
                return (None, work);
            }
        }
        (Some(self.follow(walker, random)), work)
    }
}

#[cfg(test)]
mod tests {
    use super::super::formula::Node;
    use super::*;
    use crate::net::{Net, Transition};

    #[test]
    fn a_strict_plan_moves_no_token_that_may_stay() {
        // From 0 to 6 step by step, or from 1 at once with what comes to 8 when the token of 7 moves, which must be there.
        let mut transitions: Vec<Transition> = (0..6).map(|p| Transition::new(&[p], &[p + 1], &[], &[], &[])).collect();
        transitions.push(Transition::new(&[7], &[8], &[], &[], &[]));
        transitions.push(Transition::new(&[1], &[6], &[8], &[], &[]));
        let net = Net::new(11, transitions, &[0, 7, 9]).expect("well formed");
        let dependencies = Dependencies::new(&net);
        let goal = [literal(6, true), literal(7, true)];
        for seed in 0..20 {
            let mut random = Random::new(seed);
            let mut plan = Plan::new(&dependencies, 11, 8);
            let walker = Walker::new(&dependencies, &net.initial, 8);
            let made = |plan: &mut Plan<'_>| {
                let mut made = std::mem::take(&mut plan.left);
                made.sort_unstable();
                made
            };
            assert!(plan.towards(&walker, &goal, &mut random));
            assert_eq!(made(&mut plan), [0, 6, 7]);
            let (is_planned, work) = plan.freeze(&net.initial, &goal, &mut random);
            assert!(is_planned && (3 * plan.size()..=6 * plan.size()).contains(&work), "{work}");
            assert_eq!(made(&mut plan), [0, 1, 2, 3, 4, 5]);
            // What is fired beside the plan moves nothing that is at rest, where there is something else.
            let moves = (0..64).filter(|_| plan.follow(&walker, &mut random) == 6).count();
            assert!(moves < 4, "{moves} of 64");
            // What was at rest stays so in the next plans, and of others there is none.
            assert!(plan.towards(&walker, &goal, &mut random));
            assert_eq!(made(&mut plan), [0, 1, 2, 3, 4, 5]);
            assert!(!plan.towards(&walker, &[literal(8, true)], &mut random));
            assert!(plan.freeze(&net.initial, &[literal(8, true)], &mut random).0);
            assert_eq!(made(&mut plan), [6]);
            assert_eq!(plan.freeze(&net.initial, &[literal(10, true)], &mut random), (false, plan.size()));
            assert_eq!(plan.freeze(&net.initial, &[literal(0, true)], &mut random), (true, 2 * plan.size()));
            plan.forget();
            assert!(plan.towards(&walker, &[literal(8, true)], &mut random));
        }
    }

    #[test]
    fn of_thousands_of_tokens_that_must_move_a_strict_plan_finds_some() {
        const MANY: u32 = 1500;
        let transitions = (0..MANY).map(|p| Transition::new(&[p], &[p + MANY], &[], &[], &[])).collect();
        let tokens: Vec<u32> = (0..MANY).collect();
        let net = Net::new(2 * MANY as usize, transitions, &tokens).expect("well formed");
        let dependencies = Dependencies::new(&net);
        let goal: Vec<Literal> = (MANY..2 * MANY).map(|p| literal(p, true)).collect();
        let mut plan = Plan::new(&dependencies, 2 * MANY as usize, MANY as usize);
        let (is_planned, work) = plan.freeze(&net.initial, &goal, &mut Random::new(1));
        assert!(is_planned && (HALVING..HALVING + 20 * plan.size()).contains(&work), "{work}");
        assert_eq!(plan.left.len(), MANY as usize);
    }

    #[test]
    fn a_plan_holds_what_leads_to_the_goal_and_nothing_beside() {
        // 0 -> 1 -> 2 and beside it 0 -> 3; place 4 is never filled.
        let arc = |from, to| Transition::new(&[from], &[to], &[], &[], &[]);
        let net = Net::new(5, vec![arc(0, 3), arc(1, 2), arc(0, 1)], &[0]).expect("well formed");
        let dependencies = Dependencies::new(&net);
        let mut relaxed = Relaxed::new(&dependencies, 5, 3);
        let (mut plan, mut random) = (Vec::new(), Random::new(1));
        assert!(relaxed.plan(&net.initial, &[literal(2, true), literal(4, false)], &mut random, &mut plan));
        plan.sort_unstable();
        assert_eq!(plan, [1, 2]);
        assert!(!relaxed.plan(&net.initial, &[literal(4, true)], &mut random, &mut plan));
        assert!(relaxed.plan(&net.initial, &[literal(0, true)], &mut random, &mut plan));
        assert!(plan.is_empty());
        // Of 4 and 2 only the second can be had; and where 0, 1 and 2 are empty nothing is firable.
        let nodes = vec![Node::Literal(literal(4, true)), Node::Literal(literal(2, true)), Node::Any(vec![0, 1])];
        let mut formula = Formula::new(nodes, 5).expect("well formed");
        assert!(relaxed.plan_to(&mut formula, &net.initial, &mut random, &mut plan));
        plan.sort_unstable();
        assert_eq!(plan, [1, 2]);
        assert!(relaxed.plan_to_deadlock(&net.initial, &mut random, &mut plan));
        assert!(!plan.is_empty());
        let mut never = Formula::new(vec![Node::Literal(literal(4, true))], 5).expect("well formed");
        assert!(!relaxed.plan_to(&mut never, &net.initial, &mut random, &mut plan) && plan.is_empty());
    }
}

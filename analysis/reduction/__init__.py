"""Structural reductions: a smaller net that answers the same question, and the way back for the witness.

Most of what a net does has nothing to do with what is asked: a robot's path is twelve places, and whether the cell
can block depends on three of them. The rules of this folder take away what makes no difference, one transition or
place at a time, and note for each what a firing of the small net stands for in the given one. So a firing sequence
that is found in the small net is lifted, and replayed by the reference player, before anyone sees it.

    from firable.analysis.reduction.reduce import reduce_for_goal

    reduced = reduce_for_goal(net, parse_formula("robot.put_mc and mc.machining"))
    ...  # any technique on reduced.net and reduced.goal
    reduced.lift(firings)

The literature (Murata, Berthelot, and what model checkers make of them today: Thierry-Mieg 2020, "Structural
reductions revisited"; Bønneland and others 2019, "Stubborn versus structural reductions for Petri nets") states its
rules for ordinary nets, where a place always has room. Here a full output place blocks. Rather than to ask of a net
that it be free of contact, each transition is rewritten into literals that it needs and places that it flips
(`draft`); contact is then a need like any other, gates of both kinds are too, and each rule is proved anew in these
terms, in the essay of its file:

- `constants`: places that never change, transitions that never fire
- `relevance`: what the goal does not depend on
- `copies`: equal and complementary places, subsumed and duplicate transitions
- `early`: transitions that may as well fire at once
- `implied`: needs, places and transitions that follow from, or contradict, facts
- `agglomeration`: two transitions that may as well fire as one
- `pairs`: the facts, which literals are never true together

What a rule does it notes as a step, which a checker with conditions of its own takes again
(`firable.analysis.evidence.checking.reductions`). `reduce` applies the rules until none applies, `goals` is what they
preserve, `components` takes apart what is left, `deciding` puts all of it before any technique, and `reducer` keeps
what is proved of a net for the next question.

All of it is for interleaving: synchronous steps count how long things take, which no reduction leaves alone.
Rejected: reductions that change what is asked but keep a bound on the answer, since no verdict here is approximate;
and polyhedral reductions, which keep linear equations between the markings of the two nets, because what they gain is
mostly in counting tokens beyond one.
"""

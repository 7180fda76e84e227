; The voting protocol does what the central net does: for any net, any number of controllers and of rounds
; Each block asserts that its sentence does not hold, so the answer `unsat` proves it.
; The relations: what there is in a net, who holds what, what the coordinator knows, which messages were sent.
; A relation with a number, as marked.1, is what a step makes of it; a definition with one speaks of these.
; To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.
; It can be decided, for functions and what depends on what go one way through the sorts:
;   Place, Transition, Controller, Round, Coordinator.
(set-logic UF)
(declare-sort Place 0)
(declare-sort Round 0)
(declare-sort Transition 0)
(declare-sort Controller 0)
(declare-sort Coordinator 0)
(declare-fun marked (Place) Bool)
(declare-fun shadow (Place) Bool)
(declare-fun begun (Round) Bool)
(declare-fun asked (Round Transition) Bool)
(declare-fun heard (Round Transition Controller) Bool)
(declare-fun decided (Round) Bool)
(declare-fun committed (Round Transition) Bool)
(declare-fun noted (Round Transition Controller) Bool)
(declare-fun closed (Round) Bool)
(declare-fun promised (Round Transition Controller) Bool)
(declare-fun obeyed (Round Transition Controller) Bool)
(declare-fun stands (Transition Controller) Bool)
(declare-fun request (Round Transition Controller) Bool)
(declare-fun vote (Round Transition Controller) Bool)
(declare-fun commit-order (Round Transition Controller) Bool)
(declare-fun abort-order (Round Transition Controller) Bool)
(declare-fun acknowledgement (Round Transition Controller) Bool)
(declare-fun coordinator-of (Round) Coordinator)
(declare-fun decider (Transition) Coordinator)
(declare-fun behind (Transition Transition Controller) Bool)
(declare-fun lasting (Place) Bool)
(declare-fun coordinated (Transition) Bool)
(declare-fun input (Transition Place) Bool)
(declare-fun output (Transition Place) Bool)
(declare-fun permissive (Transition Place) Bool)
(declare-fun inhibitive (Transition Place) Bool)
(declare-fun clears (Transition Place) Bool)
(declare-fun takes-part (Transition Controller) Bool)
(declare-fun owner (Place) Controller)
(declare-fun home (Transition) Controller)
(declare-fun free (Transition Controller) Bool)
(declare-fun signal (Place) Bool)
(define-fun reads ((t Transition) (p Place)) Bool
  (or (input t p) (output t p) (permissive t p) (inhibitive t p)))
(define-fun writes ((t Transition) (p Place)) Bool
  (or (input t p) (output t p) (clears t p)))
(define-fun touches ((t Transition) (p Place)) Bool
  (or (reads t p) (writes t p)))
; assumed of every net: who owns a place that a coordinated transition moves or reads takes part in it (O3)
(assert (forall ((u Transition) (q Place)) (=> (and (coordinated u) (touches u q)) (takes-part u (owner q)))))
; assumed of every net: a local transition moves and reads places of its home alone
(assert (forall ((u Transition) (q Place)) (=> (and (not (coordinated u)) (touches u q)) (= (owner q) (home u)))))
; assumed of every net: a part that is free of promise is one of a coordinated transition
(assert (forall ((t Transition) (c Controller)) (=> (free t c) (and (coordinated t) (takes-part t c)))))
; assumed of every net: no other transition takes an input of a free part, or reads it full
(assert (forall ((t Transition) (c Controller) (p Place) (u Transition))
  (=> (and (free t c) (= (owner p) c) (not (= t u)) (input t p)) (and (not (input u p)) (not (permissive u p))))))
; assumed of every net: no other transition fills an output of a free part, or reads it empty
(assert (forall ((t Transition) (c Controller) (p Place) (u Transition))
  (=>
    (and (free t c) (= (owner p) c) (not (= t u)) (output t p))
    (and (not (output u p)) (not (inhibitive u p))))))
; assumed of every net: who reads a signal that a free part clears needs a place full that it fills
(assert (forall ((t Transition) (c Controller) (p Place) (u Transition))
  (=> (and (free t c) (= (owner p) c) (not (= t u)) (clears t p) (reads u p)) (behind u t c))))
; assumed of every net: what a command clears is a signal
(assert (forall ((t Transition) (p Place)) (=> (clears t p) (signal p))))
; assumed of every net: of signals a free part reads such alone, at 1, as fall by a command
(assert (forall ((t Transition) (c Controller) (p Place))
  (=>
    (and (free t c) (= (owner p) c) (signal p))
    (and (not (input t p)) (not (output t p)) (not (inhibitive t p)) (=> (permissive t p) (lasting p))))))
; invariant V1: a part with a vote stays promised until its order is obeyed
(define-fun inv-V1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote r t c) (not (obeyed r t c))) (promised r t c))))
; invariant V2: a promised part that may still be applied is enabled in its subnet
(define-fun part-enabled ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked q))
        (=> (or (output t q) (inhibitive t q)) (not (marked q)))))))
(define-fun inv-V2 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided r)) (committed r t))) (part-enabled t c))))
; invariant V3: promises of different rounds at one controller do not disturb each other
(define-fun disturb-at ((t Transition) (u Transition) (p Place)) Bool
  (or (and (writes t p) (reads u p)) (and (reads t p) (writes u p))))
(define-fun inv-V3 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round) (u Transition) (p Place))
    (=> (and (promised r t c) (promised s u c) (not (= r s)) (= (owner p) c)) (not (disturb-at t u p)))))
; invariant V4: a committed part stays promised until it is applied
(define-fun inv-V4 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed r t c))) (promised r t c))))
; invariant V5: a round commits one transition at most
(define-fun inv-V5 () Bool
  (forall ((r Round) (t Transition) (u Transition)) (=> (and (committed r t) (committed r u)) (= t u))))
; invariant S1: where a committed part is not yet applied, the shadow has moved the token
(define-fun inv-S1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed r t (owner p))) (writes t p)) (= (shadow p) (output t p)))))
; invariant S2: everywhere else the subnets hold what the shadow holds
(define-fun inv-S2 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed r t (owner p))) (writes t p))))
      (= (marked p) (shadow p)))))
; invariant F1: while a vote stands, the part has its inputs full and its outputs empty in its subnet
(define-fun inv-F1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=> (and (stands t c) (= (owner p) c)) (and (=> (input t p) (marked p)) (=> (output t p) (not (marked p)))))))
; invariant F2: a standing vote that counts holds in the central net
(define-fun underway ((r Round) (t Transition) (c Controller)) Bool
  (and (committed r t) (free t c) (not (obeyed r t c))))
(define-fun counts ((t Transition) (c Controller)) Bool
  (and (stands t c) (not (exists ((s Round)) (underway s t c)))))
(define-fun inv-F2 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
; invariant F3: a vote stands until the order is applied, one order at a time
(define-fun inv-F3 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway r t c) (and (stands t c) (=> (underway s t c) (= r s))))))
; invariant stands: votes stand of free parts alone
(define-fun inv-stands () Bool
  (forall ((t Transition) (c Controller)) (=> (stands t c) (free t c))))
; invariant asked: what is asked for is coordinated, in a round of who decides it that is begun
(define-fun inv-asked () Bool
  (forall ((r Round) (t Transition))
    (=> (asked r t) (and (begun r) (coordinated t) (= (coordinator-of r) (decider t))))))
; invariant decided: a round that is decided was begun
(define-fun inv-decided () Bool
  (forall ((r Round)) (=> (decided r) (begun r))))
; invariant committed: what is committed was asked for, in a round that is decided
(define-fun inv-committed () Bool
  (forall ((r Round) (t Transition)) (=> (committed r t) (and (decided r) (asked r t)))))
; invariant request: requests go to those who have to promise a part of what is asked for
(define-fun inv-request () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (request r t c) (and (asked r t) (takes-part t c) (not (free t c))))))
; invariant promised: a promise was requested, is voted for, and no order of it has been obeyed
(define-fun inv-promised () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised r t c) (and (request r t c) (vote r t c) (not (obeyed r t c))))))
; invariant heard: what the coordinator has heard was voted
(define-fun inv-heard () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (heard r t c) (vote r t c))))
; invariant commit-order: orders to commit are those of the committed transition, to all who take part
(define-fun inv-commit-order () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (commit-order r t c) (and (committed r t) (takes-part t c)))))
; invariant abort-order: orders to abort are those of whatever else had to be promised in a decided round
(define-fun inv-abort-order () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (abort-order r t c) (and (decided r) (asked r t) (not (committed r t)) (takes-part t c) (not (free t c))))))
; invariant obeyed: orders are obeyed in rounds that are decided
(define-fun inv-obeyed () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed r t c) (decided r))))
; invariant acknowledgement: who was asked, or ordered to commit, acknowledges what it has obeyed, and only that
(define-fun inv-acknowledgement () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement r t c) (and (or (request r t c) (commit-order r t c)) (obeyed r t c)))))
; invariant noted: what the coordinator notes was acknowledged
(define-fun inv-noted () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (noted r t c) (acknowledgement r t c))))
; invariant closed: a closed round is begun and decided
(define-fun inv-closed () Bool
  (forall ((r Round)) (=> (closed r) (and (begun r) (decided r)))))
; invariant closed-noted: in a closed round all have acknowledged
(define-fun inv-closed-noted () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (closed r) (asked r t) (takes-part t c) (or (not (free t c)) (committed r t))) (noted r t c))))
(define-fun invariant () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))

; the invariant holds at the start
(push 1)
(echo "protocol.starts")
(declare-fun initially (Place) Bool)
; given: the subnets hold the initial marking
(assert (forall ((q Place)) (= (marked q) (initially q))))
; given: the central net holds it too
(assert (forall ((q Place)) (= (shadow q) (initially q))))
; given: nothing is begun
(assert (forall ((s Round)) (not (begun s))))
; given: nothing is asked
(assert (forall ((s Round) (u Transition)) (not (asked s u))))
; given: nothing is heard
(assert (forall ((s Round) (u Transition) (d Controller)) (not (heard s u d))))
; given: nothing is decided
(assert (forall ((s Round)) (not (decided s))))
; given: nothing is committed
(assert (forall ((s Round) (u Transition)) (not (committed s u))))
; given: nothing is noted
(assert (forall ((s Round) (u Transition) (d Controller)) (not (noted s u d))))
; given: nothing is closed
(assert (forall ((s Round)) (not (closed s))))
; given: nothing is promised
(assert (forall ((s Round) (u Transition) (d Controller)) (not (promised s u d))))
; given: nothing is obeyed
(assert (forall ((s Round) (u Transition) (d Controller)) (not (obeyed s u d))))
; given: nothing is stands
(assert (forall ((u Transition) (d Controller)) (not (stands u d))))
; given: nothing is request
(assert (forall ((s Round) (u Transition) (d Controller)) (not (request s u d))))
; given: nothing is vote
(assert (forall ((s Round) (u Transition) (d Controller)) (not (vote s u d))))
; given: nothing is commit-order
(assert (forall ((s Round) (u Transition) (d Controller)) (not (commit-order s u d))))
; given: nothing is abort-order
(assert (forall ((s Round) (u Transition) (d Controller)) (not (abort-order s u d))))
; given: nothing is acknowledgement
(assert (forall ((s Round) (u Transition) (d Controller)) (not (acknowledgement s u d))))
; and what is to be shown does not hold
(assert (not invariant))
(check-sat)
(pop 1)

; 'ask' keeps the invariant
(push 1)
(echo "protocol.keeps.ask")
(declare-const t Transition)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; ask: it is coordinated
(assert (coordinated t))
; ask: the round is one of the coordinator that decides it
(assert (= (coordinator-of r) (decider t)))
; ask: the round is not decided
(assert (not (decided r)))
; begun after 'ask'
(define-fun begun.1 ((s Round)) Bool
  (or (begun s) (= s r)))
; asked after 'ask'
(define-fun asked.1 ((s Round) (u Transition)) Bool
  (or (asked s u) (and (= s r) (= u t))))
; request after 'ask'
(define-fun request.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (request s u d) (and (= s r) (= u t) (takes-part t d) (not (free t d)))))
(define-fun inv-asked.1 () Bool
  (forall ((r Round) (t Transition))
    (=> (asked.1 r t) (and (begun.1 r) (coordinated t) (= (coordinator-of r) (decider t))))))
(define-fun inv-decided.1 () Bool
  (forall ((r Round)) (=> (decided r) (begun.1 r))))
(define-fun inv-committed.1 () Bool
  (forall ((r Round) (t Transition)) (=> (committed r t) (and (decided r) (asked.1 r t)))))
(define-fun inv-request.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (request.1 r t c) (and (asked.1 r t) (takes-part t c) (not (free t c))))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised r t c) (and (request.1 r t c) (vote r t c) (not (obeyed r t c))))))
(define-fun inv-abort-order.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=
      (abort-order r t c)
      (and (decided r) (asked.1 r t) (not (committed r t)) (takes-part t c) (not (free t c))))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement r t c) (and (or (request.1 r t c) (commit-order r t c)) (obeyed r t c)))))
(define-fun inv-closed.1 () Bool
  (forall ((r Round)) (=> (closed r) (and (begun.1 r) (decided r)))))
(define-fun inv-closed-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (closed r) (asked.1 r t) (takes-part t c) (or (not (free t c)) (committed r t))) (noted r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked.1
    inv-decided.1
    inv-committed.1
    inv-request.1
    inv-promised.1
    inv-heard
    inv-commit-order
    inv-abort-order.1
    inv-obeyed
    inv-acknowledgement.1
    inv-noted
    inv-closed.1
    inv-closed-noted.1))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'promise' keeps the invariant
(push 1)
(echo "protocol.keeps.promise")
(declare-const c Controller)
(declare-const t Transition)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: 'promise' waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u c) (not (behind t u c)))))
; promise: a request of the round has arrived
(assert (request r t c))
; promise: no order of the round has been obeyed
(assert (not (obeyed r t c)))
; promise: the part is enabled in the subnet
(assert (part-enabled t c))
(define-fun undisturbed ((r Round) (t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (not (= s r)) (= (owner q) c)) (not (disturb-at t u q)))))
; promise: no promise of another round is disturbed (O1)
(assert (undisturbed r t c))
; promised after 'promise'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (promised s u d) (and (= s r) (= u t) (= d c))))
; vote after 'promise'
(define-fun vote.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (vote s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-V1.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote.1 r t c) (not (obeyed r t c))) (promised.1 r t c))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised.1 r t c) (or (not (decided r)) (committed r t))) (part-enabled t c))))
(define-fun inv-V3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round) (u Transition) (p Place))
    (=> (and (promised.1 r t c) (promised.1 s u c) (not (= r s)) (= (owner p) c)) (not (disturb-at t u p)))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed r t c))) (promised.1 r t c))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised.1 r t c) (and (request r t c) (vote.1 r t c) (not (obeyed r t c))))))
(define-fun inv-heard.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (heard r t c) (vote.1 r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1.1
    inv-V2.1
    inv-V3.1
    inv-V4.1
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised.1
    inv-heard.1
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'stand' keeps the invariant
(push 1)
(echo "protocol.keeps.stand")
(declare-const c Controller)
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: 'stand' waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u c) (not (behind t u c)))))
; stand: the part is free of promise
(assert (free t c))
; stand: the part is enabled in the subnet
(assert (part-enabled t c))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; stand: no promise is disturbed (O1)
(assert (undisturbed-locally t c))
; stands after 'stand'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (or (stands u d) (and (= u t) (= d c))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=> (and (stands.1 t c) (= (owner p) c)) (and (=> (input t p) (marked p)) (=> (output t p) (not (marked p)))))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands.1 t c) (not (exists ((s Round)) (underway s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway r t c) (and (stands.1 t c) (=> (underway s t c) (= r s))))))
(define-fun inv-stands.1 () Bool
  (forall ((t Transition) (c Controller)) (=> (stands.1 t c) (free t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1.1
    inv-F2.1
    inv-F3.1
    inv-stands.1
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'hear' keeps the invariant
(push 1)
(echo "protocol.keeps.hear")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; hear: a vote of the round has arrived
(assert (vote r t c))
; heard after 'hear'
(define-fun heard.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (heard s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-heard.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (heard.1 r t c) (vote r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard.1
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'decide' keeps the invariant
(push 1)
(echo "protocol.keeps.decide")
(declare-const t Transition)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun falsifies-at ((t Transition) (u Transition) (p Place)) Bool
  (or
    (and (or (input t p) (clears t p)) (or (input u p) (permissive u p)))
    (and (output t p) (or (output u p) (inhibitive u p)))))
; given: 'decide' takes no standing vote back (persists.decide)
(assert (forall ((u Transition) (d Controller) (q Place))
  (=> (and (counts u d) (not (= u t)) (= (owner q) d)) (not (falsifies-at t u q)))))
; decide: the round asks for it
(assert (asked r t))
; decide: the round is not decided
(assert (not (decided r)))
; decide: all who have to promise have voted yes
(assert (forall ((d Controller)) (=> (and (takes-part t d) (not (free t d))) (heard r t d))))
; decide: the votes of free parts stand
(assert (forall ((d Controller)) (=> (free t d) (stands t d))))
; decide: no earlier order of it to a free part is unacknowledged
(assert (forall ((s Round) (d Controller))
  (=> (and (free t d) (committed s t) (= (coordinator-of s) (coordinator-of r))) (noted s t d))))
; decided after 'decide'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (= s r)))
; committed after 'decide'
(define-fun committed.1 ((s Round) (u Transition)) Bool
  (or (committed s u) (and (= s r) (= u t))))
; commit-order after 'decide'
(define-fun commit-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (commit-order s u d) (and (= s r) (= u t) (takes-part t d))))
; abort-order after 'decide'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (abort-order s u d) (and (= s r) (asked r u) (not (= u t)) (takes-part u d) (not (free u d)))))
; shadow after 'decide'
(define-fun shadow.1 ((q Place)) Bool
  (or (output t q) (and (shadow q) (not (input t q)) (not (clears t q)))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided.1 r)) (committed.1 r t))) (part-enabled t c))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed.1 r t) (takes-part t c) (not (free t c)) (not (obeyed r t c))) (promised r t c))))
(define-fun inv-V5.1 () Bool
  (forall ((r Round) (t Transition) (u Transition)) (=> (and (committed.1 r t) (committed.1 r u)) (= t u))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed.1 r t) (not (obeyed r t (owner p))) (writes t p)) (= (shadow.1 p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed.1 r t) (not (obeyed r t (owner p))) (writes t p))))
      (= (marked p) (shadow.1 p)))))
(define-fun underway.1 ((r Round) (t Transition) (c Controller)) Bool
  (and (committed.1 r t) (free t c) (not (obeyed r t c))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands t c) (not (exists ((s Round)) (underway.1 s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow.1 p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow.1 p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway.1 r t c) (and (stands t c) (=> (underway.1 s t c) (= r s))))))
(define-fun inv-decided.1 () Bool
  (forall ((r Round)) (=> (decided.1 r) (begun r))))
(define-fun inv-committed.1 () Bool
  (forall ((r Round) (t Transition)) (=> (committed.1 r t) (and (decided.1 r) (asked r t)))))
(define-fun inv-commit-order.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (commit-order.1 r t c) (and (committed.1 r t) (takes-part t c)))))
(define-fun inv-abort-order.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=
      (abort-order.1 r t c)
      (and (decided.1 r) (asked r t) (not (committed.1 r t)) (takes-part t c) (not (free t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed r t c) (decided.1 r))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement r t c) (and (or (request r t c) (commit-order.1 r t c)) (obeyed r t c)))))
(define-fun inv-closed.1 () Bool
  (forall ((r Round)) (=> (closed r) (and (begun r) (decided.1 r)))))
(define-fun inv-closed-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (closed r) (asked r t) (takes-part t c) (or (not (free t c)) (committed.1 r t))) (noted r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4.1
    inv-V5.1
    inv-S1.1
    inv-S2.1
    inv-F1
    inv-F2.1
    inv-F3.1
    inv-stands
    inv-asked
    inv-decided.1
    inv-committed.1
    inv-request
    inv-promised
    inv-heard
    inv-commit-order.1
    inv-abort-order.1
    inv-obeyed.1
    inv-acknowledgement.1
    inv-noted
    inv-closed.1
    inv-closed-noted.1))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'give-up' keeps the invariant
(push 1)
(echo "protocol.keeps.give-up")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; give-up: the round is begun
(assert (begun r))
; give-up: the round is not decided
(assert (not (decided r)))
; decided after 'give-up'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (= s r)))
; abort-order after 'give-up'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (abort-order s u d) (and (= s r) (asked r u) (takes-part u d) (not (free u d)))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided.1 r)) (committed r t))) (part-enabled t c))))
(define-fun inv-decided.1 () Bool
  (forall ((r Round)) (=> (decided.1 r) (begun r))))
(define-fun inv-committed.1 () Bool
  (forall ((r Round) (t Transition)) (=> (committed r t) (and (decided.1 r) (asked r t)))))
(define-fun inv-abort-order.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=
      (abort-order.1 r t c)
      (and (decided.1 r) (asked r t) (not (committed r t)) (takes-part t c) (not (free t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed r t c) (decided.1 r))))
(define-fun inv-closed.1 () Bool
  (forall ((r Round)) (=> (closed r) (and (begun r) (decided.1 r)))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided.1
    inv-committed.1
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order.1
    inv-obeyed.1
    inv-acknowledgement
    inv-noted
    inv-closed.1
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'restart' keeps the invariant
(push 1)
(echo "protocol.keeps.restart")
(declare-const k Coordinator)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; decided after 'restart'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (and (begun s) (= (coordinator-of s) k))))
; abort-order after 'restart'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or
    (abort-order s u d)
    (and (asked s u) (takes-part u d) (not (free u d)) (not (decided s)) (= (coordinator-of s) k))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided.1 r)) (committed r t))) (part-enabled t c))))
(define-fun inv-decided.1 () Bool
  (forall ((r Round)) (=> (decided.1 r) (begun r))))
(define-fun inv-committed.1 () Bool
  (forall ((r Round) (t Transition)) (=> (committed r t) (and (decided.1 r) (asked r t)))))
(define-fun inv-abort-order.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=
      (abort-order.1 r t c)
      (and (decided.1 r) (asked r t) (not (committed r t)) (takes-part t c) (not (free t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed r t c) (decided.1 r))))
(define-fun inv-closed.1 () Bool
  (forall ((r Round)) (=> (closed r) (and (begun r) (decided.1 r)))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided.1
    inv-committed.1
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order.1
    inv-obeyed.1
    inv-acknowledgement
    inv-noted
    inv-closed.1
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'apply' keeps the invariant
(push 1)
(echo "protocol.keeps.apply")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; apply: the order to commit has arrived
(assert (commit-order r t c))
; apply: it is promised
(assert (promised r t c))
; marked after 'apply'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; promised after 'apply'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'apply'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-V1.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote r t c) (not (obeyed.1 r t c))) (promised.1 r t c))))
(define-fun part-enabled.1 ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked.1 q))
        (=> (or (output t q) (inhibitive t q)) (not (marked.1 q)))))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised.1 r t c) (or (not (decided r)) (committed r t))) (part-enabled.1 t c))))
(define-fun inv-V3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round) (u Transition) (p Place))
    (=> (and (promised.1 r t c) (promised.1 s u c) (not (= r s)) (= (owner p) c)) (not (disturb-at t u p)))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed.1 r t c))) (promised.1 r t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p)) (= (shadow p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p))))
      (= (marked.1 p) (shadow p)))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (stands t c) (= (owner p) c))
      (and (=> (input t p) (marked.1 p)) (=> (output t p) (not (marked.1 p)))))))
(define-fun underway.1 ((r Round) (t Transition) (c Controller)) Bool
  (and (committed r t) (free t c) (not (obeyed.1 r t c))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands t c) (not (exists ((s Round)) (underway.1 s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway.1 r t c) (and (stands t c) (=> (underway.1 s t c) (= r s))))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised.1 r t c) (and (request r t c) (vote r t c) (not (obeyed.1 r t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed.1 r t c) (decided r))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement.1 r t c) (and (or (request r t c) (commit-order r t c)) (obeyed.1 r t c)))))
(define-fun inv-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (noted r t c) (acknowledgement.1 r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1.1
    inv-V2.1
    inv-V3.1
    inv-V4.1
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1.1
    inv-F2.1
    inv-F3.1
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised.1
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed.1
    inv-acknowledgement.1
    inv-noted.1
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'apply-free' keeps the invariant
(push 1)
(echo "protocol.keeps.apply-free")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; apply-free: the order to commit has arrived
(assert (commit-order r t c))
; apply-free: the part is free of promise
(assert (free t c))
; apply-free: no order of the round has been obeyed
(assert (not (obeyed r t c)))
; marked after 'apply-free'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; stands after 'apply-free'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (and (stands u d) (not (and (= u t) (= d c)))))
; obeyed after 'apply-free'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply-free'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-V1.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote r t c) (not (obeyed.1 r t c))) (promised r t c))))
(define-fun part-enabled.1 ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked.1 q))
        (=> (or (output t q) (inhibitive t q)) (not (marked.1 q)))))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided r)) (committed r t))) (part-enabled.1 t c))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed.1 r t c))) (promised r t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p)) (= (shadow p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p))))
      (= (marked.1 p) (shadow p)))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (stands.1 t c) (= (owner p) c))
      (and (=> (input t p) (marked.1 p)) (=> (output t p) (not (marked.1 p)))))))
(define-fun underway.1 ((r Round) (t Transition) (c Controller)) Bool
  (and (committed r t) (free t c) (not (obeyed.1 r t c))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands.1 t c) (not (exists ((s Round)) (underway.1 s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway.1 r t c) (and (stands.1 t c) (=> (underway.1 s t c) (= r s))))))
(define-fun inv-stands.1 () Bool
  (forall ((t Transition) (c Controller)) (=> (stands.1 t c) (free t c))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised r t c) (and (request r t c) (vote r t c) (not (obeyed.1 r t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed.1 r t c) (decided r))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement.1 r t c) (and (or (request r t c) (commit-order r t c)) (obeyed.1 r t c)))))
(define-fun inv-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (noted r t c) (acknowledgement.1 r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1.1
    inv-V2.1
    inv-V3
    inv-V4.1
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1.1
    inv-F2.1
    inv-F3.1
    inv-stands.1
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised.1
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed.1
    inv-acknowledgement.1
    inv-noted.1
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'release' keeps the invariant
(push 1)
(echo "protocol.keeps.release")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; release: the order to abort has arrived
(assert (abort-order r t c))
; promised after 'release'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'release'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'release'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-V1.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote r t c) (not (obeyed.1 r t c))) (promised.1 r t c))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised.1 r t c) (or (not (decided r)) (committed r t))) (part-enabled t c))))
(define-fun inv-V3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round) (u Transition) (p Place))
    (=> (and (promised.1 r t c) (promised.1 s u c) (not (= r s)) (= (owner p) c)) (not (disturb-at t u p)))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed.1 r t c))) (promised.1 r t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p)) (= (shadow p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p))))
      (= (marked p) (shadow p)))))
(define-fun underway.1 ((r Round) (t Transition) (c Controller)) Bool
  (and (committed r t) (free t c) (not (obeyed.1 r t c))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands t c) (not (exists ((s Round)) (underway.1 s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway.1 r t c) (and (stands t c) (=> (underway.1 s t c) (= r s))))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised.1 r t c) (and (request r t c) (vote r t c) (not (obeyed.1 r t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed.1 r t c) (decided r))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement.1 r t c) (and (or (request r t c) (commit-order r t c)) (obeyed.1 r t c)))))
(define-fun inv-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (noted r t c) (acknowledgement.1 r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1.1
    inv-V2.1
    inv-V3.1
    inv-V4.1
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1
    inv-F2.1
    inv-F3.1
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised.1
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed.1
    inv-acknowledgement.1
    inv-noted.1
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'note' keeps the invariant
(push 1)
(echo "protocol.keeps.note")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; note: an acknowledgement of the round has arrived
(assert (acknowledgement r t c))
; noted after 'note'
(define-fun noted.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (noted s u d) (and (= s r) (= u t) (= d c))))
(define-fun inv-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (noted.1 r t c) (acknowledgement r t c))))
(define-fun inv-closed-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (closed r) (asked r t) (takes-part t c) (or (not (free t c)) (committed r t))) (noted.1 r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted.1
    inv-closed
    inv-closed-noted.1))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'close' keeps the invariant
(push 1)
(echo "protocol.keeps.close")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; close: the round is decided
(assert (decided r))
; close: all who got an order have obeyed
(assert (forall ((u Transition) (d Controller))
  (=> (and (asked r u) (takes-part u d) (or (not (free u d)) (committed r u))) (noted r u d))))
; closed after 'close'
(define-fun closed.1 ((s Round)) Bool
  (or (closed s) (= s r)))
(define-fun inv-closed.1 () Bool
  (forall ((r Round)) (=> (closed.1 r) (and (begun r) (decided r)))))
(define-fun inv-closed-noted.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (closed.1 r) (asked r t) (takes-part t c) (or (not (free t c)) (committed r t))) (noted r t c))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2
    inv-F1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed.1
    inv-closed-noted.1))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'forget' keeps the invariant
(push 1)
(echo "protocol.keeps.forget")
(declare-const r Round)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; forget: a message says that the round is closed
(assert (closed r))
; obeyed after 'forget'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= d c))))
(define-fun inv-V1.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (vote r t c) (not (obeyed.1 r t c))) (promised r t c))))
(define-fun inv-V4.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (committed r t) (takes-part t c) (not (free t c)) (not (obeyed.1 r t c))) (promised r t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p)) (= (shadow p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed.1 r t (owner p))) (writes t p))))
      (= (marked p) (shadow p)))))
(define-fun underway.1 ((r Round) (t Transition) (c Controller)) Bool
  (and (committed r t) (free t c) (not (obeyed.1 r t c))))
(define-fun counts.1 ((t Transition) (c Controller)) Bool
  (and (stands t c) (not (exists ((s Round)) (underway.1 s t c)))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts.1 t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow p)))))))
(define-fun inv-F3.1 () Bool
  (forall ((r Round) (t Transition) (c Controller) (s Round))
    (=> (underway.1 r t c) (and (stands t c) (=> (underway.1 s t c) (= r s))))))
(define-fun inv-promised.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (promised r t c) (and (request r t c) (vote r t c) (not (obeyed.1 r t c))))))
(define-fun inv-obeyed.1 () Bool
  (forall ((r Round) (t Transition) (c Controller)) (=> (obeyed.1 r t c) (decided r))))
(define-fun inv-acknowledgement.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (= (acknowledgement r t c) (and (or (request r t c) (commit-order r t c)) (obeyed.1 r t c)))))
(define-fun invariant.1 () Bool
  (and
    inv-V1.1
    inv-V2
    inv-V3
    inv-V4.1
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1
    inv-F2.1
    inv-F3.1
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised.1
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed.1
    inv-acknowledgement.1
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'fire' keeps the invariant
(push 1)
(echo "protocol.keeps.fire")
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: 'fire' waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u (home t)) (not (behind t u (home t))))))
(define-fun falsifies-at ((t Transition) (u Transition) (p Place)) Bool
  (or
    (and (or (input t p) (clears t p)) (or (input u p) (permissive u p)))
    (and (output t p) (or (output u p) (inhibitive u p)))))
; given: 'fire' takes no standing vote back (persists.fire)
(assert (forall ((u Transition) (d Controller) (q Place))
  (=> (and (counts u d) (not (= u t)) (= (owner q) d)) (not (falsifies-at t u q)))))
; fire: it is local
(assert (not (coordinated t)))
; fire: it is enabled in the subnet of its home
(assert (part-enabled t (home t)))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; fire: no promise is disturbed (O1)
(assert (undisturbed-locally t (home t)))
; marked after 'fire'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) (home t)) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) (home t))) (marked q))))
; shadow after 'fire'
(define-fun shadow.1 ((q Place)) Bool
  (or (output t q) (and (shadow q) (not (input t q)) (not (clears t q)))))
(define-fun part-enabled.1 ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked.1 q))
        (=> (or (output t q) (inhibitive t q)) (not (marked.1 q)))))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided r)) (committed r t))) (part-enabled.1 t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed r t (owner p))) (writes t p)) (= (shadow.1 p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed r t (owner p))) (writes t p))))
      (= (marked.1 p) (shadow.1 p)))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (stands t c) (= (owner p) c))
      (and (=> (input t p) (marked.1 p)) (=> (output t p) (not (marked.1 p)))))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow.1 p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow.1 p)))))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1.1
    inv-F2.1
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'sense' keeps the invariant
(push 1)
(echo "protocol.keeps.sense")
(declare-const p Place)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; sense: it is a signal
(assert (signal p))
; sense: no promise reads or clears it
(assert (forall ((s Round) (u Transition)) (=> (promised s u (owner p)) (not (touches u p)))))
; sense: it does not fall where only a command may clear it
(assert (not (and (lasting p) (marked p))))
; sense: no free part that is decided and not yet applied clears it
(assert (forall ((s Round) (u Transition)) (=> (underway s u (owner p)) (not (clears u p)))))
; marked after 'sense'
(define-fun marked.1 ((q Place)) Bool
  (or (and (= q p) (not (marked q))) (and (not (= q p)) (marked q))))
; shadow after 'sense'
(define-fun shadow.1 ((q Place)) Bool
  (or (and (= q p) (not (shadow q))) (and (not (= q p)) (shadow q))))
(define-fun part-enabled.1 ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked.1 q))
        (=> (or (output t q) (inhibitive t q)) (not (marked.1 q)))))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided r)) (committed r t))) (part-enabled.1 t c))))
(define-fun inv-S1.1 () Bool
  (forall ((r Round) (t Transition) (p Place))
    (=> (and (committed r t) (not (obeyed r t (owner p))) (writes t p)) (= (shadow.1 p) (output t p)))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed r t (owner p))) (writes t p))))
      (= (marked.1 p) (shadow.1 p)))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (stands t c) (= (owner p) c))
      (and (=> (input t p) (marked.1 p)) (=> (output t p) (not (marked.1 p)))))))
(define-fun inv-F2.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (counts t c) (= (owner p) c))
      (and
        (=> (or (input t p) (permissive t p)) (shadow.1 p))
        (=> (or (output t p) (inhibitive t p)) (not (shadow.1 p)))))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4
    inv-V5
    inv-S1.1
    inv-S2.1
    inv-F1.1
    inv-F2.1
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; 'sense-late' keeps the invariant
(push 1)
(echo "protocol.keeps.sense-late")
(declare-const p Place)
(declare-const r Round)
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; sense-late: it is a signal
(assert (signal p))
; sense-late: a free part that is decided and not yet applied clears it
(assert (and (underway r t (owner p)) (clears t p)))
; marked after 'sense-late'
(define-fun marked.1 ((q Place)) Bool
  (or (and (= q p) (not (marked q))) (and (not (= q p)) (marked q))))
(define-fun part-enabled.1 ((t Transition) (c Controller)) Bool
  (forall ((q Place))
    (=>
      (= (owner q) c)
      (and
        (=> (or (input t q) (permissive t q)) (marked.1 q))
        (=> (or (output t q) (inhibitive t q)) (not (marked.1 q)))))))
(define-fun inv-V2.1 () Bool
  (forall ((r Round) (t Transition) (c Controller))
    (=> (and (promised r t c) (or (not (decided r)) (committed r t))) (part-enabled.1 t c))))
(define-fun inv-S2.1 () Bool
  (forall ((p Place))
    (=>
      (not (exists ((r Round) (t Transition)) (and (committed r t) (not (obeyed r t (owner p))) (writes t p))))
      (= (marked.1 p) (shadow p)))))
(define-fun inv-F1.1 () Bool
  (forall ((t Transition) (c Controller) (p Place))
    (=>
      (and (stands t c) (= (owner p) c))
      (and (=> (input t p) (marked.1 p)) (=> (output t p) (not (marked.1 p)))))))
(define-fun invariant.1 () Bool
  (and
    inv-V1
    inv-V2.1
    inv-V3
    inv-V4
    inv-V5
    inv-S1
    inv-S2.1
    inv-F1.1
    inv-F2
    inv-F3
    inv-stands
    inv-asked
    inv-decided
    inv-committed
    inv-request
    inv-promised
    inv-heard
    inv-commit-order
    inv-abort-order
    inv-obeyed
    inv-acknowledgement
    inv-noted
    inv-closed
    inv-closed-noted))
; and what is to be shown does not hold
(assert (not invariant.1))
(check-sat)
(pop 1)

; what is enabled at its controller waits for no place that a free part fills whose vote stands
(push 1)
(echo "protocol.waits.enabled")
(declare-const t Transition)
(declare-const c Controller)
(declare-const u Transition)
; given: the invariant
(assert invariant)
; given: besides
(assert (and (part-enabled t c) (stands u c)))
; given: behind
(assert (=> (behind t u c) (exists ((q Place)) (and (= (owner q) c) (output u q) (or (input t q) (permissive t q))))))
; and what is to be shown does not hold
(assert (not (not (behind t u c))))
(check-sat)
(pop 1)

; what is promised there and may still be applied waits for no place that a free part fills whose vote stands
(push 1)
(echo "protocol.waits.promised")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
(declare-const u Transition)
; given: the invariant
(assert invariant)
; given: besides
(assert (and (promised r t c) (or (not (decided r)) (committed r t)) (stands u c)))
; given: behind
(assert (=> (behind t u c) (exists ((q Place)) (and (= (owner q) c) (output u q) (or (input t q) (permissive t q))))))
; and what is to be shown does not hold
(assert (not (not (behind t u c))))
(check-sat)
(pop 1)

; what fires at 'decide' takes no standing vote back that counts
(push 1)
(echo "protocol.persists.decide")
(declare-const c Controller)
(declare-const u Transition)
(declare-const t Transition)
(declare-const p Place)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
(define-fun falsifies-at ((t Transition) (u Transition) (p Place)) Bool
  (or
    (and (or (input t p) (clears t p)) (or (input u p) (permissive u p)))
    (and (output t p) (or (output u p) (inhibitive u p)))))
; given: the net: a yes that holds is taken back by nothing else that is enabled
(assert (=>
  (and
    (forall ((q Place))
      (=>
        (= (owner q) c)
        (and
          (=> (or (input u q) (permissive u q)) (shadow q))
          (=> (or (output u q) (inhibitive u q)) (not (shadow q))))))
    (central-enabled t)
    (free u c)
    (not (= u t)))
  (=> (= (owner p) c) (not (falsifies-at t u p)))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (forall ((d Controller)) (=> (and (takes-part t d) (not (free t d))) (heard r t d)))
  (forall ((d Controller)) (=> (free t d) (stands t d)))
  (forall ((s Round) (d Controller))
    (=> (and (free t d) (committed s t) (= (coordinator-of s) (coordinator-of r))) (noted s t d)))
  (counts u c)
  (not (= u t))
  (= (owner p) c)))
; and what is to be shown does not hold
(assert (not (not (falsifies-at t u p))))
(check-sat)
(pop 1)

; what fires at 'fire' takes no standing vote back that counts
(push 1)
(echo "protocol.persists.fire")
(declare-const t Transition)
(declare-const c Controller)
(declare-const u Transition)
(declare-const p Place)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u (home t)) (not (behind t u (home t))))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
(define-fun falsifies-at ((t Transition) (u Transition) (p Place)) Bool
  (or
    (and (or (input t p) (clears t p)) (or (input u p) (permissive u p)))
    (and (output t p) (or (output u p) (inhibitive u p)))))
; given: the net: a yes that holds is taken back by nothing else that is enabled
(assert (=>
  (and
    (forall ((q Place))
      (=>
        (= (owner q) c)
        (and
          (=> (or (input u q) (permissive u q)) (shadow q))
          (=> (or (output u q) (inhibitive u q)) (not (shadow q))))))
    (central-enabled t)
    (free u c)
    (not (= u t)))
  (=> (= (owner p) c) (not (falsifies-at t u p)))))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; given: besides
(assert (and
  (not (coordinated t))
  (part-enabled t (home t))
  (undisturbed-locally t (home t))
  (counts u c)
  (not (= u t))
  (= (owner p) c)))
; and what is to be shown does not hold
(assert (not (not (falsifies-at t u p))))
(check-sat)
(pop 1)

; what fires at 'decide' is enabled in the central net then
(push 1)
(echo "protocol.follows.decide")
(declare-const r Round)
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (forall ((d Controller)) (=> (and (takes-part t d) (not (free t d))) (heard r t d)))
  (forall ((d Controller)) (=> (free t d) (stands t d)))
  (forall ((s Round) (d Controller))
    (=> (and (free t d) (committed s t) (= (coordinator-of s) (coordinator-of r))) (noted s t d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; and what is to be shown does not hold
(assert (not (central-enabled t)))
(check-sat)
(pop 1)

; what fires at 'fire' is enabled in the central net then
(push 1)
(echo "protocol.follows.fire")
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; given: besides
(assert (and
  (not (coordinated t))
  (part-enabled t (home t))
  (undisturbed-locally t (home t))
  (forall ((u Transition)) (=> (stands u (home t)) (not (behind t u (home t)))))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; and what is to be shown does not hold
(assert (not (central-enabled t)))
(check-sat)
(pop 1)

; when every decided round is closed, the controllers hold the marking of the central net
(push 1)
(echo "protocol.rest")
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (forall ((s Round)) (=> (decided s) (closed s))))
; and what is to be shown does not hold
(assert (not (forall ((q Place)) (= (marked q) (shadow q)))))
(check-sat)
(pop 1)

; an order takes tokens that are there, and puts tokens on empty places
(push 1)
(echo "protocol.once")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (or (and (commit-order r t c) (promised r t c)) (and (commit-order r t c) (free t c) (not (obeyed r t c)))))
; and what is to be shown does not hold
(assert (not
  (forall ((q Place)) (=> (= (owner q) c) (and (=> (input t q) (marked q)) (=> (output t q) (not (marked q))))))))
(check-sat)
(pop 1)

; an order that was not obeyed finds its part promised and enabled, or free
(push 1)
(echo "protocol.expected")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (commit-order r t c) (not (obeyed r t c)) (not (free t c))))
; and what is to be shown does not hold
(assert (not (and (promised r t c) (part-enabled t c))))
(check-sat)
(pop 1)

; as long as a round is open, one of the steps that lead home can be taken
(push 1)
(echo "protocol.home.some")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (begun r) (not (closed r))))
; and what is to be shown does not hold
(assert (not
  (or
    (and (begun r) (not (decided r)))
    (exists ((t Transition) (c Controller)) (and (commit-order r t c) (not (obeyed r t c)) (not (free t c))))
    (exists ((t Transition) (c Controller)) (and (commit-order r t c) (not (obeyed r t c)) (free t c)))
    (exists ((t Transition) (c Controller)) (and (abort-order r t c) (not (obeyed r t c))))
    (exists ((t Transition) (c Controller)) (and (acknowledgement r t c) (not (noted r t c))))
    (and
      (begun r)
      (decided r)
      (not (closed r))
      (forall ((u Transition) (d Controller))
        (=> (and (asked r u) (takes-part u d) (or (not (free u d)) (committed r u))) (noted r u d)))))))
(check-sat)
(pop 1)

; a round that is not decided can be given up, and less is to be done then
(push 1)
(echo "protocol.home.give-up")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (begun r) (not (decided r))))
; decided after 'give-up'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (= s r)))
; abort-order after 'give-up'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (abort-order s u d) (and (= s r) (asked r u) (takes-part u d) (not (free u d)))))
; and what is to be shown does not hold
(assert (not
  (and
    (begun r)
    (not (decided r))
    (forall ((s Round)) (=> (and (begun s) (not (decided.1 s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided.1 s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed s))))))))))
(check-sat)
(pop 1)

; an order to commit can be applied, and less is to be done then
(push 1)
(echo "protocol.home.apply")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (commit-order r t c) (not (obeyed r t c)) (not (free t c))))
; marked after 'apply'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; promised after 'apply'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'apply'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (commit-order r t c)
    (promised r t c)
    (forall ((s Round)) (=> (and (begun s) (not (decided s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed s))))))))))
(check-sat)
(pop 1)

; by a free part, too, and less is to be done then
(push 1)
(echo "protocol.home.apply-free")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (commit-order r t c) (not (obeyed r t c)) (free t c)))
; marked after 'apply-free'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; stands after 'apply-free'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (and (stands u d) (not (and (= u t) (= d c)))))
; obeyed after 'apply-free'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply-free'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (commit-order r t c)
    (free t c)
    (not (obeyed r t c))
    (forall ((s Round)) (=> (and (begun s) (not (decided s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed s))))))))))
(check-sat)
(pop 1)

; an order to abort can be obeyed, and less is to be done then
(push 1)
(echo "protocol.home.release")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (abort-order r t c) (not (obeyed r t c))))
; promised after 'release'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'release'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'release'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (abort-order r t c)
    (forall ((s Round)) (=> (and (begun s) (not (decided s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed.1 s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed s))))))))))
(check-sat)
(pop 1)

; an acknowledgement can be noted, and less is to be done then
(push 1)
(echo "protocol.home.note")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (acknowledgement r t c) (not (noted r t c))))
; noted after 'note'
(define-fun noted.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (noted s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (acknowledgement r t c)
    (forall ((s Round)) (=> (and (begun s) (not (decided s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted.1 s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted.1 s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed s))))))))))
(check-sat)
(pop 1)

; a round of which all acknowledgements are noted can be closed, and less is to be done then
(push 1)
(echo "protocol.home.close")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and
  (begun r)
  (decided r)
  (not (closed r))
  (forall ((u Transition) (d Controller))
    (=> (and (asked r u) (takes-part u d) (or (not (free u d)) (committed r u))) (noted r u d)))))
; closed after 'close'
(define-fun closed.1 ((s Round)) Bool
  (or (closed s) (= s r)))
; and what is to be shown does not hold
(assert (not
  (and
    (decided r)
    (forall ((u Transition) (d Controller))
      (=> (and (asked r u) (takes-part u d) (or (not (free u d)) (committed r u))) (noted r u d)))
    (forall ((s Round)) (=> (and (begun s) (not (decided s))) (and (begun s) (not (decided s)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d)))))
    (forall ((s Round) (u Transition) (d Controller))
      (=>
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))
        (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d)))))
    (forall ((s Round)) (=> (and (begun s) (not (closed.1 s))) (and (begun s) (not (closed s)))))
    (or
      (exists ((s Round)) (and (begun s) (not (decided s)) (not (and (begun s) (not (decided s))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (obeyed s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (obeyed s u d))))))
      (exists ((s Round) (u Transition) (d Controller))
        (and
          (asked s u)
          (takes-part u d)
          (or (not (free u d)) (committed s u))
          (not (noted s u d))
          (not (and (asked s u) (takes-part u d) (or (not (free u d)) (committed s u)) (not (noted s u d))))))
      (exists ((s Round)) (and (begun s) (not (closed s)) (not (and (begun s) (not (closed.1 s))))))))))
(check-sat)
(pop 1)

; with no round open, a new one can ask for whatever is enabled in the central net
(push 1)
(echo "protocol.complete.ask")
(declare-const t Transition)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and
  (forall ((s Round)) (=> (begun s) (closed s)))
  (coordinated t)
  (central-enabled t)
  (not (begun r))
  (= (coordinator-of r) (decider t))))
; begun after 'ask'
(define-fun begun.1 ((s Round)) Bool
  (or (begun s) (= s r)))
; asked after 'ask'
(define-fun asked.1 ((s Round) (u Transition)) Bool
  (or (asked s u) (and (= s r) (= u t))))
; request after 'ask'
(define-fun request.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (request s u d) (and (= s r) (= u t) (takes-part t d) (not (free t d)))))
; and what is to be shown does not hold
(assert (not
  (and
    (coordinated t)
    (= (coordinator-of r) (decider t))
    (not (decided r))
    (asked.1 r t)
    (not (decided r))
    (central-enabled t)
    (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
    (forall ((s Round)) (=> (decided s) (closed s)))
    (forall ((q Place)) (= (marked q) (shadow q))))))
(check-sat)
(pop 1)

; then each who has to promise can promise its part
(push 1)
(echo "protocol.complete.promise")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (central-enabled t)
  (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
  (forall ((s Round)) (=> (decided s) (closed s)))
  (forall ((q Place)) (= (marked q) (shadow q)))
  (takes-part t c)
  (not (free t c))
  (not (promised r t c))))
; promised after 'promise'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (promised s u d) (and (= s r) (= u t) (= d c))))
; vote after 'promise'
(define-fun vote.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (vote s u d) (and (= s r) (= u t) (= d c))))
(define-fun undisturbed ((r Round) (t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (not (= s r)) (= (owner q) c)) (not (disturb-at t u q)))))
; and what is to be shown does not hold
(assert (not
  (and
    (request r t c)
    (not (obeyed r t c))
    (part-enabled t c)
    (undisturbed r t c)
    (asked r t)
    (not (decided r))
    (central-enabled t)
    (forall ((s Round) (u Transition) (d Controller)) (=> (promised.1 s u d) (and (= s r) (= u t))))
    (forall ((s Round)) (=> (decided s) (closed s)))
    (forall ((q Place)) (= (marked q) (shadow q)))
    (promised.1 r t c))))
(check-sat)
(pop 1)

; and each of whom a part is free of promise can vote on it
(push 1)
(echo "protocol.complete.stand")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (central-enabled t)
  (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
  (forall ((s Round)) (=> (decided s) (closed s)))
  (forall ((q Place)) (= (marked q) (shadow q)))
  (free t c)))
; stands after 'stand'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (or (stands u d) (and (= u t) (= d c))))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; and what is to be shown does not hold
(assert (not
  (and
    (free t c)
    (part-enabled t c)
    (undisturbed-locally t c)
    (asked r t)
    (not (decided r))
    (central-enabled t)
    (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
    (forall ((s Round)) (=> (decided s) (closed s)))
    (forall ((q Place)) (= (marked q) (shadow q)))
    (stands.1 t c))))
(check-sat)
(pop 1)

; then each vote can be heard
(push 1)
(echo "protocol.complete.hear")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (central-enabled t)
  (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
  (forall ((s Round)) (=> (decided s) (closed s)))
  (forall ((q Place)) (= (marked q) (shadow q)))
  (promised r t c)))
; heard after 'hear'
(define-fun heard.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (heard s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (vote r t c)
    (asked r t)
    (not (decided r))
    (central-enabled t)
    (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
    (forall ((s Round)) (=> (decided s) (closed s)))
    (forall ((q Place)) (= (marked q) (shadow q)))
    (heard.1 r t c))))
(check-sat)
(pop 1)

; then it can be decided
(push 1)
(echo "protocol.complete.decide")
(declare-const r Round)
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and
  (asked r t)
  (not (decided r))
  (central-enabled t)
  (forall ((s Round) (u Transition) (d Controller)) (=> (promised s u d) (and (= s r) (= u t))))
  (forall ((s Round)) (=> (decided s) (closed s)))
  (forall ((q Place)) (= (marked q) (shadow q)))
  (forall ((d Controller)) (=> (takes-part t d) (or (heard r t d) (and (free t d) (stands t d)))))))
; decided after 'decide'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (= s r)))
; committed after 'decide'
(define-fun committed.1 ((s Round) (u Transition)) Bool
  (or (committed s u) (and (= s r) (= u t))))
; commit-order after 'decide'
(define-fun commit-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (commit-order s u d) (and (= s r) (= u t) (takes-part t d))))
; abort-order after 'decide'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (abort-order s u d) (and (= s r) (asked r u) (not (= u t)) (takes-part u d) (not (free u d)))))
; shadow after 'decide'
(define-fun shadow.1 ((q Place)) Bool
  (or (output t q) (and (shadow q) (not (input t q)) (not (clears t q)))))
; and what is to be shown does not hold
(assert (not
  (and
    (asked r t)
    (not (decided r))
    (forall ((d Controller)) (=> (and (takes-part t d) (not (free t d))) (heard r t d)))
    (forall ((d Controller)) (=> (free t d) (stands t d)))
    (forall ((s Round) (d Controller))
      (=> (and (free t d) (committed s t) (= (coordinator-of s) (coordinator-of r))) (noted s t d))))))
(check-sat)
(pop 1)

; with no round open, a local transition that is enabled in the central net can fire
(push 1)
(echo "protocol.complete.fire")
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
(define-fun central-enabled ((t Transition)) Bool
  (forall ((q Place))
    (and
      (=> (or (input t q) (permissive t q)) (shadow q))
      (=> (or (output t q) (inhibitive t q)) (not (shadow q))))))
; given: besides
(assert (and (forall ((s Round)) (=> (begun s) (closed s))) (not (coordinated t)) (central-enabled t)))
; marked after 'fire'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) (home t)) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) (home t))) (marked q))))
; shadow after 'fire'
(define-fun shadow.1 ((q Place)) Bool
  (or (output t q) (and (shadow q) (not (input t q)) (not (clears t q)))))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; and what is to be shown does not hold
(assert (not (and (not (coordinated t)) (part-enabled t (home t)) (undisturbed-locally t (home t)))))
(check-sat)
(pop 1)

; with no round open, every signal can change, but for completions that have come
(push 1)
(echo "protocol.complete.sense")
(declare-const p Place)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: besides
(assert (and (forall ((s Round)) (=> (begun s) (closed s))) (signal p) (not (and (lasting p) (marked p)))))
; marked after 'sense'
(define-fun marked.1 ((q Place)) Bool
  (or (and (= q p) (not (marked q))) (and (not (= q p)) (marked q))))
; shadow after 'sense'
(define-fun shadow.1 ((q Place)) Bool
  (or (and (= q p) (not (shadow q))) (and (not (= q p)) (shadow q))))
; and what is to be shown does not hold
(assert (not
  (and
    (signal p)
    (forall ((s Round) (u Transition)) (=> (promised s u (owner p)) (not (touches u p))))
    (not (and (lasting p) (marked p)))
    (forall ((s Round) (u Transition)) (=> (underway s u (owner p)) (not (clears u p)))))))
(check-sat)
(pop 1)

; 'promise' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.promise")
(declare-const c Controller)
(declare-const t Transition)
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: 'promise' waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u c) (not (behind t u c)))))
; promise: a request of the round has arrived
(assert (request r t c))
; promise: no order of the round has been obeyed
(assert (not (obeyed r t c)))
; promise: the part is enabled in the subnet
(assert (part-enabled t c))
(define-fun undisturbed ((r Round) (t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (not (= s r)) (= (owner q) c)) (not (disturb-at t u q)))))
; promise: no promise of another round is disturbed (O1)
(assert (undisturbed r t c))
; promised after 'promise'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (promised s u d) (and (= s r) (= u t) (= d c))))
; vote after 'promise'
(define-fun vote.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (vote s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((s Round) (u Transition) (d Controller)) (= (promised.1 s u d) (promised s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (vote.1 s u d) (vote s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote.1 s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote.1 s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'stand' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.stand")
(declare-const c Controller)
(declare-const t Transition)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; given: 'stand' waits for no place that a free part fills whose vote stands (waits.enabled)
(assert (forall ((u Transition)) (=> (stands u c) (not (behind t u c)))))
; stand: the part is free of promise
(assert (free t c))
; stand: the part is enabled in the subnet
(assert (part-enabled t c))
(define-fun undisturbed-locally ((t Transition) (c Controller)) Bool
  (forall ((s Round) (u Transition) (q Place))
    (=> (and (promised s u c) (= (owner q) c)) (not (disturb-at t u q)))))
; stand: no promise is disturbed (O1)
(assert (undisturbed-locally t c))
; stands after 'stand'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (or (stands u d) (and (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (forall ((u Transition) (d Controller)) (= (stands.1 u d) (stands u d)))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (forall ((u Transition) (d Controller)) (=> (stands u d) (stands.1 u d)))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))
          (exists ((u Transition) (d Controller)) (and (stands.1 u d) (not (stands u d))))))))))
(check-sat)
(pop 1)

; 'hear' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.hear")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; hear: a vote of the round has arrived
(assert (vote r t c))
; heard after 'hear'
(define-fun heard.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (heard s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (forall ((s Round) (u Transition) (d Controller)) (= (heard.1 s u d) (heard s u d)))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard.1 s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard.1 s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'give-up' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.give-up")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; give-up: the round is begun
(assert (begun r))
; give-up: the round is not decided
(assert (not (decided r)))
; decided after 'give-up'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (= s r)))
; abort-order after 'give-up'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (abort-order s u d) (and (= s r) (asked r u) (takes-part u d) (not (free u d)))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((s Round)) (= (decided.1 s) (decided s)))
        (forall ((s Round) (u Transition) (d Controller)) (= (abort-order.1 s u d) (abort-order s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided.1 s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided.1 s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'restart' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.restart")
(declare-const k Coordinator)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; decided after 'restart'
(define-fun decided.1 ((s Round)) Bool
  (or (decided s) (and (begun s) (= (coordinator-of s) k))))
; abort-order after 'restart'
(define-fun abort-order.1 ((s Round) (u Transition) (d Controller)) Bool
  (or
    (abort-order s u d)
    (and (asked s u) (takes-part u d) (not (free u d)) (not (decided s)) (= (coordinator-of s) k))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((s Round)) (= (decided.1 s) (decided s)))
        (forall ((s Round) (u Transition) (d Controller)) (= (abort-order.1 s u d) (abort-order s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided.1 s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided.1 s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'apply' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.apply")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; apply: the order to commit has arrived
(assert (commit-order r t c))
; apply: it is promised
(assert (promised r t c))
; marked after 'apply'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; promised after 'apply'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'apply'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((q Place)) (= (marked.1 q) (marked q)))
        (forall ((s Round) (u Transition) (d Controller)) (= (promised.1 s u d) (promised s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (obeyed.1 s u d) (obeyed s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (acknowledgement.1 s u d) (acknowledgement s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed.1 s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed.1 s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'apply-free' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.apply-free")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; apply-free: the order to commit has arrived
(assert (commit-order r t c))
; apply-free: the part is free of promise
(assert (free t c))
; apply-free: no order of the round has been obeyed
(assert (not (obeyed r t c)))
; marked after 'apply-free'
(define-fun marked.1 ((q Place)) Bool
  (or
    (and (= (owner q) c) (or (output t q) (and (marked q) (not (input t q)) (not (clears t q)))))
    (and (not (= (owner q) c)) (marked q))))
; stands after 'apply-free'
(define-fun stands.1 ((u Transition) (d Controller)) Bool
  (and (stands u d) (not (and (= u t) (= d c)))))
; obeyed after 'apply-free'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'apply-free'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((q Place)) (= (marked.1 q) (marked q)))
        (forall ((u Transition) (d Controller)) (= (stands.1 u d) (stands u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (obeyed.1 s u d) (obeyed s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (acknowledgement.1 s u d) (acknowledgement s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed.1 s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed.1 s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'release' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.release")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; release: the order to abort has arrived
(assert (abort-order r t c))
; promised after 'release'
(define-fun promised.1 ((s Round) (u Transition) (d Controller)) Bool
  (and (promised s u d) (not (and (= s r) (= u t) (= d c)))))
; obeyed after 'release'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= u t) (= d c))))
; acknowledgement after 'release'
(define-fun acknowledgement.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (acknowledgement s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (and
        (forall ((s Round) (u Transition) (d Controller)) (= (promised.1 s u d) (promised s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (obeyed.1 s u d) (obeyed s u d)))
        (forall ((s Round) (u Transition) (d Controller)) (= (acknowledgement.1 s u d) (acknowledgement s u d))))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed.1 s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed.1 s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'note' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.note")
(declare-const r Round)
(declare-const t Transition)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; note: an acknowledgement of the round has arrived
(assert (acknowledgement r t c))
; noted after 'note'
(define-fun noted.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (noted s u d) (and (= s r) (= u t) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (forall ((s Round) (u Transition) (d Controller)) (= (noted.1 s u d) (noted s u d)))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted.1 s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted.1 s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'close' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.close")
(declare-const r Round)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; close: the round is decided
(assert (decided r))
; close: all who got an order have obeyed
(assert (forall ((u Transition) (d Controller))
  (=> (and (asked r u) (takes-part u d) (or (not (free u d)) (committed r u))) (noted r u d))))
; closed after 'close'
(define-fun closed.1 ((s Round)) Bool
  (or (closed s) (= s r)))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (forall ((s Round)) (= (closed.1 s) (closed s)))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed.1 s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed.1 s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

; 'forget' changes nothing, or makes something known for good
(push 1)
(echo "protocol.advances.forget")
(declare-const r Round)
(declare-const c Controller)
; given: the invariant
(assert invariant)
; given: whoever is promised waits for no place that a free part fills whose vote stands (waits.promised)
(assert (forall ((s Round) (u Transition) (v Transition) (d Controller))
  (=> (and (promised s v d) (or (not (decided s)) (committed s v)) (stands u d)) (not (behind v u d)))))
; forget: a message says that the round is closed
(assert (closed r))
; obeyed after 'forget'
(define-fun obeyed.1 ((s Round) (u Transition) (d Controller)) Bool
  (or (obeyed s u d) (and (= s r) (= d c))))
; and what is to be shown does not hold
(assert (not
  (and
    (forall ((s Round) (u Transition)) (=> (asked s u) (asked s u)))
    (forall ((s Round)) (=> (begun s) (begun s)))
    (or
      (forall ((s Round) (u Transition) (d Controller)) (= (obeyed.1 s u d) (obeyed s u d)))
      (and
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (vote s u d)) (and (begun s) (vote s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (heard s u d)) (and (begun s) (heard s u d))))
        (forall ((s Round)) (=> (and (begun s) (decided s)) (and (begun s) (decided s))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (obeyed s u d)) (and (begun s) (obeyed.1 s u d))))
        (forall ((s Round) (u Transition) (d Controller))
          (=> (and (begun s) (noted s u d)) (and (begun s) (noted s u d))))
        (forall ((s Round)) (=> (and (begun s) (closed s)) (and (begun s) (closed s))))
        (or
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (vote s u d) (not (and (begun s) (vote s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (heard s u d) (not (and (begun s) (heard s u d)))))
          (exists ((s Round)) (and (begun s) (decided s) (not (and (begun s) (decided s)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (obeyed.1 s u d) (not (and (begun s) (obeyed s u d)))))
          (exists ((s Round) (u Transition) (d Controller))
            (and (begun s) (noted s u d) (not (and (begun s) (noted s u d)))))
          (exists ((s Round)) (and (begun s) (closed s) (not (and (begun s) (closed s)))))))))))
(check-sat)
(pop 1)

//! A round of the race by two threads: two searches at a time, until each has had its turn or one of them has ended.
//!
//! Of those that end the first in the field wins, as if they had run in turn; who comes later in the field is left. Together
//! they hold no more than is allowed: what each may grow by is granted from what is left when its turn comes.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

use super::racer::Racer;
use super::zdd::Node;
use crate::budget::{CLOCK_EVERY, Stop, Watch};
use crate::net::Transition;

/// How long a thread that has nothing left to do waits before it looks at the clock again.
const MOMENT: Duration = Duration::from_millis(10);

/// Where two threads take who is next, and the room that there is for it to grow.
struct Desk<I> {
    due: I,
    /// The bytes that nobody holds or was granted.
    left: usize,
    running: usize,
}

impl<I: Iterator> Desk<I> {
    /// Who is next, and how much it may grow: by half of what is left, or by all of it where the other half is granted.
    fn next(&mut self) -> Option<(I::Item, usize)> {
        let next = self.due.next()?;
        let granted = self.left / (2 - self.running.min(1));
        self.left -= granted;
        self.running += 1;
        Some((next, granted))
    }

    /// Takes back what was granted and is not held.
    fn take_back(&mut self, bytes: usize) {
        self.left += bytes;
        self.running -= 1;
    }
}

/// Lets those who have fuel run, while all together grow by no more than `left` bytes; who was the first in the field to
/// end, and with what; and whether one had no room beside another one, which has its fuel back and begins again.
pub(super) fn abreast(
    field: &mut [Racer],
    (transitions, initial): (&[Transition], &[u32]),
    left: usize,
    watch: &mut Watch<'_>,
) -> Result<(Option<(usize, Node)>, bool), Stop> {
    let deadline = watch.deadline();
    let due = field.iter_mut().enumerate().filter(|(_, racer)| racer.fuel > 0);
    let desk = Mutex::new(Desk { due, left, running: 0 });
    let (first, short, stopped) = (AtomicUsize::new(usize::MAX), AtomicBool::new(false), AtomicBool::new(false));
    let run = |go_on: &mut dyn FnMut() -> Result<(), Stop>| {
        let mut reached = None;
        loop {
            let next = desk.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(((at, racer), granted)) = next else { return Ok(reached) };
            let mut poll = |_| if first.load(Relaxed) < at { Err(Stop::Cancelled) } else { go_on() };
            let (room, fuel) = (racer.bytes() + granted, racer.fuel);
            let ended = racer.run(transitions, initial, room, &mut Watch::often(deadline, &mut poll));
            if ended == Err(Stop::Memory) {
                (racer.begun, racer.fuel) = (None, fuel);
            }
            desk.lock().unwrap_or_else(PoisonError::into_inner).take_back(room.saturating_sub(racer.bytes()));
            match ended {
                Ok(Some(reach)) => {
                    first.fetch_min(at, Relaxed);
                    reached = Some((at, reach));
                }
                Ok(None) => {}
                Err(Stop::Memory) => short.store(true, Relaxed),
                // Who has lost hears that it must end, or that time is over; what a handler raised comes out.
                Err(Stop::Cancelled | Stop::Time) if first.load(Relaxed) < at => {}
                Err(stop) => return Err(stop),
            }
            if first.load(Relaxed) < usize::MAX {
                return Ok(reached); // who comes later in the field has lost
            }
        }
    };
    let (here, there) = thread::scope(|scope| {
        let (ended, ends) = mpsc::channel::<()>();
        let (run, stopped) = (&run, &stopped);
        let beside = move || {
            let _ended = ended; // which the other one hears
            run(&mut || if stopped.load(Relaxed) { Err(Stop::Cancelled) } else { Ok(()) })
        };
        // Where the system has no thread to give, one does it all.
        let other = thread::Builder::new().spawn_scoped(scope, beside).ok();
        let mut look = || watch.tick(CLOCK_EVERY);
        let mut here = run(&mut look);
        while here.is_ok() && ends.recv_timeout(MOMENT) == Err(mpsc::RecvTimeoutError::Timeout) {
            here = look().and(here);
        }
        stopped.store(here.is_err(), Relaxed);
        let there = other.map_or(Ok(None), |other| other.join().unwrap_or_else(|panic| resume_unwind(panic)));
        (here, there)
    });
    // The second one only hears that it must end; the first knows why.
    let both = [here?, there?];
    Ok((both.into_iter().flatten().min_by_key(|&(at, _)| at), short.into_inner()))
}

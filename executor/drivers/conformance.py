"""What every driver has to show: a class of tests, for firable's own kinds of devices and for those of others.

A test module makes a subclass whose name begins with `Test`, and gives it one method: `far_end`, a server of points of
the kind's own protocol (`firable.executor.drivers.far_side.end`), with the keys by which a binding reaches it and a
point for each role of the machine behind it (`ROLES` in `firable.executor.drivers.far_side.machine`).

    class TestMine(DriverConformance):
        @asynccontextmanager
        async def far_end(self):
            end = MyServer()
            yield Far(end, "driver: mine, address: 127.0.0.1", {"sensor": "in 1", "number": "out 2", ...})

Nothing here waits for a time to pass: each test waits for what must happen, at most
`PATIENCE_S` of `bench.py`. pytest is not
imported, so that who runs a cell need not have it.
"""

from __future__ import annotations

from functools import partial

from firable.executor.drivers.bench import QUICK_S, Bench, until
from firable.executor.drivers.conformance_stopping import StoppingConformance
from firable.executor.drivers.driver import Quality


class DriverConformance(StoppingConformance):
    """The tests; a subclass says how its kind is reached."""

    def test_a_command_is_taken_once_and_completed_with_its_entry(self) -> None:
        """The number says to which entry the machine's answer belongs."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                assert b.heard_of("moved") == []
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
                b.driver.send(b.place("move"), 2)
                await until(lambda: len(b.machine.orders) == 2, "the second command arrives")
                b.machine.finish()
                await until(lambda: len(b.heard_of("moved")) == 2, "the second completion")
            assert b.heard_of("moved") == [(True, 1), (True, 2)]
            assert len(b.machine.orders) == 2

        self.bench(test)

    def test_a_completion_needs_its_sensor_as_well(self) -> None:
        """A machine that says it has gripped has gripped only when the sensor says so too."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("grip"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.finish()
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("held")[-1:] == [(True, None)], "what comes later is read")
                assert b.heard_of("closed") == []
                b.machine.show("closed", value=True)
                await until(lambda: b.heard_of("closed"), "the completion")
            assert b.heard_of("closed") == [(True, 1)]

        self.bench(test)

    def test_the_answer_to_an_earlier_command_completes_nothing(self) -> None:
        """An answer that comes late is known by its number."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: len(b.machine.orders) == 1, "the command arrives")
                first = b.machine.orders[0].number
                b.driver.send(b.place("move"), 2)
                await until(lambda: len(b.machine.orders) == 2, "the second command arrives")
                b.machine.finish(first)
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("held")[-1:] == [(True, None)], "what comes later is read")
                assert b.heard_of("moved") == []
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard_of("moved") == [(True, 2)]

        self.bench(test)

    def test_what_a_machine_still_shows_of_an_earlier_run_completes_nothing(self) -> None:
        """Without a journal, entries begin again, and so do their numbers."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            b.begin()  # without a journal: entries begin again at 1
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: len(b.machine.orders) == 2, "the command arrives")
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("held")[-1:] == [(True, None)], "what comes later is read")
                assert b.heard_of("moved") == []
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")

        self.bench(test)

    def test_commands_without_a_completion_are_taken_each_time(self) -> None:
        """A machine ignores a number that it has, so each of them needs another one."""

        async def test(b: Bench) -> None:
            for orders in (2, 4):
                b.begin()
                async with b.connected():
                    b.driver.send(b.place("halt"), 0)
                    b.driver.send(b.place("halt"), 0)
                    await b.ordered(orders)

        self.bench(test)

    def test_a_command_is_taken_when_the_machine_has_it_and_told_so_once(self) -> None:
        """A token without completion goes on by that; what stands in a queue or a register has moved nothing."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                b.driver.send(b.place("halt"), 1)
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                assert b.heard.takings == []
                b.machine.takes = False
                before = len(b.machine.events)
                await b.far.end.mend()
                await until(lambda: {"number", "command"} & {*b.machine.events[before:]}, "the number is written")
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("held")[-1:] == [(True, None)], "what comes later is read")
                assert b.heard.takings == []
                b.machine.takes = True
                await until(lambda: b.heard.takings, "it is taken")
                b.driver.send(b.place("move"), 1)
                await until(lambda: len(b.heard.takings) == 2, "the other is taken")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard.takings == [("M.halt", 1), ("M.move", 1)]
            assert len(b.machine.orders) == 2

        self.bench(test, timeout_s=QUICK_S)

    def test_a_command_that_is_given_up_before_the_machine_has_it_never_comes(self) -> None:
        """Its token has left: a machine that moved by it when the line is back would move by nothing."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                b.driver.send(b.place("move"), 1)
                b.driver.send(b.place("halt"), 1)
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                b.driver.withdraw(b.place("move"))
                b.driver.withdraw(b.place("halt"))
                await b.far.end.mend()
                await until(b.driver.devices["D"].is_ready.is_set, "the return")
                b.driver.send(b.place("grip"), 1)
                await until(lambda: b.heard.takings, "the next command is taken")
            assert b.heard.takings == [("M.grip", 1)]
            assert len(b.machine.orders) == 1

        self.bench(test, timeout_s=QUICK_S)

    def test_a_command_does_not_wait_for_one_that_was_given_up_before_the_machine_took_it(self) -> None:
        """A stop must not stand behind what it is to stop; nor is the other taken with what the stop writes."""

        async def test(b: Bench, *, is_cut: bool) -> None:
            async with b.connected():
                b.machine.takes = False
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.waiting, "the command is written")
                if is_cut:
                    await b.far.end.cut()
                    await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                b.driver.withdraw(b.place("move"))
                b.driver.send(b.place("halt"), 1)
                if is_cut:
                    await b.far.end.mend()
                moving = b.machine.waiting
                await until(lambda: b.machine.waiting not in {moving, None}, "the other is written")
                number = "number" if "number" in b.far.points else "command"
                written = [role for role in b.machine.events if role in {"code", number}]
                assert written == ["code", number, number, "code", number], "with number 0 between them"
                b.machine.takes = True
                await until(lambda: b.heard.takings, "it is taken")
            assert b.heard.takings == [("M.halt", 1)]
            assert len(b.machine.orders) == 1

        self.bench(lambda b: test(b, is_cut=False))
        self.bench(lambda b: test(b, is_cut=True), timeout_s=QUICK_S)

    def test_a_failed_command_is_a_fault(self) -> None:
        """A failure is told at once, and not when the command is overdue."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.fail()
                await until(lambda: b.heard.faults, "the fault")
            assert "D: has failed at the command of 'M.move', M MOVE to=A" in b.heard.faults[0]

        self.bench(test)

    def test_signals_are_told_when_they_are_first_read_and_when_they_change(self) -> None:
        """Nothing is known of a signal before it has been read."""

        async def test(b: Bench) -> None:
            assert b.quality("held") == (None, Quality.BAD)
            async with b.connected():
                await until(lambda: b.heard_of("held") == [(False, None)], "the first value")
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("held")[1:] == [(True, None)], "the change")
                assert b.quality("held") == (True, Quality.GOOD)

        self.bench(test)

    def test_a_lost_device_follows_the_policy_of_each_signal_and_comes_back_by_a_new_connection(self) -> None:
        """Hold, safe value, and the way back."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await until(lambda: b.heard_of("one") == [(False, None)], "the first value")
                b.machine.show("sensor", value=True)
                await until(lambda: len(b.heard_of("zero")) == 2, "the change")
                await b.far.end.cut()
                await until(lambda: b.quality("held")[1] is not Quality.GOOD, "the loss")
                assert b.quality("held") == (True, Quality.UNCERTAIN)
                assert b.quality("zero") == (False, Quality.BAD)
                assert b.quality("one") == (True, Quality.BAD)
                assert b.driver.readings()["M.held"].why
                assert b.heard_of("zero")[-1] == (False, None)
                assert len(b.heard_of("held")) == 2
                b.machine.show("sensor", value=False)
                await b.far.end.mend()
                await until(lambda: b.quality("held") == (False, Quality.GOOD), "the return")
                await until(lambda: b.heard_of("one")[-1] == (False, None), "the value")
                await until(lambda: b.driver.devices["D"].kept.connections >= 2, "the new connection")
                assert any("not connected" in note for note in b.heard.notes)
                await until(lambda: "D: connected again" in b.heard.notes, "the note of it")
            assert b.heard.faults == []

        self.bench(test, timeout_s=QUICK_S)

    def test_a_lost_signal_that_is_needed_is_a_fault(self) -> None:
        """The default policy."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                await until(lambda: b.heard.faults, "the fault")
            assert "D: 'M.needed' cannot be read: " in b.heard.faults[0]

        self.bench(test, needed="fault", timeout_s=QUICK_S)

    def test_a_device_that_is_never_reached_is_a_fault_of_what_is_needed(self) -> None:
        """A run does not wait for ever for a device that is not there."""

        async def test(b: Bench) -> None:
            await b.far.end.cut()
            async with b.running():
                await until(lambda: b.heard.faults, "the fault")
            assert "M.needed" in b.heard.faults[0]

        self.bench(test, needed="fault", start_s=0.05, timeout_s=QUICK_S)

    def test_a_command_that_is_sent_while_the_line_is_down_arrives_once_when_it_is_up(self) -> None:
        """What is sent into a line that is down is neither lost nor doubled."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                b.driver.send(b.place("move"), 1)
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                await b.far.end.mend()
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard_of("moved") == [(True, 1)]
            assert len(b.machine.orders) == 1
            assert b.heard.faults == []

        self.bench(test, timeout_s=QUICK_S)

    def test_a_command_under_way_is_completed_after_the_line_was_down(self) -> None:
        """The machine goes on while the line is down, and says so afterwards."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                await b.far.end.cut()
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                b.machine.finish()
                await b.far.end.mend()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert len(b.machine.orders) == 1

        self.bench(test, timeout_s=QUICK_S)

    def test_a_command_that_was_taken_is_not_given_again_when_its_machine_was_off_meanwhile(self) -> None:
        """It has had it, by the confirmed write, and forgotten its number; its token may have gone on hours ago."""

        async def test(b: Bench, place: str) -> None:
            async with b.connected():
                b.driver.send(b.place(place), 1)
                await until(lambda: b.heard.takings == [(f"M.{place}", 1)], "the confirmed write is told as taken")
                await b.ordered(1)
                await b.far.end.cut()
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                b.machine.switch_off_and_on()
                await b.far.end.mend()
                await until(b.driver.devices["D"].is_ready.is_set, "the return")
                b.driver.send(b.place("grip"), 1)
                await until(lambda: len(b.heard.takings) == 2, "the next command is taken")
                await until(lambda: len(b.machine.orders) >= 2, "the next command arrives")
            assert len(b.machine.orders) == 2
            assert b.heard.takings == [(f"M.{place}", 1), ("M.grip", 1)]
            assert b.heard.faults == []

        for place in ("halt", "move"):
            self.bench(partial(test, place=place), timeout_s=QUICK_S, shows_taken=False)

    def test_a_silent_device_is_lost_and_its_late_answers_are_no_answers(self) -> None:
        """A connection that has timed out may still bring its answer: nobody must be listening."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await until(lambda: b.quality("held") == (False, Quality.GOOD), "the first value")
                b.far.end.faults.silent = True
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.quality("held")[1] is not Quality.GOOD, "the loss")
                b.machine.show("sensor", value=True)
                b.far.end.faults.silent = False
                await until(lambda: b.quality("held") == (True, Quality.GOOD), "the return")
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard_of("moved") == [(True, 1)]
            assert len(b.machine.orders) == 1

        self.bench(test, timeout_s=QUICK_S)

    def test_a_device_that_gives_no_sign_of_life_stays_lost_over_every_connection(self) -> None:
        """Who stands for it may answer, and show what was so before it died."""

        async def test(b: Bench) -> None:
            device = b.driver.devices["D"]
            async with b.connected():
                b.machine.show("sensor", value=True)
                await until(lambda: b.heard_of("zero")[-1:] == [(True, None)], "the change")
                b.machine.lives = False
                await until(lambda: not device.is_ready.is_set(), "the loss")
                assert b.quality("zero") == (False, Quality.BAD)
                told = len(b.heard.signals)
                b.driver.send(b.place("move"), 1)
                connections = device.kept.connections
                await until(lambda: device.kept.connections >= connections + 2, "two more connections")
                assert not device.is_ready.is_set()
                assert b.quality("zero") == (False, Quality.BAD)
                assert b.heard.signals[told:] == []
                assert b.machine.orders == []
                b.machine.lives = True
                await until(lambda: b.quality("zero") == (True, Quality.GOOD), "the return")
                await b.ordered(1)

        self.bench(test, within_s=QUICK_S)

    def test_a_slow_device_is_waited_for_within_its_time(self) -> None:
        """Slow is not lost."""

        async def test(b: Bench) -> None:
            b.far.end.faults.delay_s = 0.05
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
                assert b.driver.devices["D"].kept.connections == 1

        self.bench(test)

    def test_garbage_is_no_value_and_no_answer(self) -> None:
        """What cannot be read is not believed, and does not last."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.far.end.faults.garbage = True
                b.machine.finish()
                b.machine.show("sensor", value=True)
                await until(lambda: b.quality("held")[1] is not Quality.GOOD, "the garbage is noticed")
                assert b.heard_of("moved") == []
                assert (True, None) not in b.heard_of("held")
                b.far.end.faults.garbage = False
                b.machine.finish()
                b.machine.show("sensor", value=False)
                b.machine.show("sensor", value=True)
                await until(lambda: b.quality("held") == (True, Quality.GOOD), "the return")
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard.faults == []

        self.bench(test, timeout_s=QUICK_S)

    def test_edges_that_are_not_told_are_counted(self) -> None:
        """What was told and what was counted are together what happened."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await until(lambda: b.heard_of("held"), "the first value")
                for _ in range(100):
                    b.machine.show("sensor", value=True)
                    b.machine.show("sensor", value=False)
                b.machine.show("sensor", value=True)
                await until(lambda: accounted(b) == 201 or not self.counts_edges, "every edge told or counted")
                await until(lambda: b.quality("held")[0], "the last value")

        def accounted(b: Bench) -> int:
            return len(b.heard_of("held")) - 1 + b.driver.readings()["M.held"].coalesced

        self.bench(test)

    counts_edges: bool = True
    """Whether the protocol carries every change; one that is polled sees what is there when it looks."""

"""What every driver has to show of the ends of a run: the safe outputs, the emergency stop, what a restart finds.

These are tests of the class in `conformance.py`, which says how it is used.
"""

from __future__ import annotations

import asyncio
import gc
import threading
from abc import abstractmethod
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from functools import partial
from typing import Any

from firable.executor.drivers.bench import QUICK_S, Bench, Far, bench_net, until
from firable.executor.drivers.driver import Answer
from firable.executor.drivers.far_side.machine import Machine, Order
from firable.executor.drivers.rivals import demand_alone, shows
from firable.nets.diagnostics import InputError


class Breaking(list[Order]):
    """The orders of a machine whose line is cut as it gets the first one."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        self.far = bench.far
        self.cutting: asyncio.Task[None]

    def append(self, order: Order) -> None:
        """Get an order."""
        super().append(order)
        if len(self) == 1:
            self.cutting = asyncio.ensure_future(self.far.end.cut())


class StoppingConformance:
    """The tests of starts and stops; a subclass says how its kind is reached."""

    @abstractmethod
    def far_end(self) -> AbstractAsyncContextManager[Far]:
        """A far end that is not started yet."""

    def bench(self, test: Callable[[Bench], Coroutine[Any, Any, None]], **options: Any) -> None:
        """Run a test on a bench; nothing may fail there that nobody hears of, as in a task that nobody waits for."""

        async def run() -> None:
            left: list[dict[str, Any]] = []
            loop = asyncio.get_running_loop()
            loop.set_exception_handler(lambda _loop, context: left.append(context))
            try:
                async with self.far_end() as far:
                    machine = Machine(far.end, far.points)
                    await machine.start()
                    try:
                        await test(Bench(machine, far, bench_net(), **options))
                    finally:
                        await machine.stop()
                gc.collect(1)  # a future tells of an error that nobody has asked for when it goes
            finally:
                loop.set_exception_handler(None)
            assert not left, left

        self.run(run())

    def run(self, work: Coroutine[Any, Any, None]) -> None:
        """Do the work of a test in an event loop; all tests may have the same one."""
        asyncio.run(work)

    def test_a_device_that_another_program_commands_is_left_alone(self) -> None:
        """Both would command its machines, and each stop those of the other at its start and its end."""

        async def test(b: Bench) -> None:
            if not shows(b.driver.binding.kinds["D"]):
                return
            async with b.connected():
                stood = [*b.machine.outputs]
                second, codes = Bench(b.machine, b.far, b.net), list[str]()
                try:
                    await demand_alone(second.driver.binding)
                except InputError as error:
                    codes = [one.code for one in error.diagnostics]
                assert codes == ["F5106"]
                assert b.machine.outputs == stood
            await demand_alone(b.driver.binding)  # the first has ended

        self.bench(test)

    def test_safe_outputs_come_before_anything_else_at_the_start(self) -> None:
        """A machine that was left on is stopped before it is told anything."""

        async def test(b: Bench) -> None:
            b.driver.send(b.place("move"), 1)
            async with b.connected():
                await until(lambda: b.machine.orders, "the command arrives")
            assert b.machine.events[0] == "output"
            assert b.machine.outputs[0] is False

        self.bench(test)

    def test_a_command_that_a_stop_overtakes_is_never_told_as_taken(self) -> None:
        """After the restart it is asked after: the machine has not moved by it."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                b.driver.send(b.place("halt"), 1)
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                b.driver.stop()
                b.driver.send(b.place("halt"), 2)
                await b.far.end.mend()
            assert b.machine.orders == []
            assert b.heard.takings == []

        self.bench(test, timeout_s=QUICK_S)

    def test_a_device_that_gives_no_sign_of_life_at_the_start_is_driven_safe_and_commanded_when_it_does(self) -> None:
        """It may be alive, so that the safe outputs do not wait; it may not have been, so that they come once more."""

        async def test(b: Bench) -> None:
            b.machine.lives = False
            b.driver.send(b.place("move"), 1)
            kept = b.driver.devices["D"].kept
            async with b.running():
                await until(lambda: kept.connections == 2, "another connection")
                assert b.machine.outputs
                assert "D" in b.driver.undriven
                assert b.heard.signals == []
                assert b.machine.orders == []
                driven = len(b.machine.outputs)
                b.machine.lives = True
                await b.ordered(1)
                assert len(b.machine.outputs) > driven
                assert not b.driver.undriven

        self.bench(test, within_s=QUICK_S)

    def test_safe_outputs_are_the_last_thing_at_the_end_and_nothing_is_sent_after_a_stop(self) -> None:
        """A stop is the end of what is sent."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                b.driver.stop()
                b.driver.send(b.place("move"), 2)
                await until(lambda: len(b.machine.outputs) == 2, "the safe outputs")
            assert b.machine.events[-1] == "output"
            assert b.machine.outputs == [False, False]
            assert len(b.machine.orders) == 1

        self.bench(test)

    def test_nothing_more_of_a_command_is_sent_after_a_stop(self) -> None:
        """What a command needs goes before its number: one that a stop has overtaken in between moves nothing."""

        async def test(b: Bench, turns: int) -> None:
            async with b.connected():
                b.driver.send(b.place("halt"), 1)
                await until(lambda: b.heard.takings == [("M.halt", 1)], "what has to be learnt for a write is known")
                b.machine.events.clear()
                b.far.end.faults.delay_s = 0.003  # of each step: none but the first is sent before the stop
                b.driver.send(b.place("move"), 1)
                for _ in range(turns):
                    await asyncio.sleep(0)
                b.driver.stop()
                await until(b.driver.devices["D"].kept.stopped.is_set, "the stop is over")
            assert not {"number", "command"} & {*b.machine.events}
            assert len(b.machine.orders) == 1
            assert b.machine.events[-1] == "output"
            assert b.heard.takings == [("M.halt", 1)]

        for turns in range(4):
            self.bench(partial(test, turns=turns), timeout_s=QUICK_S)

    def test_safe_outputs_are_the_last_thing_also_behind_a_command_that_the_line_has_held(self) -> None:
        """What was sent and not confirmed may come late, by a connection that nobody has any more."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.far.end.faults.delay_s = 0.1  # a heartbeat may be on its way, which is answered
                b.driver.send(b.place("halt"), 1)
                await until(lambda: b.driver.devices["D"].kept.writing, "the command is on its way")
                b.far.end.faults.silent = True
                b.driver.stop()
                await until(lambda: b.driver.devices["D"].kept.writing is None, "it is broken off")
                b.far.end.faults.silent, b.far.end.faults.delay_s = False, 0.0
                await until(b.driver.devices["D"].kept.stopped.is_set, "the stop is over")
            assert b.machine.events[-1] == "output"
            assert b.driver.unconfirmed == ()

        self.bench(test, timeout_s=QUICK_S)

    def test_a_driver_that_is_cancelled_drives_the_safe_outputs_on_its_way_out(self) -> None:
        """However a run ends, its machines are stopped."""

        async def test(b: Bench) -> None:
            async with b.connected():
                pass
            assert b.machine.outputs == [False, False]

        self.bench(test)

    def test_nothing_is_commanded_before_the_contact_of_the_emergency_stop_was_read_as_closed(self) -> None:
        """Who presses it before the start stops the start."""

        async def test(b: Bench) -> None:
            b.machine.show("button", value=False)
            async with b.running():  # it may be known to be open a moment later, as a broker hears of it
                await until(lambda: b.heard.emergencies, "the contact is known to be open")
            b.begin()
            b.driver.send(b.place("move"), 1)
            async with b.running():
                await until(lambda: b.heard.emergencies, "the emergency stop")
                await until(lambda: b.machine.outputs, "the safe outputs")
                b.machine.show("button", value=True)
                await until(b.driver.devices["D"].kept.stopped.is_set, "the stop is over")
            assert b.heard.emergencies == ["D: 'button' is open"]
            assert b.machine.orders == []
            for _ in range(1000):  # a start may come before everybody knows that it is closed again
                if b.machine.orders:
                    break
                b.begin()
                b.driver.send(b.place("move"), 1)
                async with b.running():
                    await until(lambda: b.machine.orders or b.heard.emergencies, "a start")
            assert b.machine.orders
            assert b.heard.emergencies == []

        self.bench(test, button=True)

    def test_an_open_contact_of_the_emergency_stop_stops_the_machines_and_closing_it_starts_none(self) -> None:
        """It drives the safe outputs by itself, tells of it, and commands nothing any more."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 1)
                await until(lambda: b.machine.orders, "the command arrives")
                driven = len(b.machine.outputs)
                b.machine.show("button", value=False)
                await until(lambda: b.heard.emergencies, "the emergency stop")
                assert b.driver.is_stopped
                b.machine.show("button", value=True)
                b.driver.send(b.place("halt"), 1)
                await until(lambda: len(b.machine.outputs) > driven, "the safe outputs")
            assert set(b.machine.outputs) == {False}
            assert len(b.machine.outputs) == 2 or b.far.through_broker
            assert b.heard.emergencies == ["D: 'button' is open"]
            assert b.machine.events[-1] == "output"
            assert len(b.machine.orders) == 1

        self.bench(test, button=True)

    def test_a_contact_of_the_emergency_stop_that_cannot_be_read_is_open(self) -> None:
        """Nobody could press it: there is no time of grace."""

        async def lost(b: Bench) -> None:
            async with b.connected():
                await b.far.end.cut()
                await until(lambda: b.heard.emergencies, "the emergency stop")
            assert "D: 'button' cannot be read: " in b.heard.emergencies[0]

        async def garbled(b: Bench) -> None:
            async with b.connected():
                b.far.end.faults.garbage = True
                b.machine.show("button", value=True)
                await until(lambda: b.heard.emergencies, "the emergency stop")
                b.far.end.faults.garbage = False

        async def never_reached(b: Bench) -> None:
            await b.far.end.cut()
            async with b.running():
                await until(lambda: b.heard.emergencies, "the emergency stop")
            assert "was not read within 0.05 s" in b.heard.emergencies[0]

        self.bench(lost, button=True, timeout_s=QUICK_S)
        self.bench(garbled, button=True, timeout_s=QUICK_S)
        self.bench(never_reached, button=True, start_s=0.05, timeout_s=QUICK_S)

    def test_the_watchdog_of_the_device_acts_when_the_driver_freezes(self) -> None:
        """A process that hangs cannot stop its machines; the device misses its heartbeat and does."""

        async def test(b: Bench) -> None:
            b.machine.watchdog_s = 1.0
            thawed = threading.Event()
            loop = asyncio.new_event_loop()
            thread = threading.Thread(target=loop.run_forever)
            thread.start()
            running = asyncio.run_coroutine_threadsafe(b.driver.run(b.heard, b.heard), loop)
            try:
                await until(lambda: b.machine.beats > 3, "heartbeats")
                assert b.machine.outputs == [False]
                loop.call_soon_threadsafe(thawed.wait)  # sockets stay open, nothing moves: a frozen process
                await until(lambda: len(b.machine.outputs) == 2, "the watchdog")
                assert b.machine.outputs[-1] is False
                thawed.set()
                await until(lambda: b.heard.faults, "the driver is told")
                assert "watchdog" in b.heard.faults[0]
            finally:
                thawed.set()
                running.cancel()
                await until(lambda: running.done() and not asyncio.all_tasks(loop), "the end")
                loop.call_soon_threadsafe(loop.stop)
                await asyncio.to_thread(thread.join)
                loop.close()

        self.bench(test)

    def test_after_a_restart_the_machine_says_what_became_of_a_command(self) -> None:
        """The numbers that the machine shows say it."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 7)
                await until(lambda: b.machine.orders, "the command arrives")
            b.begin()
            async with b.connected():
                # The safe outputs of the start have come between; the machine would show if they had ended it.
                assert await b.driver.ask(b.place("move"), 7) is Answer.WORKING
                assert await b.driver.ask(b.place("grip"), 1) is Answer.NOT_RECEIVED
                assert b.heard_of("moved") == []
                b.machine.finish()
                await until(lambda: b.heard_of("moved") == [(True, 7)], "the completion")
            b.begin()
            async with b.connected():
                assert await b.driver.ask(b.place("move"), 7) is Answer.DONE
                assert await b.driver.ask(b.place("move"), 8) is Answer.NOT_RECEIVED
                assert await b.driver.ask(b.place("grip"), 1) is Answer.NOT_RECEIVED
                b.driver.send(b.place("move"), 8)
                await until(lambda: len(b.machine.orders) == 2, "the command arrives")
                b.machine.finish()
                await until(lambda: b.heard_of("moved"), "the completion")
            assert b.heard_of("moved") == [(True, 8)]

        self.bench(test, timeout_s=2 * QUICK_S)

    def test_a_machine_that_the_safe_outputs_of_the_start_have_stopped_leaves_it_to_a_person(self) -> None:
        """How far it has come is to be seen only there."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.driver.send(b.place("move"), 7)
                await until(lambda: b.machine.orders, "the command arrives")
            b.machine.stands_at_output = True
            b.begin()
            async with b.connected():
                assert await b.driver.ask(b.place("move"), 7) is Answer.UNKNOWN
                assert await b.driver.ask(b.place("move"), 8) is Answer.NOT_RECEIVED
            assert len(b.machine.orders) == 1

        self.bench(test, timeout_s=2 * QUICK_S)

    def test_a_command_that_comes_late_is_neither_told_as_not_received_nor_given_twice(self) -> None:
        """What stands before the machine when a restart asks is taken by it some time, and then it has it."""

        async def test(b: Bench, *, is_asked_in_time: bool) -> None:
            async with b.connected():
                b.machine.takes = False
                b.driver.send(b.place("move"), 7)
                await until(lambda: {"number", "command"} & {*b.machine.events}, "the number is written")
            b.begin()
            async with b.connected():
                asked = asyncio.create_task(b.driver.ask(b.place("move"), 7))
                if is_asked_in_time:
                    for _ in range(10):
                        await asyncio.sleep(0)
                    b.machine.takes = True
                    assert await asked is Answer.WORKING
                else:
                    assert await asked is Answer.NOT_RECEIVED
                    b.machine.takes = True
                    b.machine.show("sensor", value=True)
                    await until(lambda: b.heard_of("held")[-1:] == [(True, None)], "what comes later is read")
                    b.driver.send(b.place("move"), 7)
                    await until(lambda: b.heard.takings == [("M.move", 7)], "it is told as taken")
                b.machine.finish()
                await until(lambda: b.heard_of("moved") == [(True, 7)], "the completion")
            assert len(b.machine.orders) == 1

        self.bench(partial(test, is_asked_in_time=True), timeout_s=2 * QUICK_S)
        self.bench(partial(test, is_asked_in_time=False), timeout_s=QUICK_S)

    def test_a_command_whose_confirmation_is_lost_is_had_by_the_machine_once(self) -> None:
        """The line breaks as the machine takes it: what it shows says so, to this run and to the next one."""

        async def test(b: Bench) -> None:
            async with b.connected():
                b.machine.orders = orders = Breaking(b)
                b.driver.send(b.place("move"), 7)
                await until(lambda: orders, "the command arrives")
                await orders.cutting
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
                await b.far.end.mend()
                await until(lambda: b.heard.takings == [("M.move", 7)], "it is told as taken")
                await b.far.end.cut()
                await until(lambda: not b.driver.devices["D"].is_ready.is_set(), "the loss")
            await b.far.end.mend()
            b.begin()
            async with b.connected():
                assert await b.driver.ask(b.place("move"), 7) is Answer.WORKING
            assert len(orders) == 1

        self.bench(test, timeout_s=QUICK_S)

    def test_a_machine_that_cannot_be_reached_leaves_it_unknown(self) -> None:
        """An answer is not made up."""

        async def test(b: Bench) -> None:
            await b.far.end.cut()
            async with b.running():
                assert await b.driver.ask(b.place("move"), 1) is Answer.UNKNOWN

        self.bench(test, start_s=0.05, timeout_s=QUICK_S)

    def test_a_latched_driver_drives_the_safe_outputs_on_each_connection_until_it_is_released(self) -> None:
        """After an emergency stop an open contact and a lost device are no news, and what is sent moves nothing."""

        async def test(b: Bench) -> None:
            async with b.connected():
                await until(lambda: b.machine.outputs, "the safe outputs")
                b.driver.send(b.place("move"), 1)
                b.machine.show("button", value=False)
                await until(lambda: tuple(b.driver.against()) == ("D: 'button' is not closed",), "the contact")
                await b.far.end.cut()
                await until(lambda: tuple(b.driver.against()) == ("D is not connected",), "the loss")
                driven = len(b.machine.outputs)
                await b.far.end.mend()
                await until(lambda: len(b.machine.outputs) > driven, "the safe outputs of another connection")
                assert set(b.machine.outputs) == {False}
                assert len(b.machine.outputs) == 2 or b.far.through_broker
                b.machine.show("button", value=True)
                await until(lambda: not b.driver.against(), "nothing is against it")
                assert b.machine.orders == []
                assert b.heard.emergencies == b.heard.faults == []
                b.driver.release()
                await b.ordered(1)
                b.machine.show("button", value=False)
                await until(lambda: b.heard.emergencies, "the emergency stop")
            assert b.heard.emergencies == ["D: 'button' is open"]

        self.bench(test, button=True, latched=True, needed="fault", timeout_s=QUICK_S)

    def test_a_latched_driver_is_not_to_be_released_while_a_device_gives_no_sign_of_life(self) -> None:
        """What it shows may be what it showed before it died, also that its button is not pressed."""

        async def test(b: Bench) -> None:
            b.machine.lives = False
            kept, against = b.driver.devices["D"].kept, set[str]()

            def looked() -> bool:
                against.add("; ".join(b.driver.against()))
                return kept.connections == 3

            async with b.running():
                await until(looked, "two more connections")
                assert against == {"D is not connected", "D has not been seen to be alive"}
                assert len(b.machine.outputs) >= 2
                b.machine.lives = True
                await until(lambda: not b.driver.against(), "nothing is against it")

        self.bench(test, button=True, latched=True, within_s=QUICK_S)

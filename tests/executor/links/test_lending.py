"""A loop that lends itself: what another thread does on it is done as by a callback, and never beside one."""

import asyncio
import threading
import time
from collections.abc import Callable

import pytest

from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.links.lending import LendingLoop


def on_a_thread(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)  # which a test that fails leaves behind
    thread.start()
    return thread


def test_a_loop_that_sleeps_is_lent_and_does_what_it_was_given_meanwhile() -> None:
    here: list[object] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, LendingLoop)
        done = loop.create_future()

        def work() -> None:
            here.append((asyncio.get_running_loop() is loop, threading.current_thread() is not threading.main_thread()))
            loop.call_later(0.001, done.set_result, "in time")

        def lending() -> None:
            while not loop.lend(work):
                time.sleep(0.0001)

        thread = on_a_thread(lending)
        async with asyncio.timeout(PATIENCE_S):  # without its being woken it would sleep that long
            here.append(await done)
        thread.join()

    with asyncio.Runner(loop_factory=LendingLoop) as runner:
        runner.run(main())
    assert here == [(True, True), "in time"]


def test_a_loop_that_works_is_not_lent_nor_one_that_does_not_run() -> None:
    loop = LendingLoop()
    assert not loop.lend(pytest.fail)

    async def main() -> None:
        lent: list[bool] = []
        on_a_thread(lambda: lent.append(loop.lend(pytest.fail))).join()  # the loop waits here, in a callback
        assert lent == [False]

    loop.run_until_complete(main())
    assert not loop.lend(pytest.fail)
    loop.close()


def test_callbacks_and_what_others_do_exclude_each_other() -> None:
    inside: list[int] = []
    together: list[int] = []
    lent = 0

    def work() -> None:
        inside.append(0)
        time.sleep(0.0002)  # others may run meanwhile
        together.append(len(inside))
        inside.pop()

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, LendingLoop)
        over = threading.Event()

        def lending() -> None:
            nonlocal lent
            while not over.is_set():
                lent += loop.lend(work)
                time.sleep(0.0001)

        threads = [on_a_thread(lending) for _ in range(2)]
        try:
            while lent < 50:
                work()
                await asyncio.sleep(0.0001)
        finally:
            over.set()
            for thread in threads:
                await asyncio.to_thread(thread.join)

    with asyncio.Runner(loop_factory=LendingLoop) as runner:
        runner.run(asyncio.wait_for(main(), PATIENCE_S))
    assert set(together) == {1}


def test_what_fails_on_a_loan_is_raised_there_and_the_loop_is_given_back() -> None:
    raised: list[BaseException] = []

    def fail() -> None:
        raise ValueError("on a loan")

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, LendingLoop)

        def lending() -> None:
            try:
                while not loop.lend(fail):
                    time.sleep(0.0001)
            except ValueError as error:
                raised.append(error)

        thread = on_a_thread(lending)
        await until(lambda: not thread.is_alive(), "the loan")
        assert not loop.is_lent

    with asyncio.Runner(loop_factory=LendingLoop) as runner:
        runner.run(main())
    assert str(raised[0]) == "on a loan"

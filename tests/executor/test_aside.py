"""What is told aside is told in order, and keeps nobody waiting who tells it."""

import os
import time
from pathlib import Path
from threading import Event

from firable.cli.log import log_to
from firable.executor.drivers.bench import PATIENCE_S
from firable.executor.operating.aside import LAST_WORDS_SECONDS, aside


def test_all_is_said_in_order_before_the_end() -> None:
    heard: list[tuple[int, str]] = []
    with aside(lambda number, *, word: heard.append((number, word))) as tell:
        for number in range(1000):
            tell(number, word="so")
    assert heard == [(number, "so") for number in range(1000)]


def test_who_does_not_listen_keeps_nobody_waiting_and_the_end_only_so_long() -> None:
    listens, heard = Event(), list[str]()

    def slow(word: str) -> None:
        assert listens.wait(PATIENCE_S)
        heard.append(word)

    with aside(slow, seconds=0.05) as tell:
        tell("one")
        tell("two")
        assert heard == []
    assert heard == []
    listens.set()


def test_an_error_of_whoever_is_told_is_raised_by_a_later_call_once_and_what_that_tells_is_said() -> None:
    said = {word: Event() for word in ("first", "second", "third")}

    def say(word: str) -> None:
        said[word].set()
        if word == "first":
            raise BrokenPipeError(32, "Broken pipe")

    raised = 0
    with aside(say) as tell:
        for word, heard in said.items():
            try:
                tell(word)
            except BrokenPipeError:
                raised += 1
            assert heard.wait(PATIENCE_S)  # when the second is said, the error of the first is known
    assert raised == 1


def test_a_log_whose_reader_sleeps_keeps_no_run_waiting(tmp_path: Path) -> None:
    pipe = tmp_path / "log"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    begun = time.monotonic()
    with log_to(str(pipe)) as log:
        assert log is not None
        for _ in range(200):  # more than a pipe holds
            log.began("n" * 1000, ["robot"])
        assert time.monotonic() - begun < PATIENCE_S
    os.set_blocking(reader, True)
    assert b'"event": "began"' in os.read(reader, 10_000)
    os.close(reader)
    assert LAST_WORDS_SECONDS < PATIENCE_S

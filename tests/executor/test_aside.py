"""What is told aside is told in order, and keeps nobody waiting who tells it."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event

import pytest

from firable.cli.log import log_to
from firable.cli.main import main
from firable.executor.drivers.bench import PATIENCE_S
from firable.executor.operating.aside import LINES_MAX, UntoldError, aside


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
    before = threading.active_count()
    with log_to(str(pipe)) as log:
        assert log is not None
        for _ in range(200):  # more than a pipe holds
            log.began("n" * 1000, ["robot"])
        assert time.monotonic() - begun < PATIENCE_S
    assert b'"event": "began"' in os.read(reader, 10_000)
    while threading.active_count() > before:  # until all is said, and nobody writes into what is closed
        with suppress(BlockingIOError):
            os.read(reader, 100_000)
    os.close(reader)


def test_more_than_a_memory_holds_is_not_kept_and_how_much_that_was_is_said() -> None:
    listens = Event()
    heard: list[int] = []

    def slow(number: int) -> None:
        assert listens.wait(PATIENCE_S)
        heard.append(number)

    with aside(slow) as tell:
        for number in range(LINES_MAX + 100):
            tell(number)
        listens.set()
        wait_until(lambda: len(heard) >= LINES_MAX)
        with pytest.raises(UntoldError, match=r"^\d+ lines were told to nobody"):
            tell(-1)
    assert heard[-1] == -1
    assert len(heard) < LINES_MAX + 10


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("log", ["pipe", "-"])
def test_a_log_whose_reader_sleeps_keeps_no_process_from_its_end(tmp_path: Path, log: str) -> None:
    bundle, pipe = str(tmp_path / "cell.bundle"), tmp_path / "pipe"
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    if log != "-":
        os.mkfifo(pipe)
    reader, writer = (os.open(pipe, os.O_RDONLY | os.O_NONBLOCK), None) if log != "-" else os.pipe()
    full = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK) if writer is None else os.dup(writer)
    os.set_blocking(full, False)
    with suppress(BlockingIOError):
        while True:
            os.write(full, b"x" * 4096)
    os.set_blocking(full, True)  # which both ends of it have in common
    command = [sys.executable, "-m", "firable.cli.main", "run", bundle, "--workpieces", "1", "--log"]
    done = subprocess.run(
        [*command, log if log == "-" else str(pipe)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE if writer is None else writer,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0
    assert b"1 workpiece" in done.stdout
    for descriptor in (reader, full, *([] if writer is None else [writer])):
        os.close(descriptor)

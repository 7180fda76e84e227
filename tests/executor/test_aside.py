"""What is told aside is told in order, and keeps nobody waiting who tells it."""

import asyncio
import io
import json
import logging
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
from support.slow_disks import CELL

from firable.cli.log import log_to, told_aside
from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.aside import LINES_MAX, UNSAID, UntoldError, aside
from firable.executor.operating.host import Host
from firable.executor.operating.log import Log, logger_to
from firable.executor.operating.recorder import Recorder
from firable.nets.text import parse_net


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


def test_errors_of_whoever_is_told_are_raised_by_a_later_call_once_by_the_names_of_their_lines() -> None:
    said = {word: Event() for word in ("first", "second", "third", "fourth")}

    def say(word: str) -> None:
        said[word].set()
        if word in {"first", "second"}:
            raise BrokenPipeError(32, "Broken pipe")

    raised: list[UntoldError] = []
    with aside(say, named=lambda word: word) as tell:
        for word, heard in said.items():
            try:
                tell(word)
            except UntoldError as error:
                raised.append(error)
            assert heard.wait(PATIENCE_S)  # when the next is said, the error of the one before is known
    assert [list(error.untold) for error in raised] == [
        [(word, "BrokenPipeError: [Errno 32] Broken pipe")] for word in ("first", "second")
    ]
    assert str(raised[0]) == "1 line was told to nobody (first): BrokenPipeError: [Errno 32] Broken pipe"
    assert [type(one) for error in raised for one in error.errors] == [BrokenPipeError, BrokenPipeError]


def test_the_error_of_the_last_line_is_left_and_so_is_what_is_not_said_in_time() -> None:
    listens, asleep, left = Event(), Event(), list[UntoldError]()

    def say(word: str) -> None:
        if word == "sleep":
            asleep.set()
            assert listens.wait(PATIENCE_S)
        raise ValueError(word)

    with aside(say, named=lambda word: word, left=left.append) as tell:
        tell("last")
    with aside(say, 0.05, named=lambda word: word, left=left.append) as tell:
        tell("sleep")
        tell("on")
        assert asleep.wait(PATIENCE_S)
    assert [list(error.untold) for error in left] == [
        [("last", "ValueError: last")],
        [("sleep", UNSAID), ("on", UNSAID)],
    ]
    with aside(print, left=left.append):
        pass
    assert len(left) == 2
    listens.set()


def test_the_trace_names_the_line_that_was_told_to_nobody_and_not_the_next() -> None:
    net = parse_net(CELL)
    stream = io.StringIO()
    drawn = split(net)
    host = Host(drawn, DryRunDriver(drawn.subnets, 1.0), Recorder(net, "", stream))

    def gone(kind: str, _: str) -> None:
        if kind == "lost":
            raise BrokenPipeError(32, "Broken pipe")

    async def main() -> None:
        with told_aside(gone, None) as host.tell:
            ending = asyncio.create_task(host.main())
            await asyncio.sleep(0)
            host.tell_operator("lost", "'robot' is lost")
            await until(lambda: is_noted("connected"), "the note")
            host.stop()
            await ending

    def is_noted(kind: str) -> bool:
        host.tell_operator(kind, "'robot' is connected")
        return '"untold"' in stream.getvalue()

    asyncio.run(main())
    noted = [json.loads(line) for line in stream.getvalue().splitlines()]
    (untold,) = [line for line in noted if line.get("note") == "untold"]
    assert untold["what"] == "lost"
    assert untold["message"] == "1 line was told to nobody (lost): BrokenPipeError: [Errno 32] Broken pipe"


def test_a_log_hears_of_the_last_words_that_an_operator_was_not_told() -> None:
    def gone(_kind: str, _sentence: str) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    lines = io.StringIO()
    with told_aside(gone, Log(logger_to(logging.StreamHandler(lines)))) as tell:
        tell("fault", "the trace cannot be written")
    (line,) = [json.loads(one) for one in lines.getvalue().splitlines()]
    assert (line["level"], line["event"], line["what"]) == ("warning", "untold", "fault")


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

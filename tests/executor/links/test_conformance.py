"""What every link does, whatever carries it."""

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from typing import Any

import pytest
from support.link_rigs import PATIENCE_SECONDS, Heard, Rig, in_process, over_a_serial_line, over_zenoh, running

from firable.executor.links.lending import LendingLoop
from firable.executor.links.link import COORDINATOR, Greeting, Link
from firable.executor.links.standing import Standing
from firable.executor.links.storages import LIVES_MAX, Memory, Met, Storage
from firable.executor.protocol.messages import Acknowledgement, Decision, Message, Readiness, Report, Vote, VoteRequest

Make = Callable[[], AbstractAsyncContextManager[Rig]]

CENTRE = Greeting("d1", (COORDINATOR,))
ROBOT = Greeting("d1", ("robot",))
READY = Readiness(4, frozenset({"G2", "G4"}))
TO_CONTROLLER: list[Message] = [
    VoteRequest("robot", (7 << 32) + 1, ("G2", "G4"), 7 << 32, -1),
    Decision("robot", 1, None, 0, 3),
    Decision("robot", 2, "Übergabe/*", 0, 3),
]
TO_COORDINATOR: list[Message] = [
    Report("robot", READY),
    Vote("robot", 1, frozenset(), READY),
    Acknowledgement("robot", 2, READY),
]


def run(make: Make, main: Coroutine[Any, Any, None]) -> None:
    """Run a test on the kind of loop that hosts with such a link have; Zenoh's own tests run on an ordinary one."""
    with asyncio.Runner(loop_factory=LendingLoop if make is over_zenoh else None) as runner:
        runner.run(main)


async def deliver(link: Link, heard: Heard, sender: str, receiver: str, messages: list[Message]) -> None:
    """Send until all have arrived: a link may lose some."""
    while not set(messages) <= {m for _, _, m in heard.messages}:
        for message in messages:
            link.send(sender, receiver, message)
        await asyncio.sleep(0.02)


async def told_so_often(heard: Heard, what: tuple[str, str], times: int) -> None:
    """Wait until this was told as often."""
    await heard.until(lambda: heard.told.count(what) == times)


@pytest.mark.parametrize("make", [in_process, over_zenoh, over_a_serial_line])
class TestLink:
    def test_hosts_learn_who_is_connected(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig, running(rig.link(CENTRE)) as centre:
                async with running(rig.link(ROBOT)) as robot, running(rig.link(replace(ROBOT, names=("mc",)))) as mc:
                    await robot.until_told(("connected", COORDINATOR))
                    await mc.until_told(("connected", COORDINATOR))
                    await centre.until_told(("connected", "robot"), ("connected", "mc"))
                await centre.until_told(("lost", "robot"), ("lost", "mc"))

        run(make, main())

    def test_messages_arrive_as_they_were_sent_or_not_at_all(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                here, there = rig.link(CENTRE), rig.link(ROBOT)
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
                    await robot.until_told(("connected", COORDINATOR))
                    await deliver(here, robot, COORDINATOR, "robot", TO_CONTROLLER)
                    await deliver(there, centre, "robot", COORDINATOR, TO_COORDINATOR)
                assert {(s, r) for s, r, _ in robot.messages} == {(COORDINATOR, "robot")}
                assert {(s, r) for s, r, _ in centre.messages} == {("robot", COORDINATOR)}
                assert {m for _, _, m in robot.messages} == set(TO_CONTROLLER)
                assert {m for _, _, m in centre.messages} == set(TO_COORDINATOR)

        run(make, main())

    def test_a_host_with_two_machines_is_reached_by_both_names(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                here, there = rig.link(CENTRE), rig.link(replace(ROBOT, names=("system", "robot")))
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as both:
                    await centre.until_told(("connected", "robot"), ("connected", "system"))
                    await deliver(here, both, COORDINATOR, "robot", TO_CONTROLLER)
                    await deliver(here, both, COORDINATOR, "system", [VoteRequest("system", 9, ("G1",), 0, 0)])
                assert {r for _, r, _ in both.messages} == {"robot", "system"}

        run(make, main())

    @pytest.mark.parametrize("other", [replace(ROBOT, digest="d2"), replace(ROBOT, version=99)])
    def test_a_host_of_another_bundle_or_version_is_refused_and_not_heard(self, make: Make, other: Greeting) -> None:
        async def main() -> None:
            async with make() as rig:
                here, there = rig.link(CENTRE), rig.link(other)
                async with running(here) as centre, running(there) as stranger:
                    await centre.until_told(("refused", "robot"))
                    await stranger.until_told(("refused", COORDINATOR))
                    there.send("robot", COORDINATOR, TO_COORDINATOR[0])
                    here.send(COORDINATOR, "robot", TO_CONTROLLER[0])
                    await asyncio.sleep(0.1)
                    assert not centre.messages
                    assert not stranger.messages
                    assert {told for told, _ in centre.told} == {"refused"}
                    assert {problem.code for problem in centre.problems} == {"F5020"}
                    assert ("another bundle" in centre.problems[0].message) is (other.digest != "d1")

        run(make, main())

    def test_of_a_host_that_was_refused_is_told_that_it_is_gone_and_of_the_right_one_that_it_is_there(
        self, make: Make
    ) -> None:
        async def main() -> None:
            async with make() as rig, asyncio.timeout(PATIENCE_SECONDS), running(rig.link(CENTRE)) as centre:
                for times in (1, 2):
                    async with running(rig.link(replace(ROBOT, digest="d2"))):
                        await told_so_often(centre, ("refused", "robot"), times)
                        assert centre.told.count(("gone", "robot")) == times - 1
                    await told_so_often(centre, ("gone", "robot"), times)
                async with running(rig.link(ROBOT)):
                    await centre.until_told(("connected", "robot"))
                await centre.until_told(("lost", "robot"))
                assert centre.told.count(("gone", "robot")) == 2

        run(make, main())

    def test_a_cut_line_is_noticed_by_both_and_mends(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                here, there = rig.link(CENTRE), rig.link(ROBOT)
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
                    await robot.until_told(("connected", COORDINATOR))
                    await centre.until_told(("connected", "robot"))
                    rig.cut()
                    await robot.until_told(("lost", COORDINATOR))
                    await centre.until_told(("lost", "robot"))
                    there.send("robot", COORDINATOR, TO_COORDINATOR[0])  # lost, and no error
                    rig.mend()
                    await robot.until(lambda: robot.told[-1] == ("connected", COORDINATOR))
                    await centre.until(lambda: centre.told[-1] == ("connected", "robot"))
                    await deliver(here, robot, COORDINATOR, "robot", TO_CONTROLLER)
                    await deliver(there, centre, "robot", COORDINATOR, TO_COORDINATOR)

        run(make, main())

    def test_a_host_that_is_started_anew_is_lost_and_connected(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                here = rig.link(CENTRE)
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre:
                    memory = Memory(Storage("r1"))
                    for _ in range(2):
                        there = rig.link(ROBOT)
                        async with running(there, memory) as robot:
                            await robot.until_told(("connected", COORDINATOR))
                            await centre.until(lambda: centre.told[-1:] == [("connected", "robot")])
                            await deliver(here, robot, COORDINATOR, "robot", TO_CONTROLLER)
                        memory = robot.memory
                    assert [told for told, _ in centre.told][:3] == ["connected", "lost", "connected"]

        run(make, main())

    def test_a_host_that_comes_back_with_another_storage_is_refused_and_told_so(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                here = rig.link(CENTRE)
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre:
                    async with running(rig.link(ROBOT), Memory(Storage("r1"))):
                        await centre.until_told(("connected", "robot"))
                    await centre.until_told(("lost", "robot"))
                    there = rig.link(ROBOT)
                    async with running(there, Memory(Storage("r2"))) as robot:
                        await centre.until_told(("refused", "robot"))
                        await robot.until_told(("disowned", COORDINATOR))
                        there.send("robot", COORDINATOR, TO_COORDINATOR[0])
                        here.send(COORDINATOR, "robot", TO_CONTROLLER[0])
                        await asyncio.sleep(0.1)
                        assert not centre.messages
                        assert not robot.messages
                        assert ("connected", COORDINATOR) not in robot.told
                        assert not robot.memory.known
                    assert [problem.code for problem in centre.problems] == ["F5025"]
                    assert centre.told.count(("connected", "robot")) == 1
                    async with running(rig.link(ROBOT), Memory(Storage("r1"))):
                        await centre.until(lambda: centre.told.count(("connected", "robot")) == 2)

        run(make, main())

    def test_a_message_bears_how_often_the_storage_of_its_sender_was_made_durable(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                there = rig.link(ROBOT)
                async with running(rig.link(CENTRE)) as centre, running(there) as robot:
                    await robot.until_told(("connected", COORDINATOR))
                    for age in (3, 1 << 40):
                        robot.age = age
                        while age not in centre.ages:  # what was sent before may be on its way still
                            await deliver(there, centre, "robot", COORDINATOR, TO_COORDINATOR)
                            centre.messages.clear()
                assert set(centre.ages) == {3, 1 << 40}

        run(make, main())

    def test_how_a_host_stands_is_told_to_whoever_is_connected(self, make: Make) -> None:
        """Before they meet, while they are connected, and when they meet again."""

        async def main() -> None:
            async with make() as rig:
                here, there = rig.link(CENTRE), rig.link(ROBOT)
                there.stand(Standing.HELD)
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre, running(there) as robot:
                    await robot.until_told(("connected", COORDINATOR))
                    await centre.until_told(("held", "robot"))
                    await deliver(there, centre, "robot", COORDINATOR, TO_COORDINATOR)
                    there.stand(Standing.GOING)
                    await centre.until_told(("going", "robot"))
                    there.stand(Standing.PAUSED)
                    await centre.until_told(("paused", "robot"))
                    rig.cut()
                    await centre.until_told(("lost", "robot"))
                    there.stand(Standing.LATCHED)
                    rig.mend()
                    await centre.until_told(("latched", "robot"))
                    await deliver(here, robot, COORDINATOR, "robot", TO_CONTROLLER)
                    assert {what for what, _ in robot.told} <= {"connected", "lost"}
                async with asyncio.timeout(PATIENCE_SECONDS), running(here) as centre:
                    for times in range(1, 6):
                        async with running(there, Memory(Storage("r1"))):
                            await told_so_often(centre, ("latched", "robot"), times)
                        await told_so_often(centre, ("lost", "robot"), times)
                    assert ("going", "robot") not in centre.told, "it has not gone on before it ended"

        run(make, main())

    @pytest.mark.parametrize(("life", "age"), [("first", 8), ("of another copy", 1)])
    def test_a_host_that_comes_back_with_an_older_copy_is_refused_and_one_with_all_that_was_heard_is_not(
        self, make: Make, life: str, age: int
    ) -> None:
        async def main() -> None:
            async with make() as rig:
                before = Storage("r1").in_new_life("first", 0)
                memory = Memory(Storage("c1"), {"robot": Met("r1", life, age)})
                async with running(rig.link(CENTRE), memory) as centre:
                    there = rig.link(ROBOT)
                    async with running(there, Memory(before.in_new_life("second", 7))) as robot:
                        await centre.until_told(("refused", "robot"))
                        await robot.until_told(("disowned", COORDINATOR))
                        there.send("robot", COORDINATOR, TO_COORDINATOR[0])
                        await asyncio.sleep(0.1)
                        assert not centre.messages
                        assert ("connected", COORDINATOR) not in robot.told
                        assert "an older copy" in robot.problems[0].message
                    assert "an older copy" in centre.problems[0].message
                    whole = Storage("r1").in_new_life(life, 0).in_new_life("third", age)
                    async with running(rig.link(ROBOT), Memory(whole)):
                        await centre.until_told(("connected", "robot"))

        run(make, main())

    def test_of_two_hosts_that_each_know_the_other_as_an_older_copy_both_are_told(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                centre_knows = Memory(Storage("c1").in_new_life("now", 1), {"robot": Met("r1", "lost", 1)})
                robot_knows = Memory(Storage("r1").in_new_life("now", 1), {COORDINATOR: Met("c1", "lost", 1)})
                async with (
                    running(rig.link(CENTRE), centre_knows) as centre,
                    running(rig.link(ROBOT), robot_knows) as robot,
                ):
                    await centre.until_told(("disowned", "robot"))
                    await robot.until_told(("disowned", COORDINATOR))
                    assert "connected" not in {told for told, _ in (*centre.told, *robot.told)}

        run(make, main())

    def test_within_a_life_whatever_was_heard_of_it_is_none_against_it(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                memory = Memory(Storage("r1").in_new_life("first", 1))
                async with running(rig.link(CENTRE)) as centre, running(rig.link(ROBOT), memory) as robot:
                    await centre.until_told(("connected", "robot"))
                    await robot.until_told(("connected", COORDINATOR))
                    centre.memory = replace(centre.memory, known={"robot": Met("r1", "first", 9)})
                    rig.cut()
                    await robot.until_told(("lost", COORDINATOR))
                    await centre.until_told(("lost", "robot"))
                    rig.mend()
                    await centre.until(lambda: centre.told[-1] == ("connected", "robot"))
                    assert not centre.problems

        run(make, main())

    @pytest.mark.parametrize("lives", [LIVES_MAX])
    def test_a_storage_of_many_lives_is_told_whole(self, make: Make, lives: int) -> None:
        async def main() -> None:
            storage = Storage("0123abcd")
            for life in range(lives):
                storage = storage.in_new_life(f"{life:08x}", 10**6 + life)
            async with make() as rig:
                others = {f"machine_{i}": Met(storage.name, "00000000", 10**6) for i in range(200)}
                memory = Memory(Storage("c1"), {"robot": Met(storage.name, "00000000", 10**6 + 1), **others})
                async with running(rig.link(CENTRE), memory) as centre, running(rig.link(ROBOT), Memory(storage)):
                    await centre.until_told(("connected", "robot"))
                    assert not centre.problems

        run(make, main())

    def test_of_two_machines_of_a_host_one_that_is_known_otherwise_keeps_both_away(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                both = rig.link(replace(ROBOT, names=("system", "robot")))
                centre_knows = Memory(Storage("c1"), {"system": Met("r1")})
                async with (
                    running(rig.link(CENTRE), centre_knows) as centre,
                    running(both, Memory(Storage("r2"))) as stranger,
                ):
                    await centre.until_told(("refused", "system"))
                    await stranger.until_told(("disowned", COORDINATOR))
                    await asyncio.sleep(0.2)
                    assert "connected" not in {told for told, _ in stranger.told}
                    both.send("robot", COORDINATOR, TO_COORDINATOR[0])
                    await asyncio.sleep(0.1)
                    assert not centre.messages
                    assert centre.told.count(("connected", "robot")) == centre.told.count(("lost", "robot"))

        run(make, main())

    def test_a_coordinator_that_is_started_anew_is_met_again(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                there = rig.link(ROBOT)
                async with asyncio.timeout(PATIENCE_SECONDS), running(there) as robot:
                    memory = Memory(Storage("c1"))
                    for _ in range(2):
                        here = rig.link(CENTRE)
                        async with running(here, memory) as centre:
                            await robot.until(lambda: robot.told[-1:] == [("connected", COORDINATOR)])
                            await centre.until_told(("connected", "robot"))
                            await deliver(there, centre, "robot", COORDINATOR, TO_COORDINATOR)
                        memory = centre.memory
                    assert [told for told, _ in robot.told][:3] == ["connected", "lost", "connected"]

        run(make, main())

    def test_what_is_sent_to_nobody_is_lost_without_an_error(self, make: Make) -> None:
        async def main() -> None:
            async with make() as rig:
                link = rig.link(CENTRE)
                link.send(COORDINATOR, "robot", TO_CONTROLLER[0])
                async with running(link):
                    await asyncio.sleep(0.05)
                    link.send(COORDINATOR, "robot", TO_CONTROLLER[0])

        run(make, main())

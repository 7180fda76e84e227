"""What shows the conditions of refinement: documents that a checker reads; and that formulas say what searches find."""

import random
from dataclasses import replace

import pytest
from support.random_tasks import random_task

from firable.analysis.check import check
from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.document import document_from_text
from firable.decompose.refinement.carrying import METHOD, carried
from firable.decompose.refinement.closed import BlockProof, prove_block
from firable.decompose.refinement.confirming import TheoremError
from firable.decompose.refinement.evidence import conditions, refinement_evidence
from firable.decompose.refinement.refining import refine
from firable.nets.catalogue import catalogue_net, catalogue_tasks
from firable.nets.verdict import Status, Verdict

SAFE = ("ends-clean", "contact-free", "complete", "orderly")
"""The conditions that say the same whether the others hold or not."""


def answered(block: BlockProof) -> dict[str, Status]:
    """The conditions of a task as the verdicts on the formulas that state them."""
    net = replace(block.net, properties=tuple(conditions(block.task, block.net)))
    names = {"contact-free": "contact-free", "complete": "quasi-live"}
    report = check(net)
    every = ("ends", *SAFE, "settles")
    return {name: report.verdict(names.get(name, f"property.{name}")).status for name in every}


def searched(block: BlockProof) -> dict[str, Status]:
    return {verdict.name.partition(".")[2]: verdict.status for verdict in block.verdicts}


def test_formulas_and_searches_answer_alike_on_random_tasks() -> None:
    sound, violated = 0, set[str]()
    for seed in range(60):
        block = prove_block(random_task(random.Random(seed), "work"))
        said, found = answered(block), searched(block)
        # A run that is caught inside is endless for `settles`, and `ends` alone forbids it.
        names = ("ends", *SAFE, "settles") if block.sound else ("ends", *SAFE)
        assert {name: said[name] for name in names} == {name: found[name] for name in names}, seed
        sound += block.sound
        violated |= {name for name in names if found[name] is Status.VIOLATED}
    assert 10 < sound < 50
    assert violated >= {"ends", "ends-clean", "complete", "orderly", "settles"}


@pytest.fixture(scope="module")
def refined() -> tuple[tuple[Verdict, ...], dict[str, bytes]]:
    net = catalogue_net("conceptual_two_robots")
    refinement, report = refine(net, catalogue_tasks()), check(net)
    verdicts = [*refinement.conditions, *carried(refinement.correspondence, refinement.blocks, report)]
    return refinement_evidence(refinement.blocks, report, verdicts, detailed=refinement.net)


def test_every_condition_and_every_verdict_carried_over_names_documents_that_show_it(
    refined: tuple[tuple[Verdict, ...], dict[str, bytes]],
) -> None:
    verdicts, files = refined
    shown = {}
    for file, data in files.items():
        document = document_from_text(data.decode(), file)
        shown[file] = {one.record.name for one in check_document(document) if one.shown and one.record.proved}
    names = {"contact-free": "contact-free", "complete": "quasi-live"}
    for verdict in verdicts:
        if verdict.name.startswith("opens."):
            assert not verdict.evidence  # about arcs and gates
        elif verdict.method == METHOD:
            assert verdict.evidence == tuple(files)
        else:
            task, _, condition = verdict.name.partition(".")
            assert verdict.evidence == (f"{task}.task.evidence.json",)
            assert names.get(condition, f"property.{condition}") in shown[verdict.evidence[0]]
    assert "contact-free" in shown["conceptual-two-robots.evidence.json"]
    carried_over = {verdict.name for verdict in verdicts if verdict.method == METHOD and verdict.holds}
    assert len(carried_over) > 7
    assert shown["conceptual-two-robots.detailed.evidence.json"] == carried_over


def test_a_detailed_net_that_contradicts_the_theorem_is_a_fault_of_ours() -> None:
    net = catalogue_net("conceptual_one_robot")
    refinement, report = refine(net, catalogue_tasks()), check(net)
    over = [
        replace(verdict, status=Status.VIOLATED) if verdict.name == "reversible" else verdict
        for verdict in carried(refinement.correspondence, refinement.blocks, report)
    ]
    with pytest.raises(TheoremError, match="'reversible' is violated, says the theorem, and proved"):
        refinement_evidence((), report, over, detailed=refinement.net)


def test_a_condition_that_is_answered_otherwise_is_a_fault_of_ours() -> None:
    net = catalogue_net("conceptual_one_robot")
    block = prove_block(catalogue_tasks()["load"])
    verdicts = tuple(replace(v, status=Status.VIOLATED) if v.name == "load.settles" else v for v in block.verdicts)
    with pytest.raises(RuntimeError, match=r"'load\.settles' is violated by searching, proved by its formula"):
        refinement_evidence([replace(block, verdicts=verdicts)], check(net), verdicts)

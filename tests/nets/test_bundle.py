"""Bundles: what is written is read back, any change is refused, and what is not proved may not run."""

import hashlib
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import fields, replace
from io import BytesIO
from itertools import product
from pathlib import Path

import pytest
from support.evidence_names import document_naming
from support.examples import some

from firable.nets.archive import ArchiveError, pack, unpack
from firable.nets.bundle import Bundle, file_stem, read_bundle, write_bundle
from firable.nets.decomposition import ArbitrationGroup, Coordinated, Decomposition, Part
from firable.nets.diagnostics import InputError
from firable.nets.formula import Holds
from firable.nets.interchange import canonical_json
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    Net,
    Place,
    Property,
    PropertyKind,
    Transition,
)
from firable.nets.right_to_run import CHECKED, PROTOCOL, required_verdicts, unproved
from firable.nets.verdict import Cost, Cure, Status, Verdict, Wait, Weight, Witness

A, B = Controller("a"), Controller("b")
P, Q, R = (
    Place("a.p", "a", marked=True),
    Place("b.q", "b", command=Command("M", "GO", (("to", "é"),))),
    Place("a.r", "a"),
)
NET = Net(
    "tiny",
    (P, Q, R),
    (Transition("G", ("a.p",), ("b.q",), number=1), Transition("l", ("a.p",), ("a.r",))),
    controllers=(A, B),
    arbiters=(Arbiter("next", ("l", "G")),),
    properties=(Property("apart", PropertyKind.NEVER, Holds("b.q")),),
)
DECOMPOSITION = Decomposition(
    NET,
    (
        Net("a", (P, R), (Transition("t0-1", ("a.p",)), Transition("l", ("a.p",), ("a.r",))), controllers=(A,)),
        Net("b", (Q,), (Transition("t1-11", (), ("b.q",)),), controllers=(B,)),
    ),
    (Coordinated("G", 1, (Part("a", "t0-1"), Part("b", "t1-11")), "over"), Coordinated("l", None, (Part("a", "l"),))),
    (ArbitrationGroup("next", ("l", "G"), (), ArbitrationRule.PRIORITY),),
)
ON_THE_NET = (*CHECKED, "property.apart")
DOCUMENT = document_naming(NET, ON_THE_NET)
VERDICTS = tuple(
    Verdict(name, Status.PROVED, "it holds", "by hand", evidence=("check.evidence.json",), discipline="interleaving")
    if name in ON_THE_NET
    else Verdict(name, Status.PROVED, "it holds", "by hand", evidence=("eq7-G.smt2",))
    for name in required_verdicts(DECOMPOSITION)
)
BUNDLE = Bundle(DECOMPOSITION, VERDICTS, {"eq7-G.smt2": "(check-sat)\n", "check.evidence.json": DOCUMENT})


def refused(archive: bytes) -> bool:
    with pytest.raises(InputError) as refusal:
        Bundle.from_bytes(archive, "x.bundle")
    (diagnostic,) = refusal.value.diagnostics
    return diagnostic.code == "F5001" and bool(diagnostic.hint)


def with_new_hashes(members: Mapping[str, bytes]) -> bytes:
    """The archive of changed members, with a manifest that agrees with them."""
    files = {name: data for name, data in members.items() if name != "manifest.json"}
    manifest = json.loads(members["manifest.json"])
    manifest["members"] = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    del manifest["digest"]
    manifest["digest"] = hashlib.sha256(canonical_json(manifest)).hexdigest()
    return pack({**files, "manifest.json": canonical_json(manifest)})


def test_bundle_of_another_version_is_told_apart_from_a_damaged_one() -> None:
    members = unpack(BUNDLE.to_bytes())
    net = json.loads(members["net.json"])
    older = with_new_hashes({**members, "net.json": canonical_json({**net, "format": "firable-net/0"})})
    with pytest.raises(InputError) as refusal:
        Bundle.from_bytes(older, "x.bundle")
    (diagnostic,) = refusal.value.diagnostics
    assert diagnostic.code == "F5001"
    assert "made by another version of firable: 'net.json' is 'firable-net/0'" in diagnostic.message
    assert "damaged" not in diagnostic.message


def test_bundle_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    write_bundle(tmp_path / "tiny.bundle", BUNDLE)
    bundle = read_bundle(tmp_path / "tiny.bundle")
    assert bundle == BUNDLE
    assert bundle.digest == BUNDLE.digest
    assert bundle.to_bytes() == BUNDLE.to_bytes()


def test_any_zip_tool_opens_a_bundle() -> None:
    with zipfile.ZipFile(BytesIO(BUNDLE.to_bytes())) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == [
            *(
                "evidence/check.evidence.json",
                "evidence/eq7-G.smt2",
                "manifest.json",
                "net.json",
                "split.json",
                "subnets/a.json",
                "subnets/b.json",
            ),
            *("table.json", "verdicts.json"),
        ]
        assert archive.read("evidence/eq7-G.smt2") == b"(check-sat)\n"


def test_manifest_holds_the_digest_and_the_hash_of_every_file() -> None:
    members = unpack(BUNDLE.to_bytes())
    manifest = json.loads(members.pop("manifest.json"))
    assert manifest["digest"] == BUNDLE.digest
    assert manifest["members"] == {name: hashlib.sha256(data).hexdigest() for name, data in members.items()}
    assert manifest["cell"] == "tiny"


@pytest.mark.seeds
def test_change_of_any_byte_is_refused() -> None:
    archive = BUNDLE.to_bytes()
    for i, flip in some(product(range(len(archive)), (1, 0x20, 0xFF)), 3):
        assert refused(archive[:i] + bytes([archive[i] ^ flip]) + archive[i + 1 :]), (i, flip)


@pytest.mark.seeds
def test_change_of_any_byte_of_a_file_is_refused_though_the_archive_is_sound() -> None:
    members = unpack(BUNDLE.to_bytes())
    for name, i in some([(name, i) for name, data in members.items() for i in range(len(data))], 2):
        data = members[name]
        assert refused(pack({**members, name: data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :]})), (name, i)


def test_cut_off_bundle_is_refused() -> None:
    archive = BUNDLE.to_bytes()
    assert all(refused(archive[:length]) for length in range(len(archive)))


def test_bytes_before_and_behind_a_bundle_are_refused() -> None:
    archive = BUNDLE.to_bytes()
    assert refused(archive + b"\0")
    assert refused(b"\0" + archive)
    assert refused(archive + archive)


def test_added_and_missing_files_are_refused() -> None:
    members = unpack(BUNDLE.to_bytes())
    assert refused(pack({**members, "evidence/other.smt2": b""}))
    assert refused(with_new_hashes({**members, "other.txt": b""}))
    assert refused(with_new_hashes({**members, "subnets/c.json": members["subnets/b.json"]}))
    for name in members:
        assert refused(pack({other: data for other, data in members.items() if other != name}))


def test_what_a_controller_must_know_is_refused_where_it_does_not_follow_from_the_rest() -> None:
    members = unpack(BUNDLE.to_bytes())
    known = json.loads(members["split.json"])
    known["controllers"][0]["votes"] = []
    files = {**members, "split.json": canonical_json(known)}
    assert refused(with_judged_hashes(files))
    assert refused(with_new_hashes({name: data for name, data in members.items() if name != "split.json"}))


@pytest.mark.parametrize("name", ["net.json", "subnets/b.json", "table.json"])
def test_verdicts_do_not_pass_on_to_another_net(name: str) -> None:
    members = unpack(BUNDLE.to_bytes())
    changed = members[name].replace(b'"marked":false', b'"marked":true').replace(b"over", b"OVER")
    assert changed != members[name]
    assert refused(with_new_hashes({**members, name: changed}))


def test_other_spelling_of_the_same_content_is_refused() -> None:
    members = unpack(BUNDLE.to_bytes())
    assert Bundle.from_bytes(with_new_hashes(members)) == BUNDLE
    spaced = json.dumps(json.loads(members["verdicts.json"]), sort_keys=True).encode()
    assert refused(with_new_hashes({**members, "verdicts.json": spaced}))


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("verdicts.json", b'"name":"ownership"', b'"name":["ownership"]'),
        ("verdicts.json", b'"statement":"it holds"', b'"statement":7'),
        ("verdicts.json", b'"proved"', b'"sure"'),
        ("table.json", b'"number":1', b'"number":"1"'),
        ("table.json", b'"number":1', b'"number":true'),
        ("table.json", b'"controller":null', b'"controller":0'),
        ("table.json", b'"t0-1"', b"0"),
        ("table.json", b'"rest":[]', b'"rest":[],"more":0'),
        ("table.json", b'"rest":[],', b""),
        ("table.json", b'"priority"', b'"chance"'),
        ("table.json", b'["b","t1-11"]', b'["b"]'),
        ("net.json", b'"marked":true', b'"marked":1'),
        ("net.json", b'"inputs":["a.p"]', b'"inputs":["a.z"]'),
        ("subnets/a.json", b'"name":"a","under"', b'"name":"c","under"'),
        ("verdicts.json", b'"evidence":["eq7-G.smt2"]', b'"evidence":"eq7-G.smt2"'),
        ("verdicts.json", b'"name":"ownership"', b'"markings":true,"name":"ownership"'),
        ("verdicts.json", b'"name":"ownership"', b'"name":"ownership","seconds":1'),
        ("evidence/eq7-G.smt2", b"check", b"\xff"),
    ],
)
def test_content_of_another_type_is_refused_though_every_hash_is_right(name: str, old: bytes, new: bytes) -> None:
    members = unpack(BUNDLE.to_bytes())
    assert old in members[name]
    files = {**members, name: members[name].replace(old, new)}
    assert with_judged_hashes(members) == BUNDLE.to_bytes()
    assert refused(with_judged_hashes(files))


def with_judged_hashes(files: Mapping[str, bytes]) -> bytes:
    """The archive of changed members, in which the verdicts claim to be about the changed ones."""
    judged = json.loads(files["verdicts.json"])
    judged["of"] = {file: hashlib.sha256(files[file]).hexdigest() for file in judged["of"]}
    return with_new_hashes({**files, "verdicts.json": canonical_json(judged)})


def test_every_field_of_a_verdict_is_read_back() -> None:
    witness = Witness((("G",), ("l", "G")), (("l",),), ("a.p",), (("a.p", True), ("b.q", False)), "so")
    witness = replace(witness, waits=(Wait("a.p", "G", "b.q", wanted=True, holder="b.p", by=("l", "G")),))
    full = Verdict(
        *("v", Status.VIOLATED, "it holds", "by hand", Weight.WARNING),
        code="F4002",
        hint="split anew",
        bound="10 markings",
        subjects=("G", "l"),
        witness=witness,
        evidence=("eq7-G.smt2",),
        cost=Cost(3, 0),
        discipline="step",
        cures=(Cure(("give G the gate `if: b.q`",), ("live",), ("starvation",), 3),),
    )
    assert {field.name for field in fields(full) if not getattr(full, field.name)} == {"expected"}
    bundle = replace(BUNDLE, verdicts=(*VERDICTS, full))
    assert Bundle.from_bytes(bundle.to_bytes()).verdicts[-1] == full


def test_a_bundle_expects_no_violation() -> None:
    known = Verdict("v", Status.VIOLATED, "it holds", "by hand", expected=Status.VIOLATED)
    with pytest.raises(InputError):
        Bundle.from_bytes(replace(BUNDLE, verdicts=(*VERDICTS, known)).to_bytes())


def test_our_own_fault_is_not_called_a_damaged_bundle(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object) -> None:
        raise TypeError("planted")

    archive = BUNDLE.to_bytes()
    monkeypatch.setattr("firable.nets.bundle.net_from_json", broken)
    with pytest.raises(TypeError, match="planted"):
        Bundle.from_bytes(archive)


@pytest.mark.parametrize("data", [b"", b"[]", b"{}", b"\xff", b"[" * 100_000, b"null", b'{"firable_bundle":1}'])
def test_manifest_of_another_kind_is_refused(data: bytes) -> None:
    assert refused(pack({**unpack(BUNDLE.to_bytes()), "manifest.json": data}))


def test_compressed_archive_is_refused_unopened() -> None:
    bomb = BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.json", b"0" * 10_000_000)
    assert refused(bomb.getvalue())


def test_archive_refuses_names_that_lead_elsewhere_when_encoded_otherwise() -> None:
    with pytest.raises(ArchiveError):
        pack({"a\\b": b""})
    with pytest.raises(ArchiveError):
        pack({"a\nb": b""})
    assert file_stem("../x") == "..%2Fx"


def test_file_that_is_no_bundle_is_refused_by_code(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("firable: 1\n")
    (tmp_path / "empty").touch()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for name, code in [("text", "F5001"), ("empty", "F5001"), ("", "F1001"), ("none", "F1001"), ("pipe", "F1001")]:
        with pytest.raises(InputError) as refusal:
            read_bundle(tmp_path / name)
        assert [d.code for d in refusal.value.diagnostics] == [code]


def test_file_larger_than_any_bundle_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "large").open("wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(InputError, match="F1003"):
        read_bundle(tmp_path / "large")


def test_failed_write_leaves_the_old_bundle_and_no_litter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "tiny.bundle"
    path.write_bytes(b"old")

    def no_space(fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(InputError, match="F1017"):
        write_bundle(path, BUNDLE)
    assert [file.name for file in tmp_path.iterdir()] == ["tiny.bundle"]
    assert path.read_bytes() == b"old"


def test_write_replaces_an_old_bundle_and_refuses_a_missing_folder(tmp_path: Path) -> None:
    path = tmp_path / "tiny.bundle"
    path.write_bytes(b"old")
    write_bundle(path, BUNDLE)
    assert read_bundle(path) == BUNDLE
    with pytest.raises(InputError, match="F1017"):
        write_bundle(tmp_path / "none" / "tiny.bundle", BUNDLE)


def test_bundle_with_every_verdict_proved_may_run() -> None:
    assert unproved(BUNDLE) == ()


def test_required_verdicts_follow_from_the_net() -> None:
    assert list(required_verdicts(DECOMPOSITION)) == [
        *(
            "contact-free",
            "deadlock-free",
            "quasi-live",
            "conflicting-commands",
            "shared-completions",
            "property.apart",
        ),
        *("eq7.G", "eq8.G", "o3.G", "eq7.l", "eq8.l", "o3.l", "eq9-10.a.p", "eq9-10.b.q", "eq9-10.a.r"),
        *("o2.G", "o2.a.p"),
        *("ownership", "initial-marking", "commands", "arbitration", "arbitration.next"),
        *PROTOCOL,
    ]


def test_a_further_verdict_that_says_it_is_required_must_be_proved_too() -> None:
    for status in (Status.UNKNOWN, Status.VIOLATED):
        further = Verdict("reversible", status, "M0 can be reached again", "by hand", Weight.REQUIRED)
        found = unproved(replace(BUNDLE, verdicts=(*VERDICTS, further)))
        assert [(d.code, d.subject) for d in found] == [("F5002", ("verdicts", "reversible"))]
        informing = replace(further, weight=Weight.INFORMATION)
        assert unproved(replace(BUNDLE, verdicts=(*VERDICTS, informing))) == ()


@pytest.mark.parametrize("name", [*required_verdicts(DECOMPOSITION)])
def test_each_required_verdict_must_be_there_and_proved(name: str) -> None:
    missing = replace(BUNDLE, verdicts=tuple(v for v in VERDICTS if v.name != name))
    assert [(d.code, d.subject) for d in unproved(missing)] == [("F5002", ("verdicts", name))]
    for status in (Status.UNKNOWN, Status.VIOLATED):
        # Whatever weight a verdict gives itself, the net requires it; and no second verdict outweighs it.
        doubted = Verdict(name, status, "it holds", "by hand", Weight.INFORMATION)
        others = tuple(v for v in VERDICTS if v.name != name)
        for verdicts in ((*others, doubted), (*VERDICTS, doubted)):
            assert [(d.code, d.subject) for d in unproved(replace(BUNDLE, verdicts=verdicts))] == [
                ("F5002", ("verdicts", name))
            ]


def test_proof_without_its_evidence_is_none() -> None:
    missing = unproved(replace(BUNDLE, evidence={}))
    assert {d.code for d in missing} == {"F5002"}
    assert {d.subject[1] for d in missing} == {v.name for v in VERDICTS if v.evidence}
    bare = unproved(replace(BUNDLE, verdicts=tuple(replace(v, evidence=()) for v in VERDICTS)))
    assert {d.subject[1] for d in bare} == {v.name for v in VERDICTS}


@pytest.mark.parametrize("name", ON_THE_NET)
@pytest.mark.parametrize(
    "text",
    [
        document_naming(NET, ()),
        document_naming(NET, ON_THE_NET, status="violated"),
        document_naming(NET, ON_THE_NET, lacking="the time was over"),
        document_naming(NET, ON_THE_NET, discipline="step"),
        document_naming(NET, ON_THE_NET, version=1),
        document_naming(NET, ON_THE_NET, version=2.0),
        document_naming(replace(NET, places=(replace(P, marked=False), Q, R)), ON_THE_NET),
        *("", "[]", "(check-sat)", '{"verdicts": 7}'),
    ],
)
def test_a_verdict_on_the_net_of_which_its_evidence_has_no_record_gives_no_right_to_run(name: str, text: str) -> None:
    evidence = {**BUNDLE.evidence, "other.evidence.json": text}
    verdicts = tuple(replace(v, evidence=("other.evidence.json",)) if v.name == name else v for v in VERDICTS)
    found = unproved(replace(BUNDLE, verdicts=verdicts, evidence=evidence))
    assert [(d.code, d.subject) for d in found] == [("F5002", ("verdicts", name))]
    assert "has no record" in found[0].message


def test_an_obligation_is_no_evidence_on_the_net() -> None:
    evidence = {"eq7-G.smt2": DOCUMENT, "check.evidence.json": DOCUMENT}
    verdicts = tuple(replace(v, evidence=("eq7-G.smt2",)) if v.name == "deadlock-free" else v for v in VERDICTS)
    found = unproved(replace(BUNDLE, verdicts=verdicts, evidence=evidence))
    assert [d.subject for d in found] == [("verdicts", "deadlock-free")]


@pytest.mark.parametrize("name", ON_THE_NET)
def test_a_verdict_on_another_discipline_than_that_of_the_executor_gives_no_right_to_run(name: str) -> None:
    stepped = tuple(replace(v, discipline="step") if v.name == name else v for v in VERDICTS)
    assert [(d.code, d.subject) for d in unproved(replace(BUNDLE, verdicts=stepped))] == [("F5002", ("verdicts", name))]


def test_subnets_that_do_not_make_the_net_may_not_run() -> None:
    first, second = DECOMPOSITION.subnets
    idle = replace(first, transitions=first.transitions[:1])
    for subnets in ((idle, second), (first,), (first, replace(second, places=(replace(Q, marked=True),)))):
        found = unproved(replace(BUNDLE, decomposition=replace(DECOMPOSITION, subnets=subnets)))
        assert [(d.code, d.subject) for d in found] == [("F5002", ("subnets",))]


def test_conflict_that_no_group_decides_may_not_run() -> None:
    without = replace(BUNDLE, decomposition=replace(DECOMPOSITION, groups=()))
    assert [(d.code, d.subject) for d in unproved(without)] == [("F5002", ("places", "a.p"))]
    apart = tuple(ArbitrationGroup(f"g{i}", (t,), (), ArbitrationRule.PRIORITY) for i, t in enumerate("Gl"))
    found = unproved(replace(BUNDLE, decomposition=replace(DECOMPOSITION, groups=apart)))
    assert ("places", "a.p") in {d.subject for d in found}


(GROUP,), (ROW, LOCAL) = DECOMPOSITION.groups, DECOMPOSITION.coordinated
OTHERWISE = (
    *(replace(GROUP, controller=name) for name in ("a", "b", "nobody")),
    *(replace(GROUP, at=name) for name in ("a", "b", "nobody")),
    replace(GROUP, by=ArbitrationRule.ROTATION),
    *(replace(GROUP, sequence=tuple(order)) for order in ("Gl", "lGl")),
    replace(GROUP, sequence=("l",), rest=("G",)),
    replace(GROUP, rest=("nothing",)),
)


@pytest.mark.parametrize(
    "edited",
    [
        *(replace(DECOMPOSITION, groups=(group,)) for group in OTHERWISE),
        replace(DECOMPOSITION, groups=(GROUP, GROUP)),
        *(replace(DECOMPOSITION, coordinated=(replace(ROW, at=name), LOCAL)) for name in ("a", "b", "nobody")),
        replace(DECOMPOSITION, coordinated=(ROW, replace(LOCAL, parts=()))),
        replace(DECOMPOSITION, coordinated=(ROW,)),
        replace(DECOMPOSITION, coordinated=(ROW, replace(LOCAL, parts=()), LOCAL)),
        replace(DECOMPOSITION, coordinated=(LOCAL, ROW)),
    ],
)
def test_table_that_decides_otherwise_than_the_net_may_not_run(edited: Decomposition) -> None:
    assert [(d.code, d.subject) for d in unproved(replace(BUNDLE, decomposition=edited))] == [("F5002", ("table",))]

"""Folders that somebody else made: readers and runs work or say what is wrong, in one message."""

import errno
import fcntl
import json
import os
import re
import shutil
import tracemalloc
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from tests.campaign import hostile, toy
from tests.campaign.processes import run_toy

from ethogram.campaign import results
from ethogram.campaign.files import StorageError, Unreadable
from ethogram.campaign.manifests import Damaged
from ethogram.campaign.store import Store
from ethogram.cli import main
from ethogram.core.errors import EthogramError
from ethogram.core.registry import Registry

CASES = {case.name: case.id for case in toy.cases(toy.PLANS["smoke"])}
RUN = ("run", "toy", "--plan", "smoke", "--engine", "inline")


@pytest.fixture(autouse=True)
def alone_with_the_toy(monkeypatch, tmp_path):
    """The toy is the only study and the current folder is that of the test."""
    with_studies(monkeypatch, toy="tests.campaign.toy")
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """A folder with two records, a failure, a checkpoint and a report, and its digest."""
    folder = tmp_path_factory.mktemp("original") / "results"
    mishaps = folder.parent / "mishaps"
    mishaps.mkdir()
    (mishaps / "c.raise").touch()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOY_MISHAPS", str(mishaps))
        with_studies(patch, toy="tests.campaign.toy")
        run_toy(folder)
        state = {"place": np.zeros(20), "done": np.array(0)}
        Store(folder / "toy").checkpoints(CASES["c"]).save(state)
        assert main(["report", str(folder)]) == 0
    whole = folder.parent / "whole"
    run_toy(whole)
    return folder, {results.digest(folder), results.digest(whole)}


@pytest.fixture
def folder(original, tmp_path):
    """A copy of that folder."""
    shutil.copytree(original[0], tmp_path / "results")
    return tmp_path / "results"


@pytest.fixture
def outside(tmp_path):
    """A folder beside the results, with a file."""
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "victim").write_text("untouched")
    return tmp_path / "outside"


@pytest.fixture
def ethogram(capsys, outside):
    """Runs a command, for which no traceback and no touch outside is allowed."""

    def run(*arguments):
        code = main([str(word) for word in arguments])
        out, said = capsys.readouterr()
        said = re.sub(r"^\S+: drawing the page .*\n", "", said, flags=re.MULTILINE)  # progress
        assert code in (0, 1, 2)
        assert "Traceback" not in said
        assert ("\n" + said).count("\nethogram: ") == (code == 2)
        assert [path.name for path in outside.iterdir()] == ["victim"]
        assert (outside / "victim").read_text() == "untouched"
        return code, out, said

    return run


def file_in(folder, pattern):
    """The first file of that name."""
    return next(iter(sorted(folder.glob(pattern))))


def record_of(folder, letter):
    """Manifest and arrays of a case."""
    manifest = folder / "toy" / "manifests" / f"{CASES[letter]}.json"
    arrays = json.loads(manifest.read_bytes())["content"]["arrays"]
    return manifest, folder / "toy" / "arrays" / f"{arrays}.npz"


def tree(folder):
    """All that is in a folder: names, kinds, sizes and times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        found[path] = (status.st_mode, status.st_size, status.st_mtime_ns, status.st_ino)
    return found


@contextmanager
def put_back(folder):
    """Undo what is done to the records of a folder."""
    folders = [folder / "toy" / name for name in ("manifests", "arrays")]
    before = {path: path.read_bytes() for parent in folders for path in parent.iterdir()}
    yield
    for path in [path for parent in folders for path in parent.iterdir()]:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
    for path, data in before.items():
        path.write_bytes(data)


def refuse(monkeypatch, path, number=errno.EACCES, calls=("open",)):
    """Let the operating system refuse a file or folder, also where tests run as root."""
    for name in calls:
        call = getattr(os, name)

        def refusing(target, *arguments, call=call, **keywords):
            if not isinstance(target, int) and Path(target).absolute() == path:
                raise OSError(number, os.strerror(number))
            return call(target, *arguments, **keywords)

        monkeypatch.setattr(os, name, refusing)


READERS = {
    "digest": ("digest", "results"),
    "claims": ("claims", "results"),
    "claims --json": ("claims", "results", "--json"),
    "report": ("report", "results", "--out", "elsewhere"),
    "compare": ("compare", "results", "results", "--out", "elsewhere/c.html", "--no-show"),
    "replay": ("replay", "results", "toy", "a", "--out", "elsewhere/r.html", "--no-show"),
    "dry run": (*RUN, "--dry-run"),
}
WRITERS = {"report in place": ("report", "results"), "run": RUN}


def survives(ethogram, folder, digests, readers=READERS, writers=WRITERS):
    """Readers change nothing; after a run that ends well, all records are as they should be."""
    before = tree(folder)
    for reader in readers.values():
        ethogram(*reader)
    assert tree(folder) == before
    codes = {name: ethogram(*writer)[0] for name, writer in writers.items()}
    if codes["run"] != 2:
        assert results.digest(folder) in digests
        assert ethogram("claims", "results")[0] == 0


def everything(outside):
    """Pairs of a pattern for a file and a content for its place, each with a name."""
    patterns = {
        "toy/plan.json": {**hostile.anything(outside), **hostile.plans(outside)},
        "toy/manifests/*": {**hostile.anything(outside), **hostile.manifests(outside)},
        "toy/arrays/*": {**hostile.anything(outside), **hostile.ARRAYS},
        "toy/failures/*": {**hostile.anything(outside), **hostile.SEALED},
        "toy/checkpoints/*": hostile.anything(outside),
        "toy/locks/*": hostile.anything(outside),
        "index.html": hostile.anything(outside),
        "report/*": hostile.anything(outside),
        "report/*/*": hostile.anything(outside),
    }
    return [
        (pattern, name, content)
        for pattern, contents in patterns.items()
        for name, content in contents.items()
    ]


def test_whatever_stands_in_the_place_of_a_record_is_damage_and_hides_no_other(folder, outside):
    store = Store(folder / "toy")
    for pattern, name, content in everything(outside):
        if pattern not in ("toy/manifests/*", "toy/arrays/*"):
            continue
        with put_back(folder):
            content(record_of(folder, "a")[pattern == "toy/arrays/*"])
            if (pattern, name) == ("toy/manifests/*", "nothing"):
                assert store.load(CASES["a"]) is None
            else:
                with pytest.raises(Damaged) as caught:
                    store.load(CASES["a"])
                assert str(caught.value).isprintable(), name
            assert store.load(CASES["b"]) is not None


def test_whatever_stands_in_the_place_of_a_failure_is_damage(folder):
    path = file_in(folder, "toy/failures/*")
    before = path.read_bytes()
    for name, content in hostile.SEALED.items():
        content(path)
        with pytest.raises(Damaged, match=path.name):
            print(name, Store(folder / "toy").failure(CASES["c"]))
        path.write_bytes(before)


def test_whatever_stands_in_the_place_of_a_plan_is_named(folder, outside):
    path = folder / "toy" / "plan.json"
    before = path.read_bytes()
    without_effect = {"no cases", "an endless number of seconds", "no number of seconds"}
    contents = hostile.plans(outside)
    for name in contents.keys() - without_effect:
        contents[name](path)
        said = wrong_with(Store(folder / "toy"))
        assert str(path) in said, name
        path.write_bytes(before)


def wrong_with(store):
    """What a reader says of a store."""
    try:
        return "; ".join(damage for _, damage in results.collect(store).damages)
    except EthogramError as error:
        return str(error)


# -- what cannot be looked at ---------------------------------------------------------------------


@pytest.mark.parametrize("reader", ["digest", "claims", "report", "compare", "dry run"])
def test_records_that_nobody_may_look_at_are_an_error(reader, ethogram, folder, monkeypatch):
    refuse(monkeypatch, folder / "toy" / "manifests", calls=("scandir",))
    for case_id in CASES.values():
        path = folder / "toy" / "manifests" / f"{case_id}.json"
        refuse(monkeypatch, path, calls=("lstat", "open"))
    code, out, said = ethogram(*READERS[reader])
    assert (code, out) == (2, "")
    assert "Permission denied" in said


@pytest.mark.parametrize("make", [Path.touch, lambda path: path.symlink_to("outside")])
@pytest.mark.parametrize("name", ["toy/manifests", "toy/arrays", "toy"])
def test_a_file_or_link_in_the_place_of_a_folder_is_an_error(make, name, ethogram, folder):
    shutil.rmtree(folder / name)
    make(folder / name)
    codes = {reader: ethogram(*READERS[reader])[0] for reader in READERS}
    assert set(codes.values()) == {2}
    assert ethogram(*RUN)[0] == 2


def test_the_digest_of_no_record_is_an_error(ethogram, folder):
    for path in folder.glob("toy/manifests/*"):
        path.unlink()
    code, out, said = ethogram("digest", "results")
    assert (code, out) == (2, "")
    assert "holds no record" in said


@pytest.mark.parametrize(
    ("number", "kind"), [(errno.EACCES, 0), (errno.EIO, 1)], ids=["manifest", "arrays"]
)
def test_a_record_that_cannot_be_read_is_damage_and_computed_again(
    number, kind, ethogram, folder, original, monkeypatch
):
    path = record_of(folder, "a")[kind]
    unreadable = path.stat().st_ino
    call = os.open

    def refusing(target, *arguments, **keywords):
        descriptor = call(target, *arguments, **keywords)
        if os.fstat(descriptor).st_ino == unreadable:
            os.close(descriptor)
            raise OSError(number, os.strerror(number))
        return descriptor

    monkeypatch.setattr(os, "open", refusing)
    for reader in ("digest", "claims", "report", "compare", "replay"):
        code, _, said = ethogram(*READERS[reader])
        assert (reader, code) == (reader, 1)
        assert path.name in said
    assert "1 of 3 cases to do" in ethogram(*READERS["dry run"])[1]
    code, _, said = ethogram(*RUN)
    assert code == 1  # of the failure that was there before
    assert "set aside" in said
    assert "1/1 a: stored" in said
    assert results.digest(folder) in original[1]


def test_a_machine_without_free_descriptors_sets_no_record_aside(folder, monkeypatch):
    manifest, _ = record_of(folder, "a")
    refuse(monkeypatch, manifest, errno.EMFILE)
    with pytest.raises(StorageError, match="Too many open files") as caught:
        Store(folder / "toy").state(CASES["a"])
    assert not isinstance(caught.value, Unreadable)


def test_a_stray_file_among_the_manifests_is_named_and_set_aside_by_the_next_run(
    ethogram, folder, original
):
    (folder / "toy" / "manifests" / "notes\x1b.json").write_text("mine")
    (folder / "toy" / "manifests" / "notes.txt").write_text("mine too")
    code, _, said = ethogram("digest", "results")
    assert code == 1
    assert "notes\\x1b.json" in said
    assert "notes.txt" not in said
    assert "set aside" in ethogram(*RUN)[2]
    assert results.digest(folder) in original[1]
    assert [path.read_text() for path in folder.glob("toy/damaged/*")] == ["mine"]


# -- "stored" -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content", ["a link that leads nowhere", "a link to itself", "a folder with a file", "a pipe"]
)
def test_a_manifests_name_that_is_taken_hinders_no_run(
    content, ethogram, folder, outside, original
):
    hostile.anything(outside)[content](record_of(folder, "a")[0])
    assert "1/1 a: stored" in ethogram(*RUN)[2]
    assert results.digest(folder) in original[1]
    assert "computing 0 of 3" in ethogram(*RUN)[2]


def test_a_case_that_is_neither_stored_nor_failed_in_the_end_is_said_to_be_lost(
    ethogram, monkeypatch
):
    monkeypatch.setattr("ethogram.campaign.files.write_once", lambda *_: None)
    code, out, said = ethogram(*RUN)
    assert (code, out) == (1, "0 of 3 cases are stored in results.\n")
    assert ": stored" not in said
    assert "gone from the disk" in said


# -- what a file says it is -----------------------------------------------------------------------


def test_a_failure_under_another_cases_name_is_not_believed(ethogram, folder, original):
    failure = file_in(folder, "toy/failures/*")
    for path in record_of(folder, "a"):
        path.unlink()
    shutil.copy(failure, failure.with_name(f"{CASES['a']}.json"))
    assert Store(folder / "toy").state(CASES["a"]) == "damaged"
    assert ethogram("claims", "results")[0] == 1
    assert "a: stored" in ethogram(*RUN)[2]
    assert results.digest(folder) in original[1]


def with_studies(monkeypatch, **modules):
    """The studies that are installed."""
    monkeypatch.setattr("ethogram.studies.STUDIES", Registry("study", "ethogram.studies", modules))


def test_a_store_under_another_studys_name_is_named_and_hides_no_other(
    ethogram, folder, monkeypatch
):
    with_studies(monkeypatch, toy="tests.campaign.toy", twin="tests.campaign.twin")
    shutil.copytree(folder / "toy", folder / "twin")
    code, out, said = ethogram("claims", "results")
    assert (code, out.splitlines()[0]) == (1, "toy")
    assert "'toy' and lies in the folder of 'twin'" in said
    code, _, said = ethogram("digest", "results")
    assert code == 1
    assert said.count("lies in the folder of 'twin'") == 2


def test_a_damaged_plan_hides_no_other_study_and_the_plan_that_fits_is_named(
    ethogram, folder, monkeypatch
):
    with_studies(monkeypatch, toy="tests.campaign.toy", twin="tests.campaign.twin")
    ethogram("run", "twin", "--plan", "smoke", "--engine", "inline")
    (folder / "toy" / "plan.json").write_bytes(b"nonsense")
    code, out, said = ethogram("claims", "results")
    assert (code, out.splitlines()[0]) == (1, "twin")
    assert "`ethogram run toy --plan smoke --out results` finds 2 of its 3 cases" in said


def test_a_record_of_a_later_format_is_left_as_it_is_and_hides_no_other(ethogram, folder):
    manifest, _ = record_of(folder, "a")
    hostile.resealed(lambda body: body.update(format=2))(manifest)
    before = manifest.read_bytes()
    assert ethogram("digest", "results")[0] == 1
    assert "another version" in ethogram("claims", "results")[2]
    code, out, said = ethogram(*RUN)
    assert (code, out) == (1, "1 of 3 cases are stored in results.\n")
    assert "another version" in said
    assert manifest.read_bytes() == before


# -- the way out of the folder --------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arrays: a path up", "arrays: a path", "a hash with a line end"])
def test_a_manifest_that_names_a_file_outside_reaches_nothing(
    name, ethogram, folder, outside, original
):
    hostile.manifests(outside)[name](record_of(folder, "a")[0])
    code, _, said = ethogram("digest", "results")
    assert code == 1
    assert "arrays: " in said
    assert "a: stored" in ethogram(*RUN)[2]
    assert results.digest(folder) in original[1]


@pytest.mark.parametrize("name", ["toy/manifests", "toy/arrays", "toy", "toy/plan.json", "a", "b"])
def test_no_link_is_followed_though_it_leads_to_what_was_there(name, ethogram, folder, tmp_path):
    records = dict(zip("ab", record_of(folder, "a"), strict=True))
    path = records.get(name, folder / name)
    path.rename(tmp_path / "true")
    path.symlink_to(tmp_path / "true")
    before = tree(tmp_path / "true")
    code, _, said = ethogram("claims", "results")
    assert code in (1, 2)
    assert "link" in said
    ethogram(*RUN)
    assert tree(tmp_path / "true") == before


def test_a_report_writes_through_no_link(ethogram, folder, outside):
    shutil.rmtree(folder / "report")
    (folder / "report").symlink_to(outside)
    assert ethogram("report", "results")[0] == 2
    assert ethogram("replay", "results", "toy", "a", "--no-show")[0] == 2


# -- room -----------------------------------------------------------------------------------------


def test_no_file_makes_a_reader_take_more_memory_than_it_has_bytes(folder, outside):
    anything = hostile.anything(outside)
    bombs = [
        (1, hostile.ARRAYS["arrays: a bomb"]),
        (1, hostile.ARRAYS["arrays: of 10^12 numbers"]),
        (0, anything["a terabyte of zeros"]),
        (1, anything["a terabyte of zeros"]),
        (0, anything["10 MB of text"]),
    ]
    store = Store(folder / "toy")
    for kind, content in bombs:
        with put_back(folder):
            content(record_of(folder, "a")[kind])
            tracemalloc.start()
            try:
                assert store.state(CASES["a"]) == "damaged"
                _, peak = tracemalloc.get_traced_memory()
            finally:
                tracemalloc.stop()
            assert peak < 500_000


# -- folders that cannot be written ---------------------------------------------------------------

CHANGES = ("link", "mkdir", "open", "remove", "rename", "replace", "rmdir", "symlink", "unlink")


def test_readers_work_in_a_folder_that_nobody_may_write(ethogram, folder, monkeypatch):
    for name in CHANGES:
        call = getattr(os, name)

        def read_only(path, *arguments, call=call, name=name, **keywords):
            changes = name != "open" or (arguments[0] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
            if changes and not isinstance(path, int):
                assert not Path(path).absolute().is_relative_to(folder), f"{name} {path}"
            return call(path, *arguments, **keywords)

        monkeypatch.setattr(os, name, read_only)
    before = tree(folder)
    for reader in READERS.values():
        assert ethogram(*reader)[0] == 0
    assert len(results.collect(Store(folder / "toy")).records) == 2
    assert tree(folder) == before


# -- reports --------------------------------------------------------------------------------------


@pytest.mark.parametrize("where", ["", "report", "report/toy"])
def test_what_a_killed_report_was_writing_is_swept_by_the_next_unless_its_writer_lives(
    where, ethogram, folder
):
    half, living = (folder / where / f"ethogram.{digit * 32}.tmp" for digit in "01")
    half.write_text("half a page")
    living.write_text("half a page")
    with living.open() as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        assert ethogram("report", "results")[0] == 0
        assert not half.exists()
        assert living.exists()
    assert ethogram("report", "results")[0] == 0
    assert not living.exists()


@pytest.mark.parametrize("command", ["compare", "replay"])
def test_what_a_killed_replay_or_comparison_was_writing_is_swept_by_the_next(
    command, ethogram, folder, tmp_path
):
    del folder
    half = tmp_path / "elsewhere" / f"ethogram.{'0' * 32}.tmp"
    half.parent.mkdir()
    half.write_text("half a page")
    assert ethogram(*READERS[command])[0] == 0
    assert not half.exists()


# -- all of it ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_file_of_a_folder_can_be_replaced_by_anything_that_breaks_a_command(
    ethogram, original, tmp_path, outside
):
    tried = 0
    for pattern, name, content in everything(outside):
        for path in sorted(original[0].glob(pattern)):
            if path.is_dir():
                continue
            folder = tmp_path / "results"
            shutil.copytree(original[0], folder)
            content(folder / path.relative_to(original[0]))
            print(pattern, name)  # shown where it fails
            survives(ethogram, folder, original[1])
            shutil.rmtree(folder)
            tried += 1
    assert tried > 300

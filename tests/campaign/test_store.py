"""The store's laws: whole or absent, damage found, equal data gives equal bytes."""

import fcntl
import hashlib
import io
import json
import zipfile

import hypothesis.strategies as st
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis.extra import numpy as npst
from tests.campaign import toy
from tests.campaign.processes import Recorder, run_toy

from ethogram.campaign import files, manifests
from ethogram.campaign.arrays import pack, unpack
from ethogram.campaign.checkpoints import Checkpoints
from ethogram.campaign.manifests import Damaged, Failure, seal, unseal
from ethogram.campaign.results import digest
from ethogram.campaign.run import Job, run_case
from ethogram.campaign.store import Store
from ethogram.core.errors import EthogramError

CASE = toy.cases(toy.PLANS["single"])[0]

dtypes = (
    npst.boolean_dtypes()
    | npst.integer_dtypes()
    | npst.floating_dtypes()
    | npst.complex_number_dtypes()
    | npst.unicode_string_dtypes(min_len=1)
)
arrays = npst.arrays(dtypes, npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3))


@pytest.fixture
def store(tmp_path):
    """A store with one record, that of the toy's single plan."""
    run_toy(tmp_path, plan="single")
    return Store(tmp_path / "toy")


def only(folder, pattern):
    (path,) = folder.glob(pattern)
    return path


def dataset(array):
    dimensions = [f"axis_{number}" for number in range(array.ndim)]
    return xr.Dataset({"x": (dimensions, array, {"units": "m"})}, attrs={"mean": 0.5, "of": [1]})


@given(arrays)
def test_arrays_come_back_as_they_were(array):
    record = {"results": dataset(array), "scene-1": dataset(array)}
    found = unpack(*pack(record))
    for group in record:
        assert found[group].x.dtype == array.dtype
        xr.testing.assert_identical(found[group], record[group])


@given(arrays)
def test_equal_data_gives_equal_bytes_however_it_lies_in_memory(array):
    other = array.copy("F")
    assert pack({"results": dataset(array)}) == pack({"results": dataset(other)})


def test_the_order_in_which_a_record_is_built_leaves_its_bytes_the_same():
    a, b = dataset(np.arange(3)), dataset(np.arange(4))
    assert pack({"a": a, "b": b})[0] == pack({"b": b, "a": a})[0]


def test_labels_come_back_with_their_coordinates():
    record = xr.Dataset(
        {"y": (("letter", "time"), np.ones((2, 3)))},
        coords={"letter": ["a", "bc"], "time": [1.0, 2.0, 3.0], "name": ("letter", ["x", "y"])},
    )
    xr.testing.assert_identical(unpack(*pack({"results": record}))["results"], record)


def test_an_array_file_is_a_plain_npz_without_pickle_or_time(store):
    data = only(store.folder, "arrays/*").read_bytes()
    with np.load(io.BytesIO(data), allow_pickle=False) as found:
        assert set(found) == {"results/place", "results/end", "results/step", "scene-1/x"}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}


@pytest.mark.parametrize("values", [np.array([object()]), np.array([{}, 1], dtype=object)])
def test_what_would_need_pickle_is_refused_by_name(values):
    with pytest.raises(TypeError, match="results/x"):
        pack({"results": xr.Dataset({"x": ("i", values)})})


def test_a_record_comes_back_with_its_provenance(store):
    record, manifest = store.load(CASE.id)
    xr.testing.assert_identical(record["results"], toy.run(CASE, toy.Context())["results"])
    assert manifest.case == CASE
    assert {"python", "ethogram", "jax", "numpy"} <= set(manifest.versions)
    assert only(store.folder, "arrays/*").stem == manifest.arrays
    data = only(store.folder, "arrays/*").read_bytes()
    assert hashlib.sha256(data).hexdigest() == manifest.arrays


def test_a_record_says_what_did_the_work_of_kernels_and_its_identity_does_not(store):
    _, before = store.load(CASE.id)
    assert before.kernels == {}
    record, kernels = toy.run(CASE, toy.Context()), {"beams3d": "x86-64-v4"}
    store.save(CASE, record, started="now", seconds=1.0, kernels=kernels, replace=True)
    _, manifest = store.load(CASE.id)
    assert manifest.kernels == kernels
    assert manifest.identity == before.identity  # the bits of the data tell


def test_a_record_from_before_there_were_kernels_is_read(store):
    path = only(store.folder, "manifests/*")
    body = json.loads(path.read_bytes())
    del body["content"]["kernels"], body["seal"]
    path.write_bytes(manifests._sealed(body))
    assert store.load(CASE.id)[1].kernels == {}


@pytest.mark.parametrize("pattern", ["arrays/*", "manifests/*"])
def test_a_changed_bit_in_any_byte_is_found_and_named(store, pattern):
    path = only(store.folder, pattern)
    whole = path.read_bytes()
    for position in range(len(whole)):
        changed = bytearray(whole)
        changed[position] ^= 1 << position % 8
        path.write_bytes(changed)
        assert store.state(CASE.id) == "damaged"
    with pytest.raises(Damaged, match=path.name):
        store.load(CASE.id)
    path.write_bytes(whole)
    assert store.state(CASE.id) == "stored"


@pytest.mark.parametrize("pattern", ["arrays/*", "manifests/*"])
@pytest.mark.parametrize(
    "change", [lambda data: data[:-1], lambda data: data + b" ", lambda _: b""]
)
def test_a_file_of_another_length_is_found(store, pattern, change):
    path = only(store.folder, pattern)
    path.write_bytes(change(path.read_bytes()))
    assert store.state(CASE.id) == "damaged"


def test_a_missing_array_file_is_damage(store):
    only(store.folder, "arrays/*").unlink()
    assert store.state(CASE.id) == "damaged"


def test_the_manifest_of_another_case_is_damage(store):
    path = only(store.folder, "manifests/*")
    path.rename(path.with_name(f"{'0' * 64}.json"))
    with pytest.raises(Damaged, match="another case"):
        store.load("0" * 64)


@pytest.mark.parametrize("pattern", ["arrays/*", "manifests/*"])
def test_the_next_run_sets_damage_aside_says_so_and_computes_the_case_again(
    store, pattern, tmp_path
):
    expected = digest(tmp_path)
    path = only(store.folder, pattern)
    path.write_bytes(path.read_bytes()[:-10] + b"0123456789")
    damaged = path.read_bytes()
    with pytest.raises(EthogramError, match=path.name):
        digest(tmp_path)
    monitor = Recorder()
    assert run_toy(tmp_path, plan="single", monitor=monitor).stored == 1
    assert digest(tmp_path) == expected
    assert [path.name in note and "set aside" in note for note in monitor.notes] == [True]
    assert damaged in [found.read_bytes() for found in store.folder.glob("damaged/*")]


def test_a_damaged_failure_record_is_set_aside_and_the_case_computed(store, tmp_path):
    only(store.folder, "manifests/*").unlink()
    (store.folder / "failures" / f"{CASE.id}.json").write_bytes(b"{}")
    assert store.state(CASE.id) == "damaged"
    assert run_toy(tmp_path, plan="single").stored == 1


def test_the_first_of_two_manifests_stays(store):
    before = only(store.folder, "manifests/*").read_bytes()
    store.save(CASE, {"results": dataset(np.ones(3))}, started="later", seconds=1.0)
    assert only(store.folder, "manifests/*").read_bytes() == before


def test_the_digest_leaves_out_when_and_where_but_not_what(tmp_path):
    record = {"results": dataset(np.ones(3))}
    found = set()
    for number, (values, seconds) in enumerate([(1.0, 1.0), (1.0, 2.0), (1.5, 1.0)]):
        store = Store(tmp_path / str(number) / "toy")
        run_toy(tmp_path / str(number), plan="single")
        only(store.folder, "manifests/*").unlink()
        record = {"results": dataset(np.full(3, values))}
        store.save(CASE, record, started=f"day {number}", seconds=seconds)
        found.add(digest(tmp_path / str(number)))
    assert len(found) == 2


def test_a_seal_of_a_later_format_is_not_taken_for_damage(store):
    path = only(store.folder, "manifests/*")
    body = json.loads(path.read_bytes())
    del body["seal"]
    body["format"] += 1
    plain = json.dumps(body, sort_keys=True, separators=(",", ":")).encode()
    body["seal"] = hashlib.sha256(plain).hexdigest()
    path.write_bytes(json.dumps(body, sort_keys=True, separators=(",", ":")).encode() + b"\n")
    with pytest.raises(EthogramError, match="another version") as caught:
        store.load(CASE.id)
    assert not isinstance(caught.value, Damaged)


lines = st.text(st.characters(codec="utf-8")).filter(str.isprintable)


@given(error=lines, trace=st.text(), seconds=st.floats(0, 1e9))
def test_what_is_sealed_comes_back(error, trace, seconds):
    failure = Failure(case=CASE, error=error, traceback=trace, started="now", seconds=seconds)
    assert unseal(Failure, seal(failure), "a path") == failure


def test_a_lock_that_another_holds_leaves_the_case_to_it(store):
    only(store.folder, "manifests/*").unlink()
    with store.lock(CASE.id, wait=True) as held:
        assert held
        receipt = run_case(Job(toy, store, wait=False), CASE, report=print)
    assert receipt.state == "busy"
    assert store.state(CASE.id) == "missing"


@pytest.mark.parametrize("owner", ["ethogram", CASE.id])
def test_a_half_written_file_is_removed_unless_its_writer_lives(store, owner):
    orphan = store.folder / "arrays" / f"{owner}.{'0' * 32}.tmp"
    foreign = store.folder / "arrays" / "thesis.tmp"
    orphan.write_bytes(b"half")
    foreign.write_bytes(b"not ours")
    with orphan.open() as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        store.sweep()
        assert orphan.exists()
    store.sweep()
    assert not orphan.exists()
    assert foreign.exists()


def test_a_writer_whose_file_was_swept_before_it_held_it_begins_another(tmp_path, monkeypatch):
    lock, swept = fcntl.flock, []

    def late(descriptor, operation):
        if operation == fcntl.LOCK_EX and not swept:
            swept.extend(tmp_path.glob("*.tmp"))
            files.sweep(tmp_path)
        lock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    files.write_whole(tmp_path / "file", b"whole")
    assert len(swept) == 1
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("file", b"whole")]


class TestCheckpoints:
    """One whole checkpoint at any moment."""

    @pytest.fixture
    def checkpoints(self, tmp_path):
        return Checkpoints(tmp_path, "case")

    def test_it_comes_back_as_it_was(self, checkpoints):
        saved = {"table": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "done": np.array(3)}
        checkpoints.save(saved)
        found, notes = checkpoints.restore()
        assert notes == []
        assert found["done"].shape == ()
        np.testing.assert_array_equal(found["table"], saved["table"])

    def test_a_newer_one_replaces_it(self, checkpoints, tmp_path):
        for number in range(3):
            checkpoints.save({"done": np.array(number)})
        assert len(list(tmp_path.iterdir())) == 1
        assert checkpoints.restore()[0]["done"] == 2

    def test_a_damaged_one_is_named_and_counts_as_none(self, checkpoints, tmp_path):
        checkpoints.save({"done": np.array(1)})
        path = only(tmp_path, "*")
        path.write_bytes(path.read_bytes()[:-1] + b"!")
        found, notes = checkpoints.restore()
        assert found is None
        assert path.name in notes[0]

    def test_one_of_other_arithmetic_is_left_and_named(self, checkpoints, tmp_path):
        fused, portable = {"beams3d": "fused multiply-add"}, {"beams3d": "portable"}
        checkpoints.save({"done": np.array(1)}, fused)
        assert checkpoints.restore(fused)[0]["done"] == 1
        for other, name in ((portable, "the kernel beams3d (portable)"), ({}, "JAX")):
            found, (note,) = checkpoints.restore(other)
            assert found is None
            assert f"{only(tmp_path, '*')} was computed by the kernel beams3d (fused" in note
            assert f"this run is by {name}, which gives other bits" in note
        checkpoints.save({"done": np.array(2)})
        _, (note,) = checkpoints.restore(fused)
        assert "was computed by JAX, and this run is by the kernel" in note

    def test_it_is_gone_once_cleared(self, checkpoints, tmp_path):
        checkpoints.save({"done": np.array(1)})
        checkpoints.clear()
        assert not list(tmp_path.iterdir())
        assert checkpoints.restore() == (None, [])

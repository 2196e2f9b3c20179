"""What `ethogram doctor` says of kernels: which are in use, or why none and what to do."""

import json

import pytest

import ethogram as package
from ethogram.cli import doctor
from ethogram.physics import native


@pytest.fixture
def installation(tmp_path, monkeypatch):
    """One with the plainest kernel alone; gives the folder of its libraries."""
    monkeypatch.setattr(native, "FOLDER", tmp_path / "_native")
    monkeypatch.setattr(native, "CHECKOUT", tmp_path)
    monkeypatch.delenv(native.VARIABLE, raising=False)
    (tmp_path / "_native").mkdir()
    write(tmp_path / "_native", variants=["portable"], compiler="c++ 12")
    return tmp_path / "_native"


def write(folder, **about):
    (folder / "build.json").write_text(json.dumps({"variants": [], **about}))


@pytest.mark.usefixtures("installation")
def test_it_says_what_there_is(ethogram):
    code, out, said = ethogram("doctor")
    assert (code, said) == (0, "")
    for part in (
        *(package.__version__, "Python 3.", "JAX", "cpu", "core", "of memory free"),
        *("kernels    portable\n", "built: portable, by c++ 12", "analysis", "video"),
    ):
        assert part in out
    assert "older than their sources" not in out


@pytest.mark.usefixtures("installation")
def test_it_says_so_as_json(ethogram):
    code, out, _ = ethogram("doctor", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["ethogram"] == package.__version__
    assert found["kernels"] == {
        **{"in_use": "portable", "why_none": None, "compiler": "c++ 12", "stale": False},
        **{"built": ["portable"], "usable": ["portable"]},
    }
    assert set(found["extras"]) == {"analysis", "video"}


def test_it_says_why_none_was_built_and_how_to_build_them(ethogram, installation):
    write(installation, why_none="c++: not found. Install a C++ compiler.")
    code, out, _ = ethogram("doctor")
    assert code == 0
    assert "none, JAX does the work: c++: not found. Install a C++ compiler." in out
    assert "make kernels" in out
    assert "pip install" in out


@pytest.mark.usefixtures("installation")
def test_it_says_that_the_variable_turned_them_off(ethogram, monkeypatch):
    monkeypatch.setenv(native.VARIABLE, "none")
    code, out, _ = ethogram("doctor")
    assert code == 0
    assert "none, JAX does the work: ETHOGRAM_KERNEL=none is set." in out


@pytest.mark.usefixtures("installation")
def test_a_variant_that_cannot_be_had_is_the_answer(ethogram, monkeypatch):
    monkeypatch.setenv(native.VARIABLE, "x86-64-v4")
    code, out, said = ethogram("doctor")
    assert (code, out) == (2, "")
    assert said.startswith("ethogram: The kernel 'x86-64-v4' (ETHOGRAM_KERNEL) is not built")


def test_it_says_that_libraries_are_older_than_their_sources(ethogram, installation):
    (installation.parent / "kernel.cpp").write_text("changed")
    write(installation, variants=["portable"], sources={"kernel.cpp": "0" * 64})
    code, out, _ = ethogram("doctor")
    assert code == 0
    assert "older than their sources; to build them anew: `make kernels`" in out


def test_a_computer_whose_jax_uses_a_gpu_is_told_that_kernels_are_for_the_cpu():
    reason = doctor._why_none(native.Build(variants=("portable",)), "gpu")
    assert "JAX computes on gpu" in reason

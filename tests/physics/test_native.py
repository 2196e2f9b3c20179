"""Which library is loaded: the fastest that is built and the processor runs, or the one chosen."""

import json
import shutil
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from tests.lacking import lacking
from tests.tiny_kernel import build_hook, write_project

from ethogram.core.errors import EthogramError, UnknownName
from ethogram.core.kernels import FLAGS, arithmetic
from ethogram.physics import native

SYMBOL = "ethogram_tiny_f32"
V3, V4 = sorted(FLAGS["x86-64-v3"]), sorted(FLAGS["x86-64-v4"])


@pytest.fixture(scope="session")
def checkout(tmp_path_factory):
    """A small checkout with its kernels built; not to be changed."""
    root = write_project(tmp_path_factory.mktemp("tiny"))
    said = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ETHOGRAM_BUILD_KERNEL", "auto")
        if not build_hook().build(root, root / "_native", said.append):
            lacking(said[0])
    return root


@pytest.fixture
def libraries(checkout, tmp_path, monkeypatch):
    """The folder of all libraries, alone in the world."""
    folder = tmp_path / "_native"
    shutil.copytree(checkout / "_native", folder)
    monkeypatch.setattr(native, "FOLDER", folder)
    monkeypatch.setattr(native, "CHECKOUT", checkout)
    monkeypatch.delenv(native.VARIABLE, raising=False)
    return folder


@pytest.fixture
def all_built(tmp_path, monkeypatch):
    """Each variant of x86-64 as built, whatever this machine is; none of them can be loaded."""
    folder = tmp_path / "_native"
    folder.mkdir()
    variants = ["x86-64-v4", "x86-64-v3", "x86-64"]
    (folder / "build.json").write_text(json.dumps({"variants": variants}))
    monkeypatch.setattr(native, "FOLDER", folder)
    monkeypatch.delenv(native.VARIABLE, raising=False)
    return folder


def have_processor(monkeypatch, tmp_path, flags):
    cpuinfo = tmp_path / "cpuinfo"
    lines = ("processor\t: 0", "model name\t: Any", f"flags\t\t: fpu {' '.join(flags)}", "bugs\t:")
    cpuinfo.write_text("\n".join(lines * 2))
    monkeypatch.setattr(native, "_CPUINFO", cpuinfo)


@pytest.mark.usefixtures("all_built")
@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (V4, "x86-64-v4"),
        (V4[1:], "x86-64"),  # abm is lacking, which both levels have
        ([flag for flag in V4 if flag != "avx512vl"], "x86-64-v3"),
        (V3, "x86-64-v3"),
        ([flag for flag in V3 if flag != "fma"], "x86-64"),
        ([], "x86-64"),
    ],
)
def test_the_fastest_that_the_processor_runs_is_in_use(monkeypatch, tmp_path, flags, expected):
    have_processor(monkeypatch, tmp_path, flags)
    assert native.variant() == expected


@pytest.mark.usefixtures("all_built")
def test_a_system_that_does_not_tell_what_its_processor_can_do_gets_the_plainest(
    monkeypatch, tmp_path
):
    monkeypatch.setattr(native, "_CPUINFO", tmp_path / "nowhere")
    assert native.variant() == "x86-64"


@pytest.mark.usefixtures("all_built")
def test_the_variable_chooses_and_a_choice_in_the_program_goes_before_it(monkeypatch, tmp_path):
    have_processor(monkeypatch, tmp_path, V3)
    monkeypatch.setenv(native.VARIABLE, "x86-64")
    assert native.variant() == "x86-64"
    assert native.variant("x86-64-v3") == "x86-64-v3"
    monkeypatch.setenv(native.VARIABLE, "none")
    assert native.variant() is None
    assert native.target(SYMBOL) is None
    assert native.implementation("tiny") == "jax"


@pytest.mark.usefixtures("all_built")
@pytest.mark.parametrize(
    ("choice", "parts"),
    [
        ("x86-64-v4", ["x86-64-v4", "avx512bw, avx512cd", "allowed here: x86-64-v3, x86-64"]),
        ("portable", ["portable", "not built", "x86-64-v4, x86-64-v3, x86-64"]),
        ("x86_64", ["Unknown kernel", "'x86_64'", "Did you mean 'x86-64'?", "auto, none"]),
    ],
)
def test_a_variant_that_cannot_be_had_is_one_clear_error(monkeypatch, tmp_path, choice, parts):
    have_processor(monkeypatch, tmp_path, V3)
    monkeypatch.setenv(native.VARIABLE, choice)
    with pytest.raises(EthogramError) as error:
        native.variant()
    for part in (*parts, native.VARIABLE):
        assert part in str(error.value)


def test_a_library_that_cannot_be_loaded_is_told_of_once_and_jax_does_the_work(
    all_built, monkeypatch, tmp_path
):
    have_processor(monkeypatch, tmp_path, V3)
    (all_built / "tiny_x86-64-v3.so").write_text("nonsense")
    with pytest.warns(UserWarning, match="'x86-64-v3' cannot be loaded .* JAX") as told:
        assert native.variant() is None
    assert native.variant() is None
    assert native.implementation("tiny") == "jax"
    assert len(told) == 1
    with pytest.raises(EthogramError, match=r"'x86-64-v3' \(ETHOGRAM_KERNEL\) cannot be loaded"):
        native.variant("x86-64-v3")


def test_jax_calls_each_variant_that_runs_here(libraries):
    del libraries
    variants = native.usable(native.build())
    assert native.variant() == variants[0]
    assert native.target(SYMBOL) == native.target(SYMBOL, variants[0])
    names = {native.target(SYMBOL, variant) for variant in variants}
    assert len(names) == len(variants)
    for name in names:
        numbers = jnp.arange(5.0, dtype=jnp.float32)
        double = jax.ffi.ffi_call(name, jax.ShapeDtypeStruct(numbers.shape, numbers.dtype))
        twice = jax.jit(lambda x, double=double: lax.scan(lambda y, _: (double(y), 0), x, length=2))
        np.testing.assert_array_equal(twice(numbers)[0], 4 * numbers)


def test_a_record_names_the_variant_or_jax_where_that_kernel_is_not_built(libraries):
    del libraries
    assert native.implementation("tiny") == native.variant()
    assert native.implementation("lattices") == "jax"


def test_an_installation_without_kernels_uses_jax_and_says_why(monkeypatch, tmp_path):
    monkeypatch.setattr(native, "FOLDER", tmp_path / "nothing")
    monkeypatch.delenv(native.VARIABLE, raising=False)
    assert native.variant() is None
    assert native.build().why_none


def test_libraries_are_stale_once_a_source_has_changed(libraries, checkout, monkeypatch, tmp_path):
    del libraries
    assert not native.build().is_stale
    changed = tmp_path / "changed"
    shutil.copytree(checkout / "kernels", changed / "kernels")
    monkeypatch.setattr(native, "CHECKOUT", changed)
    assert not native.build().is_stale
    source = changed / "kernels" / "tiny.cpp"
    source.write_text(f"{source.read_text()}\n")
    assert native.build().is_stale


def test_equal_arithmetic_is_that_of_the_variants_with_fused_multiply_adds():
    kinds = {variant: arithmetic({"tiny": variant}).get("tiny") for variant in (*FLAGS, "jax")}
    assert kinds["x86-64-v4"] == kinds["x86-64-v3"] != kinds["x86-64"] == kinds["portable"]
    assert kinds["jax"] is None


def test_nothing_is_loaded_by_importing_the_physics():
    script = (
        "import sys, ethogram.physics.beams3d, ethogram.physics.lattice2d;"
        "from ethogram.physics import native;"
        "print(native._loaded.cache_info().currsize, native._registered.cache_info().currsize)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == "0 0\n"


def test_an_unknown_choice_is_refused():
    with pytest.raises(UnknownName, match="fastest"):
        native.variant("fastest")

"""Kernels in the wheel, whatever compiler there is, and a wheel without where there is none."""

import json
import os
import subprocess
import sys
import tarfile
import zipfile

import pytest
from tests.test_dependencies import PYTHONS, python_of
from tests.tiny_kernel import COMPILERS, ROOT, build_hook, write_project

VARIANTS = list(build_hook()._variants())
NATIVE = "ethogram/physics/_native"
LIBRARIES = {f"{NATIVE}/tiny_{variant}.so" for variant in VARIANTS}
BUILD = f"{NATIVE}/build.json"
OFFLINE = {  # no package registry, and no folder of packages
    **{"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull, "PIP_FIND_LINKS": ""},
    **{"UV_OFFLINE": "1", "UV_FIND_LINKS": "", "UV_NO_CACHE": "1"},
}
PACK = ("-m", "hatchling", "build", "--directory", "dist", "--target")
EDITABLE = ("-c", "import hatchling.build as build; build.build_editable('dist')")
LOAD = (
    "import ctypes, sys; sys.path.insert(0, sys.argv[1]); from ethogram.physics import native;"
    "ctypes.CDLL(str(native.FOLDER / f'tiny_{native.variant()}.so')).ethogram_tiny_f32;"
    "print('loaded', native.variant())"
)

with_a_compiler = pytest.mark.skipif(not COMPILERS, reason="there is no C++ compiler on the path")


@pytest.fixture
def project(tmp_path):
    return write_project(tmp_path / "project")


@pytest.fixture
def no_compiler(tmp_path):
    """Environment variables under which there is none on the path."""
    (tmp_path / "empty").mkdir()
    return {"PATH": str(tmp_path / "empty"), "CXX": ""}


def run(project, *command, **environment):
    """What a Python program of a project prints; the test fails with it unless it succeeds."""
    unset = {"ETHOGRAM_BUILD_KERNEL": "auto", "ETHOGRAM_KERNEL": "auto", "CXX": ""}
    done = subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=project,
        env=os.environ | unset | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def built(project):
    """The wheel of a project, and what it says of its kernels."""
    (wheel,) = (project / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return wheel, set(archive.namelist()), json.loads(archive.read(BUILD))


def assert_pure(project):
    wheel, names, about = built(project)
    assert wheel.name.endswith("-py3-none-any.whl")
    assert {name for name in names if name.startswith(NATIVE)} == {BUILD}
    assert about["variants"] == []
    return about["why_none"]


@with_a_compiler
def test_a_wheel_has_every_kernel_in_every_variant_and_serves_every_python(project, tmp_path):
    said = run(project, *PACK, "wheel")
    wheel, names, about = built(project)
    assert "No native kernel" not in said
    assert wheel.name.startswith("ethogram-")
    assert "-py3-none-" in wheel.name
    assert not wheel.name.endswith("-any.whl")
    assert {name for name in names if name.startswith(NATIVE)} == {*LIBRARIES, BUILD}
    assert about["variants"] == VARIANTS
    assert set(about["sources"]) == {
        *("hatch_build.py", "kernels/tiny.cpp"),
        "kernels/vendored/xla/ffi/api/c_api.h",
    }
    assert not (project / "src" / NATIVE).exists()
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    for library in LIBRARIES:  # which need the C library alone
        data = (tmp_path / "site" / library).read_bytes()
        assert not [name for name in (b"libstdc++", b"libgcc_s", b"libpython") if name in data]
    assert run(project, "-I", "-c", LOAD, tmp_path / "site").startswith("loaded ")


def test_without_a_compiler_the_wheel_is_pure_and_one_message_says_what_to_install(
    project, no_compiler
):
    said = run(project, *PACK, "wheel", **no_compiler, **OFFLINE)
    why = assert_pure(project)
    assert said.count("No native kernel was built") == 1
    assert why in said
    for part in ("c++: not found", "ziglang", "apt-get install g++"):
        assert part in why


@with_a_compiler
def test_a_compiler_that_cannot_compile_gives_way_to_the_next(project, tmp_path):
    broken = tmp_path / "broken++"
    broken.write_text("#!/bin/sh\necho 'error: no licence' >&2\n[ $1 = --version ]\n")
    broken.chmod(0o755)
    run(project, *PACK, "wheel", CXX=f"{broken} -O2")
    assert built(project)[2]["variants"] == VARIANTS


def test_a_broken_compiler_is_named_with_what_it_says(project, tmp_path, no_compiler):
    broken = tmp_path / "broken++"
    broken.write_text("#!/bin/sh\necho 'error: no licence' >&2\n[ $1 = --version ]\n")
    broken.chmod(0o755)
    run(project, *PACK, "wheel", **no_compiler | {"CXX": str(broken)}, **OFFLINE)
    assert "error: no licence; c++: not found" in assert_pure(project)


def test_no_kernel_is_built_where_none_is_wanted(project):
    run(project, *PACK, "wheel", ETHOGRAM_BUILD_KERNEL="none")
    assert "ETHOGRAM_BUILD_KERNEL=none" in assert_pure(project)
    with pytest.raises(AssertionError, match="'some'; auto and none are allowed"):
        run(project, *PACK, "wheel", ETHOGRAM_BUILD_KERNEL="some")


@with_a_compiler
def test_an_editable_install_has_its_kernels_among_the_sources_and_keeps_them(project):
    def libraries():
        folder = project / "src" / NATIVE
        return {file.name: file.stat().st_mtime_ns for file in folder.glob("*.so")}

    run(project, *EDITABLE)
    first = libraries()
    assert {f"{NATIVE}/{name}" for name in first} == LIBRARIES
    run(project, *EDITABLE)
    assert libraries() == first
    source = project / "kernels" / "tiny.cpp"
    source.write_text(f"// changed\n{source.read_text()}")
    run(project, "hatch_build.py")
    assert first.keys() == libraries().keys()
    assert not set(first.values()) & set(libraries().values())
    run(project, *PACK, "wheel", ETHOGRAM_BUILD_KERNEL="none")  # in which they have no place
    assert_pure(project)


@with_a_compiler
def test_in_a_checkout_a_broken_kernel_is_an_error_and_leaves_what_was_built(project):
    run(project, "hatch_build.py")
    (project / "kernels" / "tiny.cpp").write_text("nonsense")
    with pytest.raises(AssertionError, match=r"tiny\.cpp:1:1: error: .*nonsense"):
        run(project, "hatch_build.py")
    assert len(list((project / "src" / NATIVE).glob("*.so"))) == len(VARIANTS)


def test_the_source_distribution_has_what_kernels_are_made_of(tmp_path):
    run(ROOT, "-m", "hatchling", "build", "--directory", tmp_path, "--target", "sdist")
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as found:
        names = {name.partition("/")[2] for name in found.getnames()}
    sources = {path.relative_to(ROOT).as_posix() for path in ROOT.glob("kernels/**/*.*")}
    assert {"hatch_build.py", "kernels/vendored/xla/ffi/api/c_api.h", *sources} <= names
    assert not [name for name in names if "/_native/" in name]


@pytest.mark.slow
def test_a_compiler_is_fetched_where_there_is_none(project, no_compiler, tmp_path):
    run(project, *PACK, "wheel", **no_compiler)
    wheel, names, about = built(project)
    assert about["compiler"].startswith("zig ")
    assert names >= LIBRARIES
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    assert run(project, "-I", "-c", LOAD, tmp_path / "site").startswith("loaded ")


@pytest.mark.slow
@with_a_compiler
@pytest.mark.parametrize(
    "install",
    [
        ("-m", "pip", "install", "--no-deps"),
        ("-m", "pip", "install", "--no-deps", "--no-build-isolation"),
        ("-m", "uv", "pip", "install", "--no-deps", "--python", sys.executable),
    ],
    ids=["pip", "pip without isolation", "uv"],
)
def test_every_installer_builds_them(project, tmp_path, install):
    run(project, *install, "--target", tmp_path / "site", project)
    assert run(project, "-I", "-c", LOAD, tmp_path / "site").startswith("loaded ")


@pytest.mark.slow
@pytest.mark.parametrize("installer", ["pip", "uv"])
def test_an_isolated_build_fetches_a_compiler_too(project, tmp_path, no_compiler, installer):
    command = ("-m", "pip") if installer == "pip" else ("-m", "uv", "pip")
    where = ("--python", sys.executable) if installer == "uv" else ()
    run(
        project,
        *(*command, "install", "--no-deps", *where, "--target", tmp_path / "site", project),
        **no_compiler,
    )
    assert run(project, "-I", "-c", LOAD, tmp_path / "site").startswith("loaded ")


@pytest.mark.slow
@with_a_compiler
def test_one_wheel_loads_under_every_python(project, tmp_path):
    run(project, *PACK, "wheel")
    zipfile.ZipFile(built(project)[0]).extractall(tmp_path / "site")
    pythons = [found for version in PYTHONS if (found := python_of(version))]
    if len(pythons) < 2:
        pytest.skip("there are no two Pythons here")
    for python in pythons:
        done = subprocess.run(
            [python, "-I", "-c", LOAD, tmp_path / "site"], capture_output=True, text=True
        )
        assert done.stdout.startswith("loaded "), done.stderr

"""Runs of a plan: resumed, failed and tried again, shared between processes, interrupted."""

import os
import re
import signal
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from tests.campaign import faults, toy
from tests.campaign.processes import (
    REFUSED,
    Recorder,
    ToyObject,
    ended,
    run_toy,
    start_child,
    start_command,
    toy_in_child,
    toy_with_small_files_only,
    until,
)

from ethogram.campaign import context
from ethogram.campaign.context import Context
from ethogram.campaign.engines import ATTEMPTS, engine_named, inline, pool
from ethogram.campaign.launch import Summary, crew_size, launch, survey
from ethogram.campaign.results import collect, digest
from ethogram.campaign.run import Job, run_case
from ethogram.campaign.store import Store
from ethogram.campaign.threads import one_thread
from ethogram.core.errors import EthogramError, UnknownName

BIG = "walk.steps=900"  # a record of more than 8 kB


@pytest.fixture
def mishaps(tmp_path, monkeypatch):
    """Makes cases of the toy go wrong: `mishaps("b", "raise")`."""
    folder = tmp_path / "mishaps"
    folder.mkdir()
    monkeypatch.setenv("TOY_MISHAPS", str(folder))
    monkeypatch.setenv("TOY_LOG", str(tmp_path / "log"))

    def add(letter, *kinds):
        for number, kind in enumerate(kinds):
            (folder / f"{letter}.{number}.{kind}").touch()

    add.happened = lambda: not list(folder.iterdir())
    add.begun = lambda: [
        word[0] for word in (tmp_path / "log").read_text().split() if word.endswith("0")
    ]
    return add


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The digest of an undisturbed run."""
    folder = tmp_path_factory.mktemp("expected")
    run_toy(folder)
    return digest(folder)


def test_inline_and_pool_give_the_same_digest_and_leave_the_environment(expected, tmp_path):
    before = dict(os.environ)
    run_toy(tmp_path, engine=pool)
    assert digest(tmp_path) == expected
    assert os.environ == before
    run_toy(tmp_path / "inline")
    assert os.environ == before


def test_order_and_company_of_cases_leave_the_digest_the_same(expected, tmp_path):
    for letters in ("c,b", "a"):
        run_toy(tmp_path, f"letter={letters}")
    assert digest(tmp_path) == expected


def test_a_second_run_computes_nothing(tmp_path, mishaps):
    run_toy(tmp_path)
    monitor = Recorder()
    assert run_toy(tmp_path, monitor=monitor).stored == 3
    assert monitor.to_do == []
    assert mishaps.begun() == ["a", "b", "c"]


def test_the_monitor_hears_of_every_case(tmp_path, monkeypatch):
    monkeypatch.setattr(context, "_PROGRESS_SECONDS", 0.0)
    monitor = Recorder()
    run_toy(tmp_path, monitor=monitor)
    assert monitor.to_do == list(monitor.receipts) == ["a", "b", "c"]
    assert monitor.fractions == pytest.approx([1 / 3, 2 / 3, 1] * 3)


@pytest.mark.parametrize("engine", [inline, pool])
def test_a_case_that_fails_is_recorded_and_the_run_goes_on(engine, tmp_path, mishaps):
    mishaps("b", "raise")
    summary = run_toy(tmp_path, engine=engine)
    assert summary.stored == 2
    ((name, error),) = summary.failures
    assert name == "b"
    assert re.fullmatch(r"ValueError: a toy broke \(tests/campaign/toy\.py:\d+\)", error)
    store = Store(tmp_path / "toy")
    failure = store.failure(toy.cases(toy.PLANS["smoke"])[1].id)
    assert "Traceback" in failure.traceback
    assert "in two" in failure.traceback


def test_a_refusal_by_the_study_is_recorded_in_its_own_words(tmp_path, mishaps):
    mishaps("b", "refuse")
    assert run_toy(tmp_path).failures == (("b", "The toy is too large."),)


def test_a_failed_case_is_not_tried_again_unless_asked(expected, tmp_path, mishaps):
    mishaps("b", "raise")
    run_toy(tmp_path)
    assert run_toy(tmp_path).failures != ()
    assert mishaps.begun() == ["a", "b", "c"]
    summary = run_toy(tmp_path, retry_failed=True)
    assert summary.failures == ()
    assert mishaps.begun() == ["a", "b", "c", "b"]
    assert digest(tmp_path) == expected


def test_a_case_that_fails_again_stays_a_failure(tmp_path, mishaps):
    mishaps("b", "raise", "refuse")
    run_toy(tmp_path)
    summary = run_toy(tmp_path, retry_failed=True)
    assert summary.failures == (("b", "The toy is too large."),)


def test_the_case_of_a_killed_worker_is_run_again(expected, tmp_path, mishaps):
    mishaps("b", *["die"] * (ATTEMPTS - 1))
    summary = run_toy(tmp_path, engine=pool, workers=2)
    assert summary.failures == ()
    assert digest(tmp_path) == expected
    assert mishaps.begun().count("b") == ATTEMPTS


def test_a_case_whose_worker_is_killed_each_time_fails_and_says_so(tmp_path, mishaps):
    mishaps("b", *["die"] * ATTEMPTS)
    mishaps("c", *["exit"] * ATTEMPTS)
    summary = run_toy(tmp_path, engine=pool, workers=2)
    assert summary.stored == 1
    failures = dict(summary.failures)
    assert failures["b"] == "Its worker process ended 3 times, last with signal 9: out of memory?"
    assert failures["c"] == "Its worker process ended 3 times, last with exit code 3"


def test_a_worker_that_is_killed_while_it_starts_is_replaced(expected, tmp_path, mishaps):
    mishaps("start", *["die"] * (ATTEMPTS - 1))
    assert run_toy(tmp_path, engine=pool, workers=1).failures == ()
    assert mishaps.happened()
    assert digest(tmp_path) == expected


def test_workers_that_never_start_end_the_run_with_a_message(tmp_path, mishaps):
    mishaps("start", *["die"] * ATTEMPTS)
    with pytest.raises(EthogramError, match=r"Worker processes cannot start; .* signal 9"):
        run_toy(tmp_path, engine=pool, workers=1)


def test_workers_do_not_see_the_signals_of_a_terminal_or_a_batch_system(tmp_path, mishaps):
    mishaps("a", "SIGINT", "SIGTERM", "SIGHUP")
    run = start_command("run", "toy", "--plan", "smoke", "--out", tmp_path, "--workers", "1")
    _, said = run.communicate(timeout=60)
    assert (run.returncode, said.count("stored")) == (0, 3)
    assert sorted(mishaps.begun()) == ["a", "b", "c"]


def test_a_case_that_another_run_saw_fail_is_left_as_it_is(tmp_path, mishaps):
    mishaps("b", "raise")
    run_toy(tmp_path)
    case = toy.cases(toy.PLANS["smoke"])[1]
    receipt = run_case(Job(toy, Store(tmp_path / "toy"), wait=True), case, report=print)
    assert receipt.state == "failed"
    assert receipt.error.startswith("ValueError: a toy broke")
    assert mishaps.begun() == ["a", "b", "c"]


def test_a_killed_case_goes_on_from_its_checkpoint(expected, tmp_path, monkeypatch):
    monkeypatch.setattr(context, "CHECKPOINT_SECONDS", 0.0)
    case, seen = toy.cases(toy.PLANS["smoke"])[0], []

    class Stopped(BaseException):
        """Ends a case as a kill would."""

    class StoppedContext(Context):
        def progress(self, done, total):
            del total
            seen.append(done)
            if seen == [1, 2]:
                raise Stopped

    monkeypatch.setattr("ethogram.campaign.run.Context", StoppedContext)
    with pytest.raises(Stopped):
        run_toy(tmp_path)
    assert len(list(tmp_path.glob(f"toy/checkpoints/{case.id}.*"))) == 1
    run_toy(tmp_path)
    assert seen[:4] == [1, 2, 2, 3]
    assert digest(tmp_path) == expected


@pytest.mark.parametrize(
    ("kernel", "chunks"),
    [("x86-64-v3", [2, 3]), ("x86-64", [1, 2, 3]), ("jax", [1, 2, 3])],
    ids=["equal bits", "other bits", "no kernel"],
)
def test_a_case_goes_on_only_from_a_checkpoint_of_the_same_bits(
    kernel, chunks, tmp_path, monkeypatch
):
    monkeypatch.setattr(context, "CHECKPOINT_SECONDS", 0.0)
    now, seen = ["x86-64-v4"], []

    class KernelContext(Context):
        """One of a case behind whose numbers a kernel stands, and which fails with the first."""

        def restore(self):
            self.use_kernels({"beams3d": now[0]})
            return super().restore()

        def progress(self, done, total):
            del total
            seen.append(done)
            if seen == [1, 2]:
                raise ValueError("broke in its second chunk")

    monkeypatch.setattr("ethogram.campaign.run.Context", KernelContext)
    run_toy(tmp_path, plan="single")
    now[0], recorder = kernel, Recorder()
    run_toy(tmp_path, plan="single", retry_failed=True, monitor=recorder)
    assert seen == [1, 2, *chunks]
    assert len(recorder.notes) == (chunks[0] == 1)
    store = Store(tmp_path / "toy")
    (case_id,) = store.case_ids()
    assert store.manifest(case_id).kernels == {"beams3d": kernel}


def test_records_of_a_run_name_all_that_did_the_work_of_a_kernel(tmp_path):
    run_toy(tmp_path)
    store = Store(tmp_path / "toy")
    assert not [name for name in collect(store).versions if name.startswith("kernel")]
    record, manifest = store.load(store.case_ids()[0])
    store.save(
        manifest.case,
        record,
        started="now",
        seconds=1.0,
        kernels={"beams3d": "x86-64-v4"},
        replace=True,
    )
    assert collect(store).versions["kernel beams3d"] == "jax, x86-64-v4"  # jax: of all before


def test_a_case_that_failed_is_tried_again_from_its_checkpoint(expected, tmp_path, monkeypatch):
    monkeypatch.setattr(context, "CHECKPOINT_SECONDS", 0.0)
    seen = []

    class FailingContext(Context):
        def progress(self, done, total):
            del total
            seen.append(done)
            if seen == [1, 2]:
                raise ValueError("broke in its second chunk")

    monkeypatch.setattr("ethogram.campaign.run.Context", FailingContext)
    ((name, error),) = run_toy(tmp_path).failures
    checkpoint = next(tmp_path.glob("toy/checkpoints/*"))
    assert name == "a"
    assert error.startswith("ValueError: broke in its second chunk (tests/campaign/test_runs.py:")
    assert error.endswith(f"(last checkpoint: {checkpoint})")
    first_run = len(seen)
    assert run_toy(tmp_path, retry_failed=True).failures == ()
    assert seen[first_run] == 2  # not the first chunk again
    assert digest(tmp_path) == expected


def test_checkpoints_are_a_minute_apart(tmp_path, monkeypatch):
    now = iter([0.0, 59.0, 60.0, 61.0, 119.0, 121.0, 122.0])
    monkeypatch.setattr(context.time, "monotonic", lambda: next(now))
    store = Store(tmp_path)
    store.create()
    made = []
    running = Context(checkpoints=store.checkpoints("case"))
    for _ in range(4):
        running.checkpoint(lambda: made.append(1) or {"done": np.array(1)})
    assert len(made) == 2


def test_two_runs_on_one_folder_share_the_work(expected, tmp_path, mishaps):
    nothing = {"counter": tmp_path / "steps"}
    environment = {key: os.environ[key] for key in ("TOY_LOG", "TOY_MISHAPS")}
    runs = [start_child(toy_in_child, tmp_path, environment, nothing) for _ in range(3)]
    assert [ended(run) for run in runs] == [0, 0, 0]
    assert sorted(mishaps.begun()) == ["a", "b", "c"]
    assert digest(tmp_path) == expected


def test_a_run_takes_over_the_case_of_another_that_is_killed(expected, tmp_path, mishaps):
    mishaps("b", "hang")
    environment = {key: os.environ[key] for key in ("TOY_LOG", "TOY_MISHAPS")}
    other = start_child(toy_in_child, tmp_path, environment, {"counter": tmp_path / "steps"})
    until(mishaps.happened)

    class KillsTheOther(Recorder):
        def note(self, text):
            super().note(text)
            assert list(self.receipts) == ["c"]
            other.kill()

    monitor = KillsTheOther()
    assert run_toy(tmp_path, monitor=monitor).stored == 3
    assert monitor.notes == ["Another run is computing 1 of the cases; waiting for it."]
    assert digest(tmp_path) == expected


def test_a_full_disk_is_one_clear_error_and_keeps_what_is_stored(tmp_path):
    run_toy(tmp_path, "letter=a")
    assert ended(start_child(toy_with_small_files_only, tmp_path, "letter=b", BIG)) == REFUSED
    message = (tmp_path / "message").read_text()
    assert message.startswith(f"Cannot store {tmp_path}")
    assert "File too large" in message
    assert len(list(tmp_path.glob("toy/manifests/*"))) == 1
    assert not list(tmp_path.rglob("*.tmp"))
    assert run_toy(tmp_path, "letter=b", BIG).stored == 1
    run_toy(tmp_path)
    assert len(list(tmp_path.glob("toy/manifests/*"))) == 4


@pytest.mark.parametrize("engine", ["inline", "pool"])
def test_ctrl_c_ends_a_run_cleanly(engine, expected, tmp_path, mishaps):
    mishaps("b", "hang")
    run = start_command("run", "toy", "--plan", "smoke", "--out", tmp_path, "--engine", engine)
    until(mishaps.happened)
    os.killpg(run.pid, signal.SIGINT)
    _, said = run.communicate(timeout=30)
    assert run.returncode == 130
    assert "the same command continues from there" in said
    assert "Traceback" not in said
    until(lambda: nobody_computes("b", tmp_path))
    run_toy(tmp_path)
    assert digest(tmp_path) == expected


def test_workers_die_with_a_parent_that_is_killed(tmp_path, mishaps):
    mishaps("b", "hang")
    run = start_command("run", "toy", "--plan", "smoke", "--out", tmp_path, "--engine", "pool")
    until(mishaps.happened)
    run.kill()
    run.communicate(timeout=30)
    until(lambda: nobody_computes("b", tmp_path))


def nobody_computes(letter, folder):
    """Whether the lock of a case is free, which no process that computes it lets go of."""
    case = toy.cases(toy.PLANS["smoke"].override([f"letter={letter}"]))[0]
    with Store(folder / "toy").lock(case.id, wait=False) as held:
        return held


def test_a_full_disk_in_a_worker_ends_the_run_with_one_message(tmp_path):
    counter = tmp_path / "steps"
    run = start_command(
        *("run", "toy", "--plan", "smoke", "--out", tmp_path / "out"),
        **{"FAULT_COUNTER": str(counter), "FAULT_AT": "15", "FAULT_KIND": "full"},
    )
    _, said = run.communicate(timeout=60)
    assert run.returncode == 2
    assert said.count("No space left on device") == 1
    assert "Traceback" not in said
    assert faults.count(counter) > 15


def test_what_was_asked_for_is_written_down(tmp_path):
    run_toy(tmp_path, "letter=c,a", "label=x y")
    planned = Store(tmp_path / "toy").planned_run()
    assert [name for name, _ in planned.cases] == ["c", "a"]
    assert planned.command == "ethogram run toy --plan smoke --set letter=c,a --set 'label=x y'"
    assert planned.varied_settings["letter"] == ["c", "a"]
    assert planned.varied_settings["walk"]["steps"] == 20


def test_two_cases_of_one_name_are_refused(tmp_path):
    with pytest.raises(EthogramError, match="same name"):
        survey(toy, toy.Plan("p", "", toy.Settings(), {"seed": (1, 2)}), tmp_path)


def test_a_survey_changes_nothing(tmp_path):
    prospects = survey(toy, toy.PLANS["smoke"], tmp_path / "new")
    assert [prospect.state for prospect in prospects] == ["missing"] * 3
    assert not (tmp_path / "new").exists()


def test_no_more_cases_run_at_once_than_fit_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("ethogram.campaign.launch.available_cores", lambda: 8)
    prospects = survey(toy, toy.PLANS["smoke"], tmp_path)
    for available, expected in [(10_000, 3), (2500, 2), (500, 1)]:
        monkeypatch.setattr(
            "ethogram.campaign.launch.available_memory", lambda size=available: size
        )
        assert crew_size(pool, prospects) == expected
    assert crew_size(pool, prospects, workers=4) == 4
    assert crew_size(inline, prospects) == 1


def test_an_unknown_engine_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="'pool'"):
        engine_named("pol")


def test_a_context_by_hand_needs_no_store():
    running = Context()
    running.progress(1, 2)
    running.checkpoint(lambda: {})
    assert running.restore() is None


def test_every_engine_gives_libraries_one_thread_and_keeps_other_flags(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=somewhere")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    before = dict(os.environ)
    with one_thread(), one_thread():
        assert os.environ["OPENBLAS_NUM_THREADS"] == os.environ["OMP_NUM_THREADS"] == "1"
        flags = os.environ["XLA_FLAGS"].split()
        assert flags == ["--xla_dump_to=somewhere", "--xla_cpu_multi_thread_eigen=false"]
    assert os.environ == before


@pytest.mark.parametrize("began", ["script.py", "<stdin>", None])
def test_workers_need_nothing_of_the_program_that_the_caller_began_with(
    began, expected, tmp_path, monkeypatch
):
    """A script without a main guard, standard input, a notebook with a study that is an object.

    Nor do they take a module of the current folder for one of Python's.
    """
    monkeypatch.chdir(tmp_path)
    Path("script.py").write_text("raise SystemExit('run twice')")
    Path("random.py").write_text("raise SystemExit('taken for the one of Python')")
    program = ModuleType("__main__")
    if began:
        program.__file__ = began if began == "<stdin>" else str(tmp_path / began)
    monkeypatch.setitem(sys.modules, "__main__", program)
    study = toy if began else ToyObject()
    launch(study, toy.PLANS["smoke"], Path("out"), engine=pool, monitor=Recorder(), workers=1)
    assert digest(Path("out")) == expected


@pytest.mark.parametrize("module", ["__main__", "tests.campaign.toy"])
def test_a_study_that_no_worker_could_load_is_refused_before_one_starts(
    module, tmp_path, monkeypatch
):
    study = type("Homeless", (ToyObject,), {"__module__": module, "__reduce__": object.__reduce__})
    monkeypatch.setattr("ethogram.campaign.workers.subprocess.Popen", None)
    with pytest.raises(EthogramError, match=r"The study 'toy' .*use the engine 'inline'"):
        launch(study(), toy.PLANS["single"], tmp_path, engine=pool, monitor=Recorder())


def test_forced_cases_are_computed_anew_and_replace_their_records(expected, tmp_path):
    run_toy(tmp_path)
    old, manifest = Store(tmp_path / "toy").load(toy.cases(toy.PLANS["smoke"])[0].id)
    Store(tmp_path / "toy").save(
        manifest.case, {"results": old["results"] * 2}, started="", seconds=0.0, replace=True
    )
    assert digest(tmp_path) != expected
    monitor = Recorder()
    assert run_toy(tmp_path, force=True, monitor=monitor).stored == 3
    assert monitor.to_do == ["a", "b", "c"]
    assert digest(tmp_path) == expected


def test_a_forced_case_that_fails_leaves_its_record_and_is_told_of(expected, tmp_path, mishaps):
    run_toy(tmp_path)
    mishaps("b", "refuse")
    summary = run_toy(tmp_path, force=True)
    assert summary == Summary(planned=3, stored=3, failures=(("b", "The toy is too large."),))
    assert digest(tmp_path) == expected
    assert run_toy(tmp_path).failures == ()

import os

import pytest

from ethogram.core.errors import TooLarge
from ethogram.core.memory import (
    available_cores,
    available_memory,
    readable_bytes,
    require_memory,
)


def test_what_fits_passes_and_what_does_not_is_refused_with_both_sizes():
    require_memory("a byte", 1)
    with pytest.raises(TooLarge, match=r"a table needs 10\^500 bytes of memory; .* are free"):
        require_memory("a table", 10**500)
    assert available_memory() > 0


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 bytes"), (5, "5 bytes"), (403_606_400, "404 MB"), (1_200_000_000_000, "1.2 TB")],
)
def test_sizes_read_like_sizes(size, text):
    assert readable_bytes(size) == text


def machine(root, files):
    """Lay out files of a machine below a folder."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


MEMINFO = "MemTotal: 9000 kB\nMemAvailable: 8000 kB\n"
UNIFIED = "0::/jobs/seven\n"
SPLIT = "4:memory:/jobs/seven\n2:cpu,cpuacct:/jobs/seven\n0::/\n"


def test_without_a_control_group_the_machine_is_what_there_is(tmp_path):
    assert available_memory(machine(tmp_path, {"proc/meminfo": MEMINFO})) == 8000 * 1024


def test_a_control_group_leaves_what_it_does_not_use_itself_but_for_files_it_can_drop(tmp_path):
    files = {
        "proc/meminfo": MEMINFO,
        "proc/self/cgroup": UNIFIED,
        "sys/fs/cgroup/jobs/seven/memory.max": "max\n",
        "sys/fs/cgroup/jobs/seven/memory.current": "5000\n",
        "sys/fs/cgroup/jobs/memory.max": "10000\n",  # the group above counts as well
        "sys/fs/cgroup/jobs/memory.current": "7000\n",
        "sys/fs/cgroup/jobs/memory.stat": "anon 5000\ninactive_file 1000\n",
    }
    assert available_memory(machine(tmp_path, files)) == 10_000 - (7000 - 1000)


def test_the_first_version_of_control_groups_is_read_too(tmp_path):
    files = {
        "proc/meminfo": MEMINFO,
        "proc/self/cgroup": SPLIT,
        # a container sees its own group as the top
        "sys/fs/cgroup/memory/memory.limit_in_bytes": "10000\n",
        "sys/fs/cgroup/memory/memory.usage_in_bytes": "7000\n",
        "sys/fs/cgroup/memory/memory.stat": "total_inactive_file 500\n",
    }
    assert available_memory(machine(tmp_path, files)) == 10_000 - (7000 - 500)


def test_a_full_control_group_leaves_nothing(tmp_path):
    files = {
        "proc/meminfo": MEMINFO,
        "proc/self/cgroup": UNIFIED,
        "sys/fs/cgroup/memory.max": "10000\n",
        "sys/fs/cgroup/memory.current": "10001\n",
    }
    assert available_memory(machine(tmp_path, files)) == 0


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({}, 8),
        ({"sys/fs/cgroup/jobs/seven/cpu.max": "max 100000\n"}, 8),
        ({"sys/fs/cgroup/jobs/seven/cpu.max": "150000 100000\n"}, 2),
        ({"sys/fs/cgroup/cpu.max": "20000 100000\n"}, 1),
    ],
)
def test_processors_are_those_of_the_affinity_and_of_the_control_group(
    files, cores, tmp_path, monkeypatch
):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)
    assert available_cores(machine(tmp_path, {"proc/self/cgroup": UNIFIED, **files})) == cores


@pytest.mark.parametrize(("quota", "cores"), [("-1", 8), ("300000", 3)])
def test_processors_of_the_first_version_of_control_groups(quota, cores, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)
    files = {
        "proc/self/cgroup": SPLIT,
        "sys/fs/cgroup/cpu/jobs/seven/cpu.cfs_quota_us": f"{quota}\n",
        "sys/fs/cgroup/cpu/jobs/seven/cpu.cfs_period_us": "100000\n",
    }
    assert available_cores(machine(tmp_path, files)) == cores

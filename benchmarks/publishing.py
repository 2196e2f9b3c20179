"""How fast the publishing system runs, beside a Mesa model of it, and how that grows with papers.

    python benchmarks/publishing.py [--cores 2] [--json FILE]

Runs per second over `RUNS` seeds of 100 authors, 20 journals, 1000 initial papers, 20 years of 10
steps, with minded authors and mild-scrutiny editors: one process per core, each pinned to its core
and with its share of the seeds, ours and Mesa's one after the other in the same call.  Ours are
repeated, so that both sides run for seconds.  Compiling and importing are not counted; what
compiling takes is printed.

The Mesa model (`mesa` 3) has an agent per author and per journal, and does what our world does,
with the same algorithms where they matter: references by prefix sums and binary search in the
step and in the paper, quantiles from sorted lists, h-indices and impact factors kept as citations
come.  The naive row weighs all papers for each reference list instead.  Mesa with the same
algorithm must publish as many papers as we do and reach the same mean h-index, both within 3%, or
nothing is printed.

The scaling curve is of random authors whose every paper is accepted, so that the number of papers
is known beforehand, on one core.
"""

import json
import math
import sys
import time
from bisect import bisect_right, insort
from typing import Any

from common.processes import Place, alone, options, side_by_side

AUTHORS, JOURNALS, PAPERS, YEARS, STEPS = 100, 20, 1000, 20, 10
RUNS, NAIVE_RUNS = 64, 1  # seeds of each side; of the naive model, for each core
WARM_UP, REPEATS = 3, 5  # of our program, whose runs are soon over
SCALES = (  # authors, journals, initial papers, years: 10^4 to 10^7 papers
    (100, 10, 100, 10),
    (1000, 40, 1000, 10),
    (1000, 40, 1000, 100),
    (10_000, 200, 10_000, 100),
)
CLOSE = 0.03  # how near the two sides' means must be, relative
REFERENCES, Q_MAX, BINS, FEW = 10, 15.0, 10, 0.25

Result = dict[str, float]


def run_of(world: Any, author: str, editor: str) -> Any:
    """A whole run for a key: how many papers there are in the end, and the mean h-index."""
    import jax

    from ethogram.core.keys import branch
    from ethogram.worlds.publishing.policies import static

    policy = static(world, author, editor)

    def run(key: Any) -> tuple[Any, Any]:
        def step(state: Any, key: Any) -> tuple[Any, None]:
            first, second = branch(key, 0), branch(key, 1)
            state, _ = world.step(second, state, policy(first, world.observe(state)))
            return state, None

        first, key = jax.random.split(key)
        start, _ = world.reset(first)
        state, _ = jax.lax.scan(step, start, jax.random.split(key, world.horizon))
        return state.literature.published, state.citation_stats.h_index.mean()

    return run


def ours(runs: int, place: Place) -> Result:
    """Our world: all runs of a process in one program."""
    import jax

    from ethogram.worlds.publishing import Publishing

    run = run_of(Publishing(), "minded", "mild_scrutiny")
    keys = jax.random.split(jax.random.key(place.core), runs)
    began = time.perf_counter()
    program = jax.jit(lambda keys: jax.lax.map(run, keys)).lower(keys).compile()
    compiled = time.perf_counter() - began
    for _ in range(WARM_UP):  # the first calls also fetch memory
        jax.block_until_ready(program(keys))
    place.start()
    began, spent = time.perf_counter(), time.process_time()
    for _ in range(REPEATS):
        papers, h_index = jax.block_until_ready(program(keys))
    found = _result(REPEATS * runs, began, spent, float(papers.mean()), float(h_index.mean()))
    return found | {"compile": compiled}


def mesas(runs: int, naive: bool, place: Place) -> Result:
    """The Mesa model, run after run."""
    model = mesa_model()
    place.start()
    began, spent = time.perf_counter(), time.process_time()
    papers, h_index = 0.0, 0.0
    for run in range(runs):
        system = model(seed=1000 * place.core + run, naive=naive)
        for _ in range(YEARS * STEPS):
            system.step()
        papers += len(system.level) / runs
        h_index += sum(author.h_index for author in system.writers) / AUTHORS / runs
    return _result(runs, began, spent, papers, h_index)


def _result(runs: int, began: float, spent: float, papers: float, h_index: float) -> Result:
    return {
        "runs": runs,
        "seconds": time.perf_counter() - began,
        "processor": time.process_time() - spent,
        "papers": papers,
        "h_index": h_index,
    }


def mesa_model() -> Any:
    """The class of the model; made here so that only a process that needs Mesa imports it."""
    import mesa

    from ethogram.worlds.publishing.impact_2018 import IMPACT_2018

    counts = IMPACT_2018["journals"]
    aim = [count / sum(counts) * JOURNALS for count in counts]

    class Author(mesa.Agent):
        def __init__(self, model: Any) -> None:
            super().__init__(model)
            self.skill = model.power_law()
            self.h_index, self.above, self.tally = 0, 0, {}

        def write(self) -> None:
            model = self.model
            self.quality = min(max(model.random.gauss(self.skill, 1.0), 0.0), Q_MAX)
            self.cited, self.rejections = model.references(), 0

        def submit(self) -> None:
            """To a journal of the bin that fits, one bin lower for each rejection."""
            model = self.model
            wanted = int(BINS * self.quality / Q_MAX) - self.rejections
            bin_ = min(max(wanted, 1), BINS) - 1
            first, end = bin_ * JOURNALS // BINS, (bin_ + 1) * JOURNALS // BINS
            journal = model.ranked[first + int(model.random.random() * (end - first))]
            if self.quality >= journal.threshold:
                model.accepted.append((self, journal))
            else:
                self.rejections += 1
                journal.rejected += 1

        def cited_again(self, before: int) -> None:
            tally, after = self.tally, before + 1
            tally[before] -= 1
            tally[after] = tally.get(after, 0) + 1
            if before <= self.h_index < after:
                self.above += 1
                if self.above > self.h_index:
                    self.h_index += 1
                    self.above -= tally.get(self.h_index, 0)

    class Journal(mesa.Agent):
        def __init__(self, model: Any) -> None:
            super().__init__(model)
            self.qualities: list[float] = []
            self.impact, self.rejected, self.received = math.nan, 0, 0
            self.by_year: dict[int, int] = {}

        def judge(self) -> None:
            """The first quartile of what it has published, as in this step."""
            own = self.qualities
            if not own:
                self.threshold = -1.0
                return
            position = FEW * (len(own) - 1)
            low = int(position)
            high = min(low + 1, len(own) - 1)
            self.threshold = own[low] + (position - low) * (own[high] - own[low])

        def close(self) -> None:
            """At the end of a year."""
            year = self.model.year
            papers = self.by_year.get(year - 1, 0) + self.by_year.get(year - 2, 0)
            self.impact = self.received / papers if papers else math.nan
            self.received = 0

    class Model(mesa.Model):
        def __init__(self, seed: int, naive: bool) -> None:
            super().__init__(seed=seed)
            self.naive, self.time = naive, 0
            self.level: list[float] = []  # of each paper, as are the next ones
            self.owner: list[Any] = []
            self.journal: list[Any] = []
            self.published: list[int] = []  # year
            self.citations: list[int] = []
            self.start: list[int] = []  # of each block of papers that came out together
            self.prefix: list[list[float]] = []  # qualities of a block added up
            self.block_year: list[int] = []
            self.outlets = Journal.create_agents(self, JOURNALS)
            self.writers = Author.create_agents(self, AUTHORS)
            self.initial_papers()
            self.weigh()
            self.writers.do("write")

        @property
        def year(self) -> int:
            return 1 + self.time // STEPS

        def power_law(self) -> float:
            x = (1 + self.random.random() * (5.0**-0.5 - 1)) ** -2.0
            return (x - 1) / 4 * Q_MAX

        def append(self, block: list[tuple[float, Any, Any]], year: int) -> None:
            """Papers that come out together; what they cite is counted elsewhere."""
            self.start.append(len(self.level))
            total, prefix = 0.0, []
            for quality, author, journal in block:
                total += quality
                prefix.append(total)
                self.level.append(quality)
                self.owner.append(author)
                self.journal.append(journal)
                self.published.append(year)
                self.citations.append(0)
            self.prefix.append(prefix)
            self.block_year.append(year)

        def initial_papers(self) -> None:
            """Power-law qualities, chronological references, journals in two phases."""
            years = sorted(self.random.choices((-2, -1, 0), k=PAPERS))
            received, cites = [0] * PAPERS, []
            for number, year in enumerate(years):
                cites.append(self.earlier(number, year, years))
                self.level.append(self.power_law())
            for number, cited in enumerate(cites):
                if years[number] == 0:
                    for paper in cited:
                        if years[paper] < 0:
                            received[paper] += 1
            order = [number for number in range(PAPERS) if years[number] < 0]
            self.random.shuffle(order)
            journals = [self.random.randrange(JOURNALS) for _ in range(PAPERS)]
            self.place(order, received, journals)
            level, self.level, every = self.level, [], list(self.outlets)
            for year in (-2, -1, 0):
                block = [n for n in range(PAPERS) if years[n] == year]
                outlets = [every[journals[n]] for n in block]
                self.append(
                    [(level[n], None, j) for n, j in zip(block, outlets, strict=True)], year
                )
                for n, journal in zip(block, outlets, strict=True):
                    journal.by_year[year] = journal.by_year.get(year, 0) + 1
                    insort(journal.qualities, level[n])
            for cited in cites:
                for paper in cited:
                    self.citations[paper] += 1
            for number, journal in enumerate(every):
                papers = sum(journal.by_year.get(year, 0) for year in (-2, -1))
                got = sum(received[n] for n in order if journals[n] == number)
                journal.impact = got / papers if papers else math.nan

        def earlier(self, number: int, year: int, years: list[int]) -> list[int]:
            """What an initial paper cites of those before it."""
            weights = self.reach_before(number, year, years)
            total = weights[-1] if weights else 0.0
            found: list[int] = []
            for _ in range(200 if total > 0 else 0):
                paper = bisect_right(weights, self.random.random() * total)
                if paper not in found:
                    found.append(paper)
                    if len(found) == min(REFERENCES, number):
                        break
            return found

        def reach_before(self, number: int, year: int, years: list[int]) -> list[float]:
            """Weights of the papers before one, added up; kept for papers of the same year."""
            if getattr(self, "reach_year", None) != year:
                self.reach_year, self.reach = year, []
            total = self.reach[-1] if self.reach else 0.0
            for paper in range(len(self.reach), number):
                total += self.level[paper] / max(1, year - years[paper]) ** 3
                self.reach.append(total)
            return self.reach

        def place(self, order: list[int], received: list[int], journals: list[int]) -> None:
            """Each paper in the journal that brings the distribution nearest to the real one."""
            got, size = [0] * JOURNALS, [0] * JOURNALS
            surplus = [-wanted for wanted in aim]
            last = len(aim) - 1
            for number in order:
                gain = received[number]
                best, ties = math.inf, []
                for j in range(JOURNALS):
                    then = min(round((got[j] + gain) / (size[j] + 1)), last)
                    change = 0.0
                    if not size[j]:
                        change = 1 + 2 * surplus[then]
                    else:
                        now = min(round(got[j] / size[j]), last)
                        if now != then:
                            change = 2 + 2 * (surplus[then] - surplus[now])
                    if change < best - 1e-9:
                        best, ties = change, [(j, then)]
                    elif change <= best + 1e-9:
                        ties.append((j, then))
                j, then = ties[int(self.random.random() * len(ties))]
                if size[j]:
                    surplus[min(round(got[j] / size[j]), last)] -= 1
                surplus[then] += 1
                got[j] += gain
                size[j] += 1
                journals[number] = j

        def weigh(self) -> None:
            """What drafts of this step can cite: blocks by quality and recency, added up."""
            self.known, total, self.reach = len(self.level), 0.0, []
            for prefix, year in zip(self.prefix, self.block_year, strict=True):
                if prefix:
                    total += prefix[-1] / max(1, self.year - year) ** 3
                self.reach.append(total)

        def references(self) -> list[int]:
            """Ten different papers that were out before this step."""
            if self.naive:
                return self.naive_references()
            chance, reach, prefixes, start = self.random.random, self.reach, self.prefix, self.start
            total, found = reach[-1], []
            while len(found) < REFERENCES:
                block = bisect_right(reach, chance() * total)
                prefix = prefixes[block]
                paper = start[block] + bisect_right(prefix, chance() * prefix[-1])
                if paper not in found:
                    found.append(paper)
            return found

        def naive_references(self) -> list[int]:
            year, found = self.year, []
            weights = [
                self.level[paper] / max(1, year - self.published[paper]) ** 3
                for paper in range(self.known)
            ]
            while len(found) < REFERENCES:
                (paper,) = self.random.choices(range(self.known), weights)
                if paper not in found:
                    found.append(paper)
            return found

        def step(self) -> None:
            year = self.year
            self.weigh()
            order = list(self.outlets)
            self.random.shuffle(order)  # ties at random
            order.sort(key=lambda journal: -1.0 if math.isnan(journal.impact) else journal.impact)
            self.ranked, self.accepted = order, []
            self.outlets.do("judge")
            self.writers.do("submit")
            self.append([(a.quality, a, j) for a, j in self.accepted], year)
            for author, journal in self.accepted:
                insort(journal.qualities, author.quality)
                journal.by_year[year] = journal.by_year.get(year, 0) + 1
                author.tally[0] = author.tally.get(0, 0) + 1
                for paper in author.cited:
                    before = self.citations[paper]
                    self.citations[paper] = before + 1
                    if 1 <= year - self.published[paper] <= 2:
                        self.journal[paper].received += 1
                    if self.owner[paper] is not None:
                        self.owner[paper].cited_again(before)
            for author, _ in self.accepted:
                author.write()
            if (self.time + 1) % STEPS == 0:
                self.outlets.do("close")
            self.time += 1

    return Model


def scaled(authors: int, journals: int, papers: int, years: int) -> tuple[int, float]:
    """Papers at the end of a run, and the seconds that it takes."""
    import jax

    from ethogram.worlds.publishing import Publishing

    world = Publishing(authors=authors, journals=journals, initial_papers=papers, years=years)
    run = run_of(world, "random", "accept_everything")
    program = jax.jit(run).lower(jax.random.key(0)).compile()
    best, published = math.inf, 0
    for repeat in range(3 if authors < 10_000 else 1):
        began = time.perf_counter()
        published = int(jax.block_until_ready(program(jax.random.key(repeat)))[0])
        best = min(best, time.perf_counter() - began)
    return published, best


def main() -> None:
    """Measure, print the tables, and keep the figures where asked."""
    chosen = options(__doc__)
    share = RUNS // chosen.cores
    sides = {
        "Ethogram": side_by_side(chosen.cores, ours, share),
        "Mesa, the same algorithm": side_by_side(chosen.cores, mesas, share, False),
        "Mesa, naive": side_by_side(chosen.cores, mesas, NAIVE_RUNS, True),
    }
    rates = {}
    rows = []
    for name, parts in sides.items():
        runs = sum(part["runs"] for part in parts)
        rates[name] = runs / max(part["seconds"] for part in parts)
        processor = sum(part["processor"] for part in parts) / runs
        papers, h_index = (
            sum(part["runs"] * part[what] for part in parts) / runs
            for what in ("papers", "h_index")
        )
        rows.append(
            {
                "side": name,
                "runs": runs,
                "rate": rates[name],
                "processor": processor,
                "papers": papers,
                "h_index": h_index,
            }
        )
    for row in rows[1:2]:
        for what in ("papers", "h_index"):
            if not math.isclose(row[what], rows[0][what], rel_tol=CLOSE):
                raise RuntimeError(f"the models differ: {what} {row[what]} and {rows[0][what]}")
    print("| model | runs | runs per second | processor seconds a run | papers | mean h-index |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for row in rows:
        print(
            f"| {row['side']} | {row['runs']:.0f} | {row['rate']:.3g} | {row['processor']:.3g} | "
            f"{row['papers']:.0f} | {row['h_index']:.2f} |"
        )
    ratio = rates["Ethogram"] / rates["Mesa, the same algorithm"]
    compiled = max(part["compile"] for part in sides["Ethogram"])
    print(f"\n{ratio:.1f} times Mesa with the same algorithm; compiling takes {compiled:.1f} s.\n")

    print("| papers | seconds | papers per second |\n| ---: | ---: | ---: |")
    curve = []
    for scale in SCALES:
        papers, seconds = alone(scaled, *scale)
        curve.append((papers, seconds))
        print(f"| {papers} | {seconds:.3g} | {papers / seconds:.3g} |", flush=True)
    x, y = ([math.log(one) for one in part] for part in zip(*curve, strict=True))
    middle = sum(x) / len(x), sum(y) / len(y)
    exponent = sum((a - middle[0]) * (b - middle[1]) for a, b in zip(x, y, strict=True)) / sum(
        (a - middle[0]) ** 2 for a in x
    )
    print(f"\nTime grows with papers to the power {exponent:.2f} (least squares of logarithms).")
    if chosen.json:
        chosen.json.write_text(
            json.dumps(
                {
                    "cores": chosen.cores,
                    "python": sys.version.split()[0],
                    "rows": rows,
                    "ratio": ratio,
                    "scaling": curve,
                    "exponent": exponent,
                }
            )
        )


if __name__ == "__main__":
    main()

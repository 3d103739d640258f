"""``sightray bench rays``: rays each second against other ray tracers, on the same scenes, rays and cores, in one run.

What is traced stands in `bench_cases`, who traces in `bench_peers`. Tracers take part in turns (A B A B), and medians are
compared. Each is at work for a while before it is measured (`SETTLING`): when their work is done, threads of some libraries
wait in circles for up to that long, and take the cores of whoever is next. *Building* is all from arrays to the answer of a
first ray; for Embree (Open3D, embreex) that is `add_triangles` and what the first ray sets off, the scene's commit.
*Agreement* is the share of rays of which a tracer says, as this library does in double precision, that they hit or that
they miss.
"""

from __future__ import annotations

import json as json_module
import time
from typing import Any, NamedTuple

import numpy as np

from sightray.cli.bench_cases import Case, case_named, icosphere
from sightray.cli.bench_peers import PEERS, Cast, Tracer, Unable, sightray_tracer

ROUNDS = 7
BUILDS = 3  # of the trees of meshes
SETTLING = 0.05  # seconds
FAR = 1e30  # t beyond which there is no hit, whatever a tracer means by infinite


class Result(NamedTuple):
    """What a tracer does on a case; or why it is absent."""

    name: str
    rates: dict[str, float]  # millions of rays each second, by question
    build: float = 0.0  # seconds
    agree: dict[str, float] = {}  # by kind of rays  # noqa: RUF012
    absent: str = ""


class Outcome(NamedTuple):
    """All that was measured on a case; the first result is ours."""

    case: str
    questions: list[str]
    results: list[Result]
    facts: dict[str, Any]


def seconds(call: Cast, o: np.ndarray, d: np.ndarray) -> float:
    """How long one call takes."""
    start = time.perf_counter()
    call(o, d)
    return time.perf_counter() - start


def settled_seconds(call: Cast, o: np.ndarray, d: np.ndarray) -> float:
    """How long one call takes when nobody else is at work any more."""
    spent = 0.0
    while spent < SETTLING:
        spent += seconds(call, o, d)
    return seconds(call, o, d)


def built(make: Any, case: Case, threads: int) -> tuple[Tracer, float]:
    """A tracer, and how long it takes to build: meshes several times, first for what only happens once."""
    o, d = (a[:1] for a in next(iter(case.rays.values())))
    plain, times = case.mesh is not None and case.places is None, []
    for _ in range(1 + BUILDS if plain else 1):
        start = time.perf_counter()
        tracer = make(case, threads)
        tracer.closest(o, d)
        times.append(time.perf_counter() - start)
    return tracer, float(np.median(times[1:] or times))


def hit_of(answer: Any) -> np.ndarray:
    """Which rays hit."""
    return np.asarray(answer[0]) < FAR


def measure(case: Case, peers: bool, threads: int, rounds: int = ROUNDS) -> Outcome:
    """Rates, building and agreement of all tracers on a case."""
    tracers, builds, absent = [], {}, []
    for name, make in {"sightray": sightray_tracer, **(PEERS if peers else {})}.items():
        try:
            tracer, builds[name] = built(make, case, threads)
            builds[tracer.name] = builds.pop(name)
            tracers.append(tracer)
        except Unable as reason:
            absent.append(Result(name, {}, absent=f"cannot: {reason}"))
        except Exception as reason:
            absent.append(Result(name, {}, absent=f"{type(reason).__name__}: {reason}".splitlines()[0][:100]))

    # In turns, so that what else the machine does meets all alike.
    questions = [f"{kind} {verb}" for verb in ("closest", "any") for kind in case.rays]
    times: dict[tuple[str, str], list[float]] = {(t.name, q): [] for t in tracers for q in questions}
    for _ in range(rounds):
        for question in questions:
            kind, verb = question.rsplit(" ", 1)
            for tracer in tracers:
                times[tracer.name, question].append(settled_seconds(getattr(tracer, verb), *case.rays[kind]))
    truth = {kind: hit_of(tracers[0].closest(o, d)) for kind, (o, d) in case.rays.items()}
    results = []
    for tracer in tracers:
        taken = {q: float(np.median(times[tracer.name, q])) for q in questions}
        rates = {q: len(case.rays[q.rsplit(" ", 1)[0]][0]) / 1e6 / taken[q] for q in questions}
        agree = {k: float((hit_of(tracer.closest(*case.rays[k])) == truth[k]).mean()) for k in truth}
        results.append(Result(tracer.name, rates, builds[tracer.name], agree))
    sizes = {f"{kind} rays": len(o) for kind, (o, _) in case.rays.items()}
    facts = {"threads": threads, "rounds": rounds, **facts_of(case), **sizes}
    return Outcome(case.name, questions, results + absent, facts)


def facts_of(case: Case) -> dict[str, Any]:
    """How large a case is, and what its tree takes."""
    if case.mesh is None:
        return {"spheres": len(case.scene.objects)}
    vertices, faces = case.mesh
    shown = case.scene.objects[0]
    tree = getattr(shown, "of", shown).tree()
    each = sum(a.nbytes for a in (tree.tree.nodes, tree.blocks, tree.numbers, *(tree.cuts or ()))) / len(faces)
    return {
        "triangles": len(faces), **({} if case.places is None else {"instances": len(case.places)}),
        "bytes each triangle, tree and blocks": round(each, 1),
        "bytes each triangle, with vertices and faces": round(each + 24 * len(vertices) / len(faces) + 12, 1),
    }  # fmt: skip


def warm_up(threads: int) -> None:
    """Have the kernels compiled that build trees and trace, lest that be measured."""
    import sightray as sr
    from sightray.scene.queries import FEW_RAYS

    vertices, faces = icosphere(2)
    scene = sr.Scene(sr.Mesh(vertices=vertices, faces=faces))
    o, d = np.full((FEW_RAYS, 3), (0.0, 0.0, 3.0)), (0.0, 0.0, -1.0)
    scene.intersect(o, d, threads=threads)
    scene.occluded(o, d, threads=threads)


def rays(peers: bool, json: bool, case: str = "balls", threads: int | None = None, rounds: int = ROUNDS) -> None:
    """Measure rays each second through `Scene.intersect` and `Scene.occluded`, beside other ray tracers if asked."""
    from sightray.cli.bench_cases import CASES
    from sightray.mathlib.cores import core_count

    names = list(CASES) if case == "all" else [name.strip() for name in case.split(",")]
    warm_up(threads or core_count())
    outcomes = []
    for name in names:
        outcomes.append(measure(case_named(name), peers, threads or core_count(), rounds))
        if not json:
            print_rates(outcomes[-1])
    if json:
        print(json_module.dumps([as_plain(outcome) for outcome in outcomes], indent=2))


def as_plain(outcome: Outcome) -> dict[str, Any]:
    """For JSON."""
    rows = [
        {"name": r.name, "absent": r.absent, "build seconds": r.build, "agrees": r.agree, "Mrays/s": r.rates}
        for r in outcome.results
    ]
    return {"case": outcome.case, "facts": outcome.facts, "tracers": rows}


def print_rates(outcome: Outcome) -> None:
    """A table with our rates, and how many times those of each peer they are; and how building and answers compare."""
    from rich.console import Console
    from rich.table import Table

    ours = outcome.results[0]
    title = f"{outcome.case}: Mrays/s; in brackets: sightray is that many times as fast"
    table = Table(title=title, title_justify="left")
    for heading in ("", *outcome.questions, "build, s", "agrees, %"):
        table.add_column(heading, justify="left" if not heading else "right")
    for result in outcome.results:
        if result.absent:
            table.add_row(result.name, result.absent, *[""] * (len(outcome.questions) + 1))
            continue
        cells = [f"{r:.3g} ({ours.rates[q] / r:.2f})" for q, r in result.rates.items()]
        agree = " ".join(f"{100 * share:.4g}" for share in result.agree.values())
        table.add_row(result.name, *cells, f"{result.build:.3f} ({result.build / ours.build:.2f})", agree)
    console = Console(width=180)
    console.print(table)
    facts = dict(outcome.facts)
    if "triangles" in facts and "instances" not in facts:
        facts["million triangles built each second"] = round(facts["triangles"] / 1e6 / ours.build, 2)
    console.print(", ".join(f"{name}: {value:,}" for name, value in facts.items()))

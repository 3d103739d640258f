"""Options of a render, checked, and what follows from them: schedule, limits, checkpoint."""

from __future__ import annotations

import math
from importlib import metadata
from typing import Any

import numpy as np

from sightray.engine.adaptive import ErrorDriven
from sightray.engine.checkpoint import DIGEST, Checkpoint
from sightray.engine.identity import digest_of
from sightray.engine.run import Limits
from sightray.engine.schedule import MOST, Contrast, Schedule, Uniform
from sightray.errors import SceneError, did_you_mean


class Options:
    """Options of `sightray.render` that say how long it goes on, and where; each is checked.

    `expected` is what samplers are told: samples of each pixel, or 0 where that is not known beforehand.
    """

    def __init__(self, *, samples: Any, default_samples: int, time: Any, target_error: Any, adaptive: Any,
                 max_samples: Any, seed: Any, threads: Any):  # fmt: skip
        self.seed = _whole("seed", seed, 0, (1 << 63) - 1)
        self.threads = None if threads is None else _whole("threads", threads, 1, 4096)
        self.limits = Limits(
            None if time is None else _positive("time", time, "seconds"),
            None if target_error is None else _positive("target_error", target_error, "a share such as 0.02"),
        )
        open_ended = time is not None or target_error is not None
        if samples is not None:
            samples = _whole("samples", samples, 1, MOST)
        else:
            samples = MOST if open_ended else default_samples
        self.adaptive = _adaptive(adaptive, target_error)
        self.expected = 0 if open_ended or self.adaptive == "error" else samples
        self.schedule = self._schedule(samples, max_samples, open_ended)

    def _schedule(self, samples: int, max_samples: Any, open_ended: bool) -> Schedule:
        if self.adaptive is None:
            return Uniform(samples, open_ended)
        if self.adaptive == "error":
            most = MOST if max_samples is None else _whole("max_samples", max_samples, 1, MOST)
            return ErrorDriven(min(samples, most), self.limits.error, most)
        most = max(9, 4 * samples) if max_samples is None else _whole("max_samples", max_samples, samples, MOST)
        return Contrast(samples, min(most, MOST), self.adaptive)

    def checkpoint(self, path: Any, every: Any, resume: Any, scene: Any, integrator: Any, sampler: Any,
                   filter: Any) -> Checkpoint | None:  # fmt: skip
        """The checkpoint that was asked for, if one was."""
        if not isinstance(resume, bool):
            raise SceneError(f"render: resume: got {resume!r}; allowed: True or False")
        every = _positive("checkpoint_every", every, "seconds")
        if path is None:
            if resume:
                raise SceneError("render: checkpoint: missing; resume=True needs the file to go on from")
            return None
        identity = {
            "version of Sightray": metadata.version("sightray"),
            "size": f"{scene.camera.width}x{scene.camera.height}",
            "seed": str(self.seed),
            "integrator": repr(integrator), "sampler": repr(sampler), "filter": repr(filter),
            "kind of stopping": self._kind(sampler),
            "integrator's contents": DIGEST + digest_of(integrator),
            "scene": DIGEST + digest_of(scene.replace(integrator=None, samples=1, name="")),
        }  # fmt: skip
        return Checkpoint(path, identity, every, resume)

    def _kind(self, sampler: Any) -> str:
        """What of the limits decides where samples fall."""
        told = "samples as they come"
        if self.expected == 1:
            told = "one sample in the centre"
        elif sampler.counts:
            told = f"{self.expected or 'any number of'} samples"
        return told if self.adaptive is None else f"{told}, adaptive {self.adaptive}"


def _adaptive(adaptive: Any, target_error: Any) -> Any:
    """None, "error", or a contrast from 0 to 1."""
    if adaptive is None:
        return None if target_error is None else "error"
    if isinstance(adaptive, str) and adaptive != "error":
        hint = did_you_mean(adaptive, ["error"]) or "; allowed: 'error', or a contrast from 0 to 1, or None"
        raise SceneError(f"render: adaptive: got {adaptive!r}{hint}")
    if adaptive != "error" and not (_is_number(adaptive) and 0 <= adaptive <= 1):
        raise SceneError(f"render: adaptive: got {adaptive!r}; allowed: 'error', or a contrast from 0 to 1, or None")
    if adaptive != "error" and target_error is not None:
        raise SceneError("render: adaptive: a contrast does not go together with target_error; allowed: 'error'")
    return adaptive if adaptive == "error" else float(adaptive)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _positive(name: str, value: Any, unit: str) -> float:
    if not _is_number(value) or not 0 < value < math.inf:
        raise SceneError(f"render: {name}: got {value!r}; allowed: a number > 0 ({unit})")
    return float(value)


def _whole(name: str, value: Any, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise SceneError(f"render: {name}: got {value!r}; allowed: a whole number from {least} to {most}")
    return int(value)

"""Denoising by Intel's Open Image Denoise, guided by the colours and normals that are seen first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.engine.run import run
from sightray.errors import SceneError, UnsupportedError
from sightray.fields import choice
from sightray.images import Image
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.materials.base import local
from sightray.mathlib.table import Table, i64_at
from sightray.mathlib.vec import grey, vmin
from sightray.samplers.base import Draws
from sightray.scene.compile import Compiled
from sightray.scene.world import background, find_closest, on_seen_side, point_of, thin_beam

GUIDE_SAMPLES = 16  # of each guide, through the same filter, lens and shutter as the picture


class _FirstSeen(Integrator):
    """What a ray of sight meets first, as a picture: its plain colour, or its shading normal in the world."""

    what: str = choice("what is shown", ("albedo", "normal"))


(WHAT,) = _FirstSeen.offsets()


@implements(radiance, _FirstSeen)
def first_seen(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    o, d = ray.origin, ray.direction
    hit = find_closest(world, o, d, 0.0, math.inf)
    normal = i64_at(integrator, WHAT) != 0
    if hit.item < 0:
        return Radiance(grey(0.0) if normal else vmin(background(world, d), grey(1.0)), 1)
    point = on_seen_side(point_of(world, hit, o, d, thin_beam()), d)
    if normal:
        return Radiance(point.shading if point.cos_view >= 0.0 else -point.shading, 1)
    terms = local(point.material, point.where, point.cos_view)
    return Radiance(vmin(terms.color + terms.emission, grey(1.0)), 1)


def guides(compiled: Compiled, sampler: Any, filter: Any, *, seed: int, threads: int | None) -> tuple[Image, Image]:
    """Albedo, 0 to 1, and normal, components -1 to 1 in the world, of what each pixel sees first."""
    films = [
        run(compiled, _FirstSeen(what=what), sampler, filter, samples=GUIDE_SAMPLES, seed=seed, threads=threads).film
        for what in ("albedo", "normal")
    ]
    return Image(films[0].image()), Image(films[1].image())


def require_denoiser() -> Any:
    """The package `pyoidn`, or an `UnsupportedError` that says how to get it."""
    try:
        import pyoidn
    except ImportError as error:
        raise UnsupportedError(
            "denoising needs the package pyoidn (Intel Open Image Denoise): pip install sightray[denoise]"
            + (f"; it is there, but {error}" if "pyoidn" not in str(error) else "")
        ) from None
    return pyoidn


def denoised(image: Image, albedo: Any = None, normal: Any = None) -> Image:
    """See `sightray.denoise`."""
    guide = {"albedo": albedo, "normal": normal}
    pixels = {name: _rgb(value, name) for name, value in {"image": image, **guide}.items() if value is not None}
    for name, found in pixels.items():
        if found.shape != pixels["image"].shape:
            raise SceneError(f"denoise: {name}: got {found.shape[1]}x{found.shape[0]} pixels; "
                             f"allowed: {image.width}x{image.height}, as the image has")  # fmt: skip
    if normal is not None and albedo is None:
        raise SceneError("denoise: albedo: missing; a normal guides only together with an albedo")
    result = require_denoiser().denoise(pixels.pop("image"), hdr=True, **pixels)
    return Image(result, transfer=image.transfer, info={**image.info, "denoised": True})


def _rgb(value: Any, name: str) -> np.ndarray:
    """A picture's (height, width, 3) float32 pixels, all finite; grey is repeated, alpha left out."""
    pixels = (value if isinstance(value, Image) else Image(value)).pixels
    if not np.isfinite(pixels).all():
        raise SceneError(f"denoise: {name}: got values that are not finite; allowed: finite numbers")
    return np.ascontiguousarray(np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3])

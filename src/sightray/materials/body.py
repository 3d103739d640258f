"""What is inside of a body: a medium that was stated, or one that only absorbs."""

from __future__ import annotations

from typing import Any

from sightray.errors import SceneError
from sightray.media.homogeneous import HomogeneousMedium, clear_or_stained


def check_body(material: Any) -> None:
    """Raise a `SceneError` if absorption is stated beside a medium, which has its own."""
    if material.interior is not None and any(material.absorption):
        raise SceneError(f"{type(material).__name__}.absorption: stated beside interior; allowed: one of the two, since "
                         "a medium has its own")  # fmt: skip


def medium_inside(material: Any) -> Any:
    """The medium inside, or None."""
    return clear_or_stained(material.absorption) if material.interior is None else material.interior


def stain(material: Any) -> tuple[float, float, float]:
    """What Whitted's model knows of the inside: its absorption coefficient, 1/m; scattering is beyond it."""
    inside = medium_inside(material)
    return inside.absorption if isinstance(inside, HomogeneousMedium) else (0.0, 0.0, 0.0)

"""Scene files: how they become a `Scene`, and how a `Scene` becomes a file.

>>> from sightray.formats import suffixes
>>> {".yaml", ".test", ".obj", ".nff"} <= set(suffixes())
True

A format is one file of this folder with a ``FORMATS`` tuple; nothing else lists it. `formats.base` states the contract.
"""

from sightray.formats.base import Format, Limits, load_scene, save_scene, suffixes
from sightray.formats.framing import frame_mesh

__all__ = ["Format", "Limits", "frame_mesh", "load_scene", "save_scene", "suffixes"]

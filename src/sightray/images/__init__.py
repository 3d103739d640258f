"""Pictures as linear float arrays, and the files they come from and go to.

>>> import numpy as np
>>> from sightray.images import Image, suffixes
>>> Image(np.full((2, 3, 3), 0.5)).to_bytes()[0, 0].tolist()
[188, 188, 188]
>>> ".exr" in suffixes()
True

A codec is one file of this folder with a ``CODECS`` tuple; nothing else lists it.
"""

from sightray.images.atomic import check_writable, writing
from sightray.images.base import suffixes
from sightray.images.image import Image, load_image

__all__ = ["Image", "check_writable", "load_image", "suffixes", "writing"]

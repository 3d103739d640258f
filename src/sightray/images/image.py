"""`Image`: a picture as an array that knows how it becomes bytes."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import SceneError, did_you_mean, unknown
from sightray.images.atomic import check_writable, writing
from sightray.images.base import MAX_PIXELS, Codec, StrPath, as_float32, codec_for
from sightray.images.transfer import TRANSFERS, decode_codes, encode_bytes


@dataclass(frozen=True, eq=False, repr=False)
class Image:
    """A picture: linear Rec. 709 floats, read-only, row 0 on top.

    Parameters
    ----------
    pixels : (height, width, channels) float
        Linear values, unbounded; channels 1 (grey), 3 (RGB) or 4 (RGB and alpha, stored as given: nothing multiplies
        or divides by alpha). (height, width) is taken as one channel. Copied to float32.
    transfer : {"srgb", "floor", "gamma2.2"}
        How values become bytes in `to_bytes`, PNG and JPEG. ``"srgb"``: the sRGB curve, rounded to nearest.
        ``"floor"``: ``floor(255 * clamp(v, 0, 1))`` without a curve, the rule of course scenes. ``"gamma2.2"``: the
        same of v to the power of 1/2.2. Alpha has no curve.
    info : dict
        Free-form facts about how the picture came to be, such as render statistics. Not saved.

    Raises
    ------
    SceneError
        Another shape, integers (whose scale would be a guess), or an unknown transfer.

    Examples
    --------
    >>> image = Image([[[0.2, 0.4, 0.6]]], transfer="floor")
    >>> image
    <Image width=1 height=1 channels=3 transfer='floor' values 0.2 to 0.6>
    >>> image.to_bytes().tolist()
    [[[51, 102, 153]]]
    """

    pixels: NDArray[np.float32]
    transfer: str = "srgb"
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.transfer not in TRANSFERS:
            raise SceneError(f"Image: {unknown('transfer', str(self.transfer), TRANSFERS)}")
        object.__setattr__(self, "pixels", _checked_pixels(self.pixels))
        object.__setattr__(self, "info", dict(self.info))

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.pixels.shape[1]

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.pixels.shape[0]

    @property
    def channels(self) -> int:
        """1, 3 or 4."""
        return self.pixels.shape[2]

    def to_bytes(self) -> NDArray[np.uint8]:
        """(height, width, channels) uint8 by `transfer`; NaN becomes 0, +inf 255. Keeps 8 bits of [0, 1], no more."""
        return encode_bytes(self.pixels, self.transfer)

    def save(self, path: StrPath, **options: Any) -> None:
        """Write the picture, whole or not at all, in the format that the suffix names.

        ============  ===================================================  ======================================
        suffix        keeps                                                loses
        ============  ===================================================  ======================================
        .exr          float32, 1, 3 or 4 channels, exact                   nothing
        .npy          float32, 1, 3 or 4 channels, exact                   nothing
        .pfm          float32, 1 or 3 channels, exact                      alpha
        .hdr          RGBE: error <= 1/256 of a pixel's largest channel    alpha, negative values (written as 0)
        .png          8 bits of [0, 1] by `transfer`                       all outside [0, 1]
        .jpg .jpeg    about 8 bits of [0, 1] by `transfer`                 as .png, then alpha and fine detail
        ============  ===================================================  ======================================

        Parameters
        ----------
        path : its suffix, in any case, chooses the format.
        options : ``compression`` (0 to 9) for PNG, ``quality`` (1 to 100) for JPEG.

        Raises
        ------
        SceneError
            See `check_writable`; or an option that the format does not have.
        """
        path, codec = check_writable(path), codec_for(path)
        for name in options:
            if name not in codec.options:
                allowed = ", ".join(codec.options) if codec.options else "none"
                near = did_you_mean(name, codec.options) or ";"
                raise SceneError(f"{path}: {codec.name} has no option '{name}'{near} Options: {allowed}")
        values = _fit_channels(self.to_bytes() if codec.bitmap else self.pixels, codec)
        with writing(path) as aside:
            codec.write(aside, values, **options)

    @classmethod
    def load(cls, path: StrPath, *, linear: bool = False, max_pixels: int = MAX_PIXELS) -> Image:
        """Read a picture: the same as `load_image`."""
        return load_image(path, linear=linear, max_pixels=max_pixels)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        # NumPy 1 passes no `copy` and its asarray does not know it, so spell out the three cases.
        same = dtype is None or np.dtype(dtype) == self.pixels.dtype
        if copy is False and not same:
            raise ValueError(f"an Image holds float32; a copy is needed for {np.dtype(dtype)}")
        return self.pixels if same and not copy else self.pixels.astype(self.pixels.dtype if same else dtype)

    def __repr__(self) -> str:
        finite = self.pixels[np.isfinite(self.pixels)]
        values = f"values {finite.min():.4g} to {finite.max():.4g}" if finite.size else "no finite value"
        strange = self.pixels.size - finite.size
        return (
            f"<Image width={self.width} height={self.height} channels={self.channels} transfer={self.transfer!r} "
            f"{values}{f', {strange} not finite' if strange else ''}>"
        )

    def _repr_png_(self) -> bytes:
        """PNG bytes, which is how a notebook shows the picture."""
        from sightray.images.png import write_png

        stream = io.BytesIO()
        write_png(stream, self.to_bytes())
        return stream.getvalue()


def load_image(path: StrPath, *, linear: bool = False, max_pixels: int = MAX_PIXELS) -> Image:
    """Read a picture of any format in `suffixes()`.

    Parameters
    ----------
    path : file; its suffix chooses the format.
    linear : bool
        PNG and JPEG only: take the stored values as they are, divided by 255 or 65535, as a roughness or normal map
        wants. By default they are decoded from sRGB. Alpha is never decoded. The float formats are linear already.
    max_pixels : int
        Largest width * height that is accepted.

    Returns
    -------
    Image, whose `pixels` are (height, width, 1, 3 or 4) float32; [0, 1] from a bitmap.

    Raises
    ------
    SceneError
        Unknown suffix, or no such readable file.
    FormatError
        The file is truncated, corrupt, of another format, or too large.
    UnsupportedError
        The file is valid but of a kind that is not read, such as a deep EXR.
    """
    path, codec = Path(path), codec_for(path)
    try:
        if not path.is_file():
            raise SceneError(f"{path}: {'not a regular file' if path.exists() else 'no such file'}")
        stored = codec.read(path, max_pixels)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from error
    return Image(decode_codes(stored, linear=linear) if codec.bitmap else stored)


def _checked_pixels(pixels: ArrayLike) -> NDArray[np.float32]:
    """Own read-only float32 copy of (h, w) or (h, w, 1 | 3 | 4) real floats."""
    given = np.asarray(pixels)
    if given.ndim == 2:
        given = given[..., np.newaxis]
    if given.ndim != 3 or given.shape[2] not in (1, 3, 4) or given.size == 0:
        raise SceneError(
            f"Image: pixels of shape {np.shape(pixels)}; allowed: (height, width, channels) with 1, 3 or 4 channels"
        )
    if not np.issubdtype(given.dtype, np.floating):
        raise SceneError(
            f"Image: pixels of type {given.dtype}; allowed: floats, linear, 1 is white. Divide uint8 values by 255"
        )
    own = as_float32(given)
    if np.may_share_memory(own, given):
        own = own.copy()
    own.flags.writeable = False
    return own


def _fit_channels(values: NDArray[Any], codec: Codec) -> NDArray[Any]:
    """The same picture with a channel count that the format can hold: grey is repeated, alpha is left out."""
    channels = values.shape[2]
    if channels in codec.channels:
        return values
    return np.repeat(values, 3, axis=2) if channels == 1 else values[..., :3]

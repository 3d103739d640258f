"""The 24 fields of the ColorChecker chart."""

from __future__ import annotations

from functools import cache
from types import MappingProxyType

import numpy as np

from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import names_of, rows_of


@cache
def colorchecker() -> MappingProxyType[str, Spectrum]:
    """Reflectances of the chart's fields by their names, row by row from the top left: "dark skin" to "black 2 (1.5 D)".

    The mean of 30 charts, measured every 10 nm from 380 to 730 nm, and given here every nanometre by Sprague's
    interpolation: straight lines between the measurements would shift colours by up to 0.0013.

    References: C. McCamy, H. Marcus, J. Davidson, "A color-rendition chart", Journal of Applied Photographic Engineering
    2(3), 1976; measurements by D. Pascale, BabelColor.

    >>> colorchecker()["red"].rgb("D65").round(2).tolist()
    [0.43, 0.03, 0.04]
    """
    table = rows_of("colorchecker")
    nm = np.arange(table[0, 0], table[-1, 0] + 1)
    fields = {
        name: Spectrum(table[:, 0], values).resampled(nm, smooth=True)
        for name, values in zip(names_of("colorchecker"), table[:, 1:].T, strict=True)
    }
    return MappingProxyType(fields)

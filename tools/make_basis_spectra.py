"""Solve for the three reflectances that stand for Rec. 709 red, green and blue: python tools/make_basis_spectra.py

Of all triples of reflectances R, G, B at every nanometre with

- 0 <= R, G, B <= 1 and R + G + B = 1 at every wavelength,
- linear Rec. 709 colours (1, 0, 0), (0, 1, 0), (0, 0, 1) under D65 for the CIE 1931 observer,

find the one with the least sum of squared steps from each wavelength to the next. This is a convex quadratic program;
Mehrotra's predictor-corrector method solves it in a second. The result goes to src/sightray/spectra/data/basis.csv.

References: I. Mallett, C. Yuksel, "Spectral primary decomposition for rendering with sRGB reflectance", EGSR 2019;
J. Nocedal, S. Wright, Numerical Optimization, 2nd edition, section 16.6.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from sightray.spectra.observer import rgb_bar, white
from sightray.spectra.tables import WAVELENGTHS

TARGET = Path(__file__).parents[1] / "src" / "sightray" / "spectra" / "data" / "basis.csv"
DIGITS = 10


def quadratic_program(Q: sp.csc_matrix, A: sp.csc_matrix, b: np.ndarray) -> np.ndarray:
    """The x >= 0 that minimises x Q x / 2 subject to A x = b."""
    n = Q.shape[0]
    x, y, z = np.full(n, 1 / 3), np.zeros(len(b)), np.full(n, 0.1)
    for _ in range(100):
        dual, primal, gap = Q @ x - A.T @ y - z, A @ x - b, x @ z / n
        if gap < 1e-15 and np.abs(dual).max() < 1e-10 and np.abs(primal).max() < 1e-13:
            return x
        system = splu(sp.bmat([[Q + sp.diags(z / x), -A.T], [A, None]]).tocsc())

        # Predict by a pure Newton step, then correct for its curvature and aim back at the central path.
        dx, _, dz = _step(system, x, z, dual, primal, x * z)
        reach = _reach(x, dx, z, dz)
        centring = ((x + reach * dx) @ (z + reach * dz) / n / gap) ** 3
        dx, dy, dz = _step(system, x, z, dual, primal, x * z + dx * dz - centring * gap)
        reach = 0.995 * _reach(x, dx, z, dz)
        x, y, z = x + reach * dx, y + reach * dy, z + reach * dz
    raise RuntimeError("the quadratic program did not converge")


def _step(system, x, z, dual, primal, complementarity):
    both = system.solve(np.concatenate([-dual - complementarity / x, -primal]))
    dx, dy = np.split(both, [len(x)])
    return dx, dy, (-complementarity - z * dx) / x


def _reach(x, dx, z, dz):
    """The largest step up to 1 that keeps x and z positive."""
    return min(1.0, *((-v[dv < 0] / dv[dv < 0]).min(initial=1.0) for v, dv in ((x, dx), (z, dz))))


def main() -> None:
    n = len(WAVELENGTHS)
    difference = sp.diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n))
    colour = sp.csr_matrix((white()[:, np.newaxis] * rgb_bar()).T)
    sums = sp.hstack([sp.eye(n)] * 3)
    # The colour of the third follows from those of the others and of their sum, which is white.
    red, green = sp.hstack([colour, 0 * colour, 0 * colour]), sp.hstack([0 * colour, colour, 0 * colour])
    b = np.concatenate([np.ones(n), [1, 0, 0], [0, 1, 0]])
    steps = sp.block_diag([difference.T @ difference] * 3)
    x = quadratic_program(steps.tocsc(), sp.vstack([sums, red, green]).tocsc(), b)

    basis = np.clip(np.round(x.reshape(3, n), DIGITS), 0.0, 1.0)
    basis[1] = np.round(1.0 - basis[0] - basis[2], DIGITS) + 0.0  # sums of rounded numbers are 1 again; no -0
    rows = np.column_stack([WAVELENGTHS, basis.T])
    np.savetxt(TARGET, rows, delimiter=",", fmt="%.12g", header="nm,red,green,blue", comments="")
    print("range", basis.min(), basis.max(), "largest step per nm", np.abs(np.diff(basis)).max(axis=1))
    print("largest error of colour", np.abs(basis @ colour.T.toarray() - np.eye(3)).max())


if __name__ == "__main__":
    main()

"""Rays each second through `Scene.intersect` and `Scene.occluded`, beside the peers that are installed.

    python benchmarks/rays.py [--no-peers] [--json]

The same as ``sightray bench rays --peers``. Install peers beside the library: open3d (Debian: libusb-1.0-0), mitsuba
(libllvm19; DRJIT_LIBLLVM_PATH names another LLVM), embreex, trimesh.
"""

from __future__ import annotations

import sys

from sightray.cli.bench_rays import rays

if __name__ == "__main__":
    rays(peers="--no-peers" not in sys.argv, json="--json" in sys.argv)

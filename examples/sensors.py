"""The pictures of docs/sensors.md: ``python examples/sensors.py [docs/images/sensors]``.

Runs the commands that stand in the page's table, and keeps the pictures that it shows, with 256 colours each.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent.parent
ROW = re.compile(r"^\| !\[depth\]\(images/sensors/(\w+)\.png\) .*`(sightray sense .*)` \|$", re.MULTILINE)


def main() -> None:
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "docs" / "images" / "sensors"
    target.mkdir(parents=True, exist_ok=True)
    for name, command in ROW.findall((HERE / "docs" / "sensors.md").read_text(encoding="utf-8")):
        with tempfile.TemporaryDirectory() as folder:
            words = [folder if word == "out" else word for word in shlex.split(command)[1:]]
            subprocess.run([sys.executable, "-m", "sightray", *words, "-q"], cwd=HERE, check=True)
            for suffix in ("", "_error"):
                made = next(path for path in Path(folder).glob("*.png") if path.stem.endswith("_error") == bool(suffix))
                Image.open(made).quantize(256, dither=Image.Dither.NONE).save(
                    target / f"{name}{suffix}.png", optimize=True
                )


if __name__ == "__main__":
    main()

"""The page about spectra: its code runs and says what its comments claim."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).parents[2] / "docs" / "spectra.md"


def test_code_of_the_page(capsys):
    scope: dict = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(block, PAGE, "exec"), scope)
    assert capsys.readouterr().out.count("\n") == 7
    np.testing.assert_allclose((scope["red"] * scope["lamp"]).rgb(), scope["red"].rgb("A"), atol=1e-12)
    assert scope["spectra"].colorchecker()["cyan"].rgb("D65")[0] < 0
    assert scope["bulb"].spectrum == 2856
    assert scope["tube"].spectrum is scope["lamp"]

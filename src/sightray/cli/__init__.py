"""The command line: ``sightray render | explain | scenes``."""

from __future__ import annotations

from typing import Any


def main() -> None:
    """Entry point: run a command; errors that the user can mend are one line, and exit status 2."""
    import sys
    import warnings

    from sightray.cli.app import app
    from sightray.errors import SightrayError

    warnings.showwarning = _show_warning
    try:
        app()
    except SightrayError as error:
        print(f"sightray: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("sightray: interrupted", file=sys.stderr)
        sys.exit(130)


def _show_warning(message: Any, *_: Any, **__: Any) -> None:
    """Warnings without the line of source that raised them."""
    import sys

    print(f"sightray: warning: {message}", file=sys.stderr)

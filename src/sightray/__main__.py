"""``python -m sightray``."""

from sightray.cli import main

main()

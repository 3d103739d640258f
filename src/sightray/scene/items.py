from sightray.accelerators.item import *  # noqa: F403 - shim while work is under way

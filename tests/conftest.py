"""What all tests share."""

import os

# Tests run in as many processes as there are cores; each compiles by itself.
os.environ.setdefault("SIGHTRAY_COMPILERS", "1")

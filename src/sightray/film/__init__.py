"""Film: where samples gather and become a picture."""

"""Label layers: one file each. `base` states what they promise; `sightray.vision` says how they are computed."""

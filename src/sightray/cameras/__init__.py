"""Cameras: from pixel coordinates to rays of sight. `cameras.base` states what each one promises."""

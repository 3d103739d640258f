"""One courtyard through many cameras: `python examples/cameras.py FOLDER` saves a picture of each."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import sightray as sr

COLORS = [(0.8, 0.1, 0.08), (0.8, 0.45, 0.05), (0.2, 0.6, 0.1), (0.05, 0.45, 0.55), (0.1, 0.2, 0.75), (0.55, 0.1, 0.55)]
T = sr.Transform


def courtyard(*more: object) -> sr.Scene:
    """Twelve balls around the eye, and pillars behind them."""
    floor = sr.Lambert(albedo=sr.Checker(even=0.6, odd=(0.2, 0.25, 0.3), mode="solid"))
    objects: list[object] = [sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=floor)]
    pillar = sr.Box(lower=(-0.3, 0, -0.3), upper=(0.3, 4, 0.3), material=sr.Lambert(albedo=0.6))
    for k in range(12):
        around = T.rotate((0, 1, 0), -30 * k)
        ball = sr.Sphere(radius=0.8, material=sr.Lambert(albedo=COLORS[k % 6]))
        objects.append(sr.Instance(of=ball, transform=around @ T.translate(0, 0.8, -5)))
        objects.append(sr.Instance(of=pillar, transform=T.rotate((0, 1, 0), -15) @ around @ T.translate(0, 0, -9)))
    light = sr.PointLight(position=(3, 9, 2), intensity=700)
    return sr.Scene(*objects, *more, light, background=(0.35, 0.55, 0.85), ambient=0.15)


def pictures() -> dict[str, tuple[sr.Scene, int]]:
    """Scenes by name, each with the number of samples."""
    here, ahead = {"eye": (0, 1.6, 0), "target": (0, 1.6, -5)}, {"eye": (0, 1.6, 0), "target": (0, 1.2, -5)}
    pose = sr.PerspectiveCamera(**ahead).world_from_camera()
    size = {"width": 480, "height": 360}
    cameras: dict[str, object] = {
        "equirectangular": sr.PanoramaCamera(**here, width=800, height=400),
        "cylindrical": sr.PanoramaCamera(**here, projection="cylindrical", vfov=80, width=800, height=220),
        "fisheye": sr.FisheyeCamera(**ahead, fov=200, **size),
        "little-planet": sr.FisheyeCamera(eye=(0, 1.6, 0), target=(0, 0, -0.001), up=(0, 0, -1), fov=260, circle=1.7,
                                          projection="stereographic", **size),
        "calibrated": sr.CalibratedCamera(fx=230, k1=-0.3, k2=0.07, p1=0.002, pose=pose, **size),
        "thin-lens": sr.ThinLensCamera(eye=(0, 1.6, 3), target=(0, 0.8, -5), vfov=40, lens_radius=0.25, blades=6,
                                       focus_distance=8.1, **size),
        "moving-camera": sr.MovingCamera(camera=sr.PerspectiveCamera(shutter_close=1.0, vfov=70, **size), poses=[
            (0, {"eye": (0, 1.6, 2), "target": (0, 1, -5)}), (1, {"eye": (0, 1.6, 1.2), "target": (0, 1, -5)})]),
    }  # fmt: skip
    found = {name: (courtyard().replace(camera=camera), 64 if "lens" in name or "moving" in name else 16)
             for name, camera in cameras.items()}  # fmt: skip

    # A wheel that turns, and a ball that rolls past: blurred by a slow shutter, bent by a rolling one.
    spokes = [sr.Instance(of=sr.Box(lower=(-0.06, 0, -0.06), upper=(0.06, 1.2, 0.06)), transform=T.rotate((0, 0, 1), 60 * k))
              for k in range(6)]  # fmt: skip
    wheel = sr.Group(objects=spokes, transform=T.translate(-1.2, 1.4, -3), motion=turning(2.0))
    orange = sr.Lambert(albedo=sr.Checker(scale=4, odd=(0.8, 0.3, 0.1)))
    there = T.translate(3.3, 0.5, -2.5) @ T.rotate((0, 0, 1), -170)
    ball = sr.Instance(of=sr.Sphere(radius=0.5, material=orange), motion=[(0, T.translate(0.3, 0.5, -2.5)), (1, there)])
    for name, shutter in (("motion-blur", {"shutter_close": 0.05}), ("rolling-shutter", {"readout": 0.3})):
        camera = sr.PerspectiveCamera(eye=(0.4, 1.5, 2), target=(0.4, 1.2, -3), vfov=40, **size, **shutter)
        found[name] = (courtyard(wheel, ball).replace(camera=camera), 64)
    return found


def turning(turns: float) -> list[tuple[float, sr.Transform]]:
    """Keyframes of turns within a second, less than half a turn apart."""
    return [(t, T.rotate((0, 0, 1), 360 * turns * t)) for t in np.linspace(0, 1, int(4 * turns) + 1)]


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    for name, (scene, samples) in pictures().items():
        sr.render(scene, sr.Whitted(), samples=samples).save(folder / f"camera-{name}.png")

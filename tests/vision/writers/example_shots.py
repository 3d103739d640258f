"""A small sequence in stereo that tests of writers write: meshes, a sphere and a floor, seen by a camera off its middle."""

from __future__ import annotations

import functools

import numpy as np

import sightray as sr
from sightray.vision.animation import Animation
from sightray.vision.rigs import stereo_rig
from sightray.vision.shot import Shot
from sightray.vision.trajectory import Keyframes, Orbit

WIDTH, HEIGHT, RATE = 64, 48, 10.0
LAYERS = ("depth", "normal", "instance", "semantic", "position", "flow", "occlusion", "out_of_view", "next_position",
          "disparity")  # fmt: skip
K = np.array([[70.0, 0.0, 33.25], [0.0, 72.0, 22.5], [0.0, 0.0, 1.0]])


def block(x: float, y: float, z: float) -> sr.Mesh:
    """A box as a closed mesh, its base in y = 0."""
    corners = np.array([[(k & 1) * x, (k >> 1 & 1) * y, (k >> 2 & 1) * z] for k in range(8)]) - [x / 2, 0, z / 2]
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2],
             [2, 4, 6], [1, 3, 5], [3, 7, 5]]  # fmt: skip
    return sr.Mesh(vertices=corners, faces=faces)


def example_scene(camera: sr.PinholeCamera | None = None) -> sr.Scene:
    """Two blocks, one before the other, a third that reaches out of the picture, a ball and a floor."""
    brick = block(0.6, 0.8, 0.4)
    return sr.Scene(
        sr.Instance(of=brick, transform=sr.Transform.translate(-0.3, 0, 0), name="block-0"),
        sr.Instance(of=sr.Instance(of=block(1, 1, 1), transform=sr.Transform.scale(0.5)), name="cube-0",
                    transform=sr.Transform.translate(0.1, 0, 0.7) @ sr.Transform.rotate((0, 1, 0), 30)),
        sr.Instance(of=brick, transform=sr.Transform.translate(1.35, 0, 0.2), name="block-1"),
        sr.Sphere(center=(-1.0, 0.3, 0.2), radius=0.3, name="ball"),
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), name="floor"),
        sr.PointLight(position=(2, 4, 3), intensity=60),
        camera=camera or sr.PinholeCamera(fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2], width=WIDTH, height=HEIGHT),
    )  # fmt: skip


def moving(scene: sr.Scene) -> Animation:
    """The camera circles, one block slides."""
    slide = Keyframes([0, 1], [np.eye(4), sr.Transform.translate(0.3, 0, 0.2)])
    return Animation(scene, camera=Orbit((0, 0.4, 0), 3.0, elevation=20, azimuth=10, speed=30),
                     objects={"block-0": slide}, rig=stereo_rig(scene.camera, 0.1))  # fmt: skip


@functools.cache
def example_shots(frames: int = 3) -> tuple[Shot, ...]:
    """Both cameras of each frame."""
    animation, found = moving(example_scene()), []
    for step in range(frames):
        now, then = (step + k for k in (0, 1))
        scene, following = animation.at(now / RATE), animation.at(then / RATE)
        cameras, later = animation.cameras_at(now / RATE), animation.cameras_at(then / RATE)
        for index, name in enumerate(cameras):
            other = cameras["right" if name == "left" else "left"]
            labels = sr.label(
                scene, *LAYERS, camera=cameras[name], next=following.replace(camera=later[name]), stereo=other,
                classes={"block-0": "block", "block-1": "block", "cube-0": "cube"},
            )  # fmt: skip
            image = sr.Image(np.where(np.isnan(labels.normal), 0.2, 0.5 + 0.5 * labels.normal))
            found.append(Shot(labels, image, frame=step, camera=index, cameras=("left", "right"), step=step,
                              time=step / RATE, targets=(0, 1, 2), trajectory=animation.camera,
                              next_time=(step + 1) / RATE if step + 1 < frames else None))  # fmt: skip
    return tuple(found)

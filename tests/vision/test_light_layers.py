"""E5 and E7, and shadows: what is seen in mirrors and glass, intrinsic images, and lights against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from label_scenes import BALL, FLOOR, centres, every_camera, scene, sphere_distance

import sightray as sr

CAMERA = sr.PerspectiveCamera(eye=(0.3, 0.8, 5), target=(0, 0.2, 0), vfov=50, width=96, height=72)
WALL = sr.Plane(point=(0, 0, -0.5), normal=(0, 0, 1), material=sr.Mirror(), name="wall")
SPOT = sr.Sphere(center=(1.5, 0.9, 1.5), radius=0.5, material=sr.Lambert(albedo=0.6), name="spot")


def mirrored(points, normal, point):
    """Points behind a plane mirror."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    return points - 2 * ((points - point) @ n)[..., None] * n


def through(camera, pixel):
    """A camera whose only pixel has its centre where `camera` has the continuous coordinates `pixel`."""
    k = camera.intrinsics()
    return sr.PinholeCamera(fx=k[0, 0], fy=k[1, 1], cx=k[0, 2] - pixel[0] + 0.5, cy=k[1, 2] - pixel[1] + 0.5,
                            width=1, height=1, pose=camera.world_from_camera())  # fmt: skip


# ---------------------------------------------------------------------------------------------------------- E5: mirrors


def test_e5_a_plane_mirror_shows_what_stands_behind_it_mirrored():
    labels = sr.label(scene(CAMERA, WALL, SPOT), "mirrored_position", "mirrored_instance", "instance")
    o, d = CAMERA.rays(centres(CAMERA))
    image_o = mirrored(o, (0, 0, 1), (0, 0, -0.5))
    image_d = d * (1, 1, -1)
    t = sphere_distance(image_o, image_d, SPOT.center, SPOT.radius)
    wall = labels.instance == 0
    seen = wall & np.isfinite(t)
    assert seen.sum() > 40
    assert ((labels.mirrored_instance == 1) == seen).all()
    expected = image_o + np.where(np.isfinite(t), t, 0)[..., None] * image_d
    grazing = np.abs(((expected - SPOT.center) * image_d).sum(-1)) < 0.02
    assert np.abs(labels.mirrored_position - expected)[seen & ~grazing].max() <= 1e-12
    assert np.isnan(labels.mirrored_position[~seen]).all()


@pytest.mark.parametrize("camera", ["PerspectiveCamera", "OrthographicCamera", "WindowCamera"])
def test_e5_flow_in_a_moving_plane_mirror_is_the_flow_of_the_image(camera):
    """The image of the moved point in the moved mirror, projected by the moved camera."""
    before = every_camera()[camera].resized(123, 90)
    after = before.replace(eye=np.add(before.eye, (0.1, 0.05, -0.1)))
    moved_wall = WALL.replace(point=(0, 0, -0.45), normal=(0.04, -0.02, 1))
    labels = sr.label(scene(before, WALL, SPOT), "mirrored_flow", "mirrored_position", "instance",
                      next=scene(after, moved_wall, SPOT.replace(center=(1.6, 0.95, 1.4))))  # fmt: skip
    seen = np.isfinite(labels.mirrored_position[..., 0]) & (labels.instance == 0)
    assert seen.sum() > 30
    image = mirrored(labels.mirrored_position[seen] + (0.1, 0.05, -0.1), moved_wall.normal, moved_wall.point)
    expected = after.project(image) - centres(before)[seen]
    solved = np.isfinite(labels.mirrored_flow[seen][:, 0])
    assert solved.mean() > 0.85  # some are hidden by the ball itself
    assert np.abs(labels.mirrored_flow[seen] - expected)[solved].max() <= 1e-6


def test_e5_what_escapes_by_a_mirror_flows_as_points_at_infinity_do():
    after = CAMERA.replace(eye=(0.35, 0.8, 5))
    turned = WALL.replace(normal=(0.03, 0, 1))
    labels = sr.label(scene(CAMERA, WALL), "mirrored_flow", next=scene(after, turned))
    _, d = CAMERA.rays(centres(CAMERA))
    away = mirrored(d * (1, 1, -1), turned.normal, (0, 0, 0))
    expected = after.project(np.array(after.eye) + away) - centres(CAMERA)
    assert np.abs(labels.mirrored_flow - expected).max() <= 1e-6


def test_e5_flow_in_a_curved_mirror_leads_to_the_same_point():
    """The path through the pixel that flow names ends at the moved point; and for small motions flow is linear."""
    globe = sr.Sphere(center=(-0.3, 0.2, 0), radius=1.0, material=sr.Mirror(), name="globe")

    def at(t):
        return scene(
            CAMERA,
            globe.replace(center=(-0.3 + 0.1 * t, 0.2, 0)),
            FLOOR,
            SPOT.replace(center=(1.7, 0.9, 1.6 - 0.2 * t)),
        )

    before, after = at(0), at(1)
    labels = sr.label(before, "mirrored_flow", "mirrored_position", "mirrored_instance", next=after)
    good = np.isfinite(labels.mirrored_flow[..., 0]) & (labels.mirrored_instance >= 0)
    assert good.sum() > 300
    assert {1, 2} <= set(labels.mirrored_instance[good])
    chosen = np.argwhere(good)[::41]
    checked = 0
    for row, column in chosen:
        pixel = np.array([column, row]) + 0.5 + labels.mirrored_flow[row, column]
        moved = labels.mirrored_position[row, column] + (
            (0, 0, -0.2) if labels.mirrored_instance[row, column] == 2 else 0
        )
        there = sr.label(after, "mirrored_position", camera=through(CAMERA, pixel)).mirrored_position[0, 0]
        if np.linalg.norm(there - moved) < 0.1:  # else something stands before it
            assert np.abs(there - moved).max() <= 1e-7
            checked += 1
    assert checked > 0.8 * len(chosen)

    # Central differences over a small and a half as small a motion differ by the square of it.
    def rate(h):
        ahead, back = (sr.label(before, "mirrored_flow", next=at(s)).mirrored_flow for s in (h, -h))
        return (ahead - back) / (2 * h)

    fine, coarse = rate(1e-3), rate(2e-3)
    both = np.isfinite(fine[..., 0]) & np.isfinite(coarse[..., 0])
    steady = both & (np.linalg.norm(fine, axis=-1) < 8)
    assert steady.sum() > 300
    assert np.abs(fine - coarse)[steady].max() < 1e-3
    assert np.median(np.abs(fine - coarse)[steady]) < 1e-6


def test_e5_a_slab_of_glass_shifts_what_is_behind_it_as_snell_says():
    ior, front, thick, wall = 1.5, 1.0, 0.7, -1.5
    slab = sr.Box(lower=(-9, -9, front - thick), upper=(9, 9, front), material=sr.Glass(ior=ior))
    labels = sr.label(scene(CAMERA, slab, sr.Plane(point=(0, 0, wall), normal=(0, 0, 1))), "refracted_position")
    o, d = CAMERA.rays(centres(CAMERA))
    at_front = o + d * ((front - o[..., 2]) / d[..., 2])[..., None]
    across = d[..., :2] / ior
    inside = np.concatenate([across, -np.sqrt(1 - (across**2).sum(-1, keepdims=True))], axis=-1)
    at_back = at_front + inside * (-thick / inside[..., 2])[..., None]
    expected = at_back + d * ((wall - at_back[..., 2]) / d[..., 2])[..., None]
    assert np.abs(labels.refracted_position - expected).max() <= 1e-8  # rays begin 1e-9 of their way behind a surface


def test_e5_flow_through_a_moving_slab():
    """The slab turns nothing, so the direction at the eye decides: solved here for each point by bisection along it."""
    wall = sr.Plane(point=(0, 0, -1.5), normal=(0, 0, 1), name="wall")

    def room(thick, camera):
        slab = sr.Box(lower=(-9, -9, 1 - thick), upper=(9, 9, 1), material=sr.Glass(ior=1.5), name="slab")
        return scene(camera, slab, wall)

    after = CAMERA.replace(eye=(0.4, 0.8, 4.9), target=(0.05, 0.2, 0))
    labels = sr.label(room(0.7, CAMERA), "refracted_flow", "refracted_position", next=room(0.7, after))
    good = np.isfinite(labels.refracted_flow[..., 0])
    assert good.mean() > 0.9
    for row, column in np.argwhere(good)[::397]:
        pixel = np.array([column, row]) + 0.5 + labels.refracted_flow[row, column]
        there = sr.label(room(0.7, after), "refracted_position", camera=through(after, pixel)).refracted_position[0, 0]
        assert np.abs(there - labels.refracted_position[row, column]).max() <= 1e-8


def test_masks_of_mirrors_glass_and_lamps():
    lamp = sr.SphereLight(center=(-1.2, 1.2, 0), radius=0.3)
    glass = sr.Sphere(center=(-0.8, 0, 1), radius=0.4, material=sr.Glass())
    shiny = sr.Sphere(center=(0.5, -0.3, 2), radius=0.3, material=sr.Phong(mirror=0.2))
    labels = sr.label(scene(CAMERA, WALL, SPOT, glass, lamp, shiny), "mirror", "glass", "emitter", "instance")
    assert ((labels.mirror == 1) == ((labels.instance == 0) | (labels.instance == 4))).all()
    assert ((labels.glass == 1) == (labels.instance == 2)).all()
    assert ((labels.emitter == 1) == (labels.instance == 3)).all()
    assert labels.mirror.any()
    assert labels.glass.any()
    assert labels.emitter.any()


# ------------------------------------------------------------------------------------------------- E7: intrinsic images


def test_e7_irradiance_of_a_point_light_is_the_inverse_square_law():
    light = sr.PointLight(position=(0.5, 2.0, 1.0), intensity=(30, 20, 10))
    floor = FLOOR.replace(material=sr.Lambert(albedo=(0.2, 0.5, 0.8)))
    labels = sr.label(scene(CAMERA, floor, light), "irradiance", "albedo", "position", "instance", "color", "residual")
    on = labels.instance == 0
    to = np.array(light.position) - labels.position[on]
    r = np.linalg.norm(to, axis=-1)
    expected = (to[:, 1] / r**3)[:, None] * light.intensity
    np.testing.assert_allclose(labels.irradiance[on], expected, rtol=1e-12)
    np.testing.assert_allclose(labels.albedo[on], np.tile((0.2, 0.5, 0.8), (on.sum(), 1)), rtol=1e-14)
    np.testing.assert_allclose(labels.color[on], labels.albedo[on] * expected / np.pi, rtol=1e-12)
    assert np.abs(labels.residual[on]).max() <= 1e-12


LAMPS = (
    sr.PointLight(position=(2, 4, 3), intensity=30),
    sr.RectangleLight(corner=(-2, 3, 0), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=6, grid=2),
    sr.DirectionalLight(direction=(0.3, -1, -0.2), irradiance=0.7),
)


@pytest.mark.parametrize("name", ["PerspectiveCamera", "OrthographicCamera"])
def test_e7_of_a_matte_scene_the_residual_is_what_is_not_lit(name):
    """Albedo times irradiance is all that lights do on matte surfaces: what is left is emission and ambient light."""
    matte = sr.Lambert(albedo=sr.Checker(even=0.7, odd=(0.2, 0.3, 0.6)), emission=(0.05, 0.1, 0.0))
    table = sr.Rectangle(corner=(-1, -0.4, 1.5), edge_u=(3, 0, 0), edge_v=(0, 0, -3), material=matte)
    things = (BALL.replace(material=matte), table)
    room = scene(every_camera()[name], *things, *LAMPS, ambient=(0.1, 0.2, 0.3), background=(0.3, 0.3, 0.9))
    labels = sr.label(room, "albedo", "irradiance", "residual", "color", "instance")
    on = (labels.instance == 0) | (labels.instance == 1)
    left = labels.albedo * (0.1, 0.2, 0.3) + (0.05, 0.1, 0.0)
    assert np.abs(labels.residual - left)[on].max() <= 1e-6
    assert np.abs(labels.residual[labels.instance < 0] - (0.3, 0.3, 0.9)).max() <= 1e-12
    whole = np.nan_to_num(labels.albedo * labels.irradiance) / np.pi + labels.residual
    assert np.abs(whole - labels.color).max() <= 1e-6
    picture = np.asarray(sr.render(room, sr.Whitted(), samples=1))
    assert np.abs(picture - labels.color).max() <= 1e-6
    assert labels.irradiance[on].min() < 0.5 < labels.irradiance[on].max()


def test_e7_highlights_and_mirrors_are_left_to_the_residual():
    shiny = sr.Phong(diffuse=0.3, specular=0.6, ambient=0.0, mirror=0.25)
    room = scene(CAMERA, SPOT.replace(material=shiny), WALL, *LAMPS[:1])
    labels = sr.label(room, "residual", "albedo", "irradiance", "color", "instance")
    ball = labels.instance == 0
    np.testing.assert_allclose(labels.albedo[ball], 0.3 * np.pi, rtol=1e-14)
    assert labels.residual[ball].min() >= -1e-12
    assert labels.residual[ball].max() > 0.1
    wall = labels.instance == 1
    assert np.abs(labels.residual - labels.color)[wall].max() == 0


# --------------------------------------------------------------------------------------------------------------- shadows


def test_shadows_of_a_point_light_attached_and_cast():
    light = sr.PointLight(position=(2, 4, 3), intensity=30)
    camera = every_camera()["PerspectiveCamera"].resized(96, 72)
    wanted = ("light_visibility", "attached_shadow", "cast_shadow", "position", "normal", "instance")
    labels = sr.label(scene(camera, BALL, FLOOR, light), *wanted)
    on = labels.instance >= 0
    p, n, q = labels.position[on], labels.normal[on], np.array(light.position)
    total = labels.light_visibility + labels.attached_shadow + labels.cast_shadow
    assert np.abs(total[on] - 1).max() <= 1e-15
    facing = ((q - p) * n).sum(-1)
    assert (labels.attached_shadow[on, 0] == (facing <= 0)).all()

    # The floor's shadow: lines to the light that pass within the ball.
    to = q - p
    s = np.clip(((BALL.center - p) * to).sum(-1) / (to * to).sum(-1), 0, 1)
    gap = np.linalg.norm(p + s[:, None] * to - BALL.center, axis=-1) - BALL.radius
    floor = (labels.instance[on] == 1) & (np.abs(gap) > 1e-9)
    assert (labels.cast_shadow[on, 0] == (gap < 0))[floor].all()
    assert labels.cast_shadow[on, 0][floor].sum() > 50
    assert (labels.cast_shadow[on, 0][labels.instance[on] == 0] == 0).all()  # a ball shades itself by turning away


@pytest.mark.parametrize("rays", [1, 16])
def test_penumbra_fraction_of_a_panel_behind_an_edge(rays):
    """A half-plane at half the panel's height hides what is beyond its image; summed over a fine grid of the panel."""
    panel = sr.RectangleLight(corner=(-0.5, 2, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), grid=4, visible=False)
    edge = sr.Rectangle(corner=(0, 1, -50), edge_u=(50, 0, 0), edge_v=(0, 0, 100))
    floor = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0))
    camera = sr.PerspectiveCamera(eye=(-3, 2.5, 4), target=(-0.3, 0, 0), vfov=40, width=40, height=30)
    labels = sr.label(scene(camera, floor, edge, panel), sr.LightSharesLayer(rays=rays), "light_visibility", "cast_shadow",
                      "position", "instance")  # fmt: skip
    on = labels.instance == 0
    p = labels.position[on][:, :, None, None]
    grid = (np.arange(96) + 0.5) / 96 - 0.5
    u, v = np.meshgrid(grid, grid)
    light = 1 / ((u - p[:, 0]) ** 2 + 4 + (v - p[:, 2]) ** 2) ** 1.5  # 2 / r³: cosine of the panel over r²
    expected = np.where(u < -p[:, 0], light, 0).sum((1, 2)) / light.sum((1, 2))  # the edge's image is at -x
    assert ((expected > 0.1) & (expected < 0.9)).sum() > 30
    assert np.abs(labels.light_visibility[on, 0] - expected).max() <= 0.2 / rays
    np.testing.assert_allclose(labels.cast_shadow[on, 0], 1 - labels.light_visibility[on, 0], atol=1e-15)


def test_light_layers_of_scenes_without_lights_have_no_columns():
    labels = sr.label(scene(CAMERA, SPOT), "light_visibility", "cast_shadow", "irradiance", "instance")
    assert labels.light_visibility.shape == (72, 96, 0)
    assert labels.cast_shadow.shape == (72, 96, 0)
    assert (labels.irradiance[labels.instance == 0] == 0).all()
    assert labels.picture("light_visibility").width == 96


# --------------------------------------------------------------------------------------------------------- layered depth


def test_surfaces_are_all_crossings_of_a_ball_and_a_floor():
    labels = sr.label(scene(CAMERA, BALL, FLOOR), "surfaces", "depth", "instance")
    s = labels.surfaces
    counts = np.diff(s.offsets).reshape(72, 96)
    o, d = CAMERA.rays(centres(CAMERA))
    near = sphere_distance(o, d, BALL.center, BALL.radius)
    assert (counts == 2 * np.isfinite(near) + (d[..., 1] < 0)).all()
    first = s.offsets[:-1].reshape(72, 96)
    met = counts > 0
    np.testing.assert_allclose(s.depth[first[met]], labels.depth[met], rtol=1e-12)
    assert (s.instance[first[met]] == labels.instance[met]).all()
    row, column = np.argwhere(counts == 3)[0]
    k = s.offsets[row * 96 + column]
    assert s.instance[k : k + 3].tolist() == [0, 0, 1]
    assert s.entering[k : k + 3].tolist() == [True, False, True]
    assert (np.diff(s.distance[k : k + 3]) > 0).all()


# ------------------------------------------------------------------------------------------- E6: brightness constancy


REASON = {"attached": 4, "cast": 8, "shading": 16, "specular": 32, "inter": 64, "refraction": 128, "light": 256}
SUN = sr.PointLight(position=(2, 4, 3), intensity=40)
# Not filtered: how a filter blurs an edge depends on the distance, which is a change of brightness as well.
GREY = sr.Lambert(albedo=sr.Bitmap(image=np.array([[0.7, 0.3], [0.3, 0.7]], np.float32), filter="nearest", scale=2))
GROUND = FLOOR.replace(material=GREY)
STILL = BALL.replace(material=GREY)
STEP = CAMERA.replace(eye=(0.45, 0.85, 4.9))
BOARD = sr.Rectangle(corner=(-1.6, 0.2, 1.2), edge_u=(0.8, 0, 0), edge_v=(0, 0.8, 0), material=GREY, name="board")
TURNED = (
    sr.Transform.translate(-1.2, 0, 1.2) @ sr.Transform.rotate((0, 1, 0), -45) @ sr.Transform.translate(1.2, 0, -1.2)
)


def constancy(before, after, **options):
    return sr.label(
        before,
        sr.BrightnessConstancyLayer(**options),
        "flow",
        "occlusion",
        "out_of_view",
        "color",
        "instance",
        next=after,
    )


def test_e6_matte_things_that_stand_still_keep_their_brightness():
    labels = constancy(scene(CAMERA, STILL, GROUND, SUN, ambient=0.2), scene(STEP, STILL, GROUND, SUN, ambient=0.2))
    geometric = labels.out_of_view + 2 * labels.occlusion
    assert (
        labels.brightness_constancy == geometric
    ).mean() > 0.999  # a shadow's edge may fall to either side by rounding
    assert (labels.brightness_constancy == 0).mean() > 0.8


CAUSES = {
    "attached": (STILL, GROUND, BOARD.replace(transform=TURNED), SUN),
    "cast": (STILL.replace(center=(0.35, 0.6, 0.3)), GROUND, SUN),
    "shading": (STILL.replace(transform=sr.Transform.rotate((0, 1, 0), 0)), GROUND.replace(normal=(0.2, 1, 0)), SUN),
    "specular": (STILL.replace(material=sr.Phong(diffuse=0.4, specular=0.5, shininess=8)), GROUND, SUN),
    "inter": (STILL.replace(material=sr.Mirror()), GROUND, SUN),
    "refraction": (STILL.replace(material=sr.Glass()), GROUND, SUN),
    "light": (STILL, GROUND, SUN.replace(position=(2.6, 4, 3))),
}


def before_and_after(cause: str):
    """Two scenes between which that alone, and the camera, changes."""
    after = CAUSES[cause]
    if cause in ("specular", "inter", "refraction"):
        return scene(CAMERA, *after), scene(STEP, *after)
    first = (STILL, GROUND, BOARD, SUN) if cause == "attached" else (STILL, GROUND, SUN)
    return scene(CAMERA, *first), scene(STEP, *after)


@pytest.mark.parametrize("cause", CAUSES)
def test_e6_each_cause_sets_its_bit_and_without_it_the_mask_is_clear(cause):
    """The bit stands in many pixels, and in none when the pictures differ by the camera alone and all is matte."""
    labels = constancy(*before_and_after(cause))
    assert ((labels.brightness_constancy & REASON[cause]) != 0).sum() > 30
    if cause == "cast":
        assert ((labels.brightness_constancy & REASON["cast"] != 0) == (labels.brightness_constancy >> 16 == 1)).all()
    if cause == "attached":  # the board, and it alone, was lit and is not
        lit = labels.instance[(labels.brightness_constancy & REASON[cause]) != 0]
        assert (lit == 2).all()
    calm = constancy(scene(CAMERA, STILL, GROUND, SUN), scene(STEP, STILL, GROUND, SUN))
    assert ((calm.brightness_constancy & REASON[cause]) != 0).sum() <= 3


@pytest.mark.parametrize("cause", CAUSES)
def test_e6_of_each_cause_the_mask_is_sound_and_complete(cause):
    """Off the mask I1(x + u) is I0(x) within the tolerance, on it it is not; and there each pixel has a reason."""
    before, after = before_and_after(cause)
    labels = constancy(before, after, tolerance=0.02)
    bits = labels.brightness_constancy
    checked = 0
    for wanted in (bits == 0, (bits != 0) & (bits & 3 == 0)):
        places = np.argwhere(wanted)
        for row, column in places[:: len(places) // 20 + 1]:
            pixel = np.array([column, row]) + 0.5 + labels.flow[row, column]
            later = sr.label(after, "color", camera=through(STEP, pixel)).color[0, 0]
            change = np.abs(later - labels.color[row, column]).max()
            assert (change <= 0.02 + 1e-6) == bool(bits[row, column] == 0), (row, column, change)
            checked += 1
    assert checked >= 30


def test_e6_geometric_reasons_are_the_geometric_layers():
    labels = constancy(*before_and_after("cast"))
    assert ((labels.brightness_constancy & 1 != 0) == labels.out_of_view).all()
    assert ((labels.brightness_constancy & 2 != 0) >= labels.occlusion).all()
    assert labels.out_of_view.any()
    assert labels.occlusion.any()


def test_e6_a_cast_shadow_names_its_light():
    """Of two lights one has its shadow move; without that light nothing casts one that moves."""
    low = sr.PointLight(position=(-3, 3, 2), intensity=25)
    lid = sr.Disk(
        center=(-1.5, 1.9, 1.0), normal=(0.2, 1, 0), radius=0.3, material=GREY
    )  # before the second light alone
    away = lid.replace(center=(-1.5, 1.9, 0.6))
    labels = constancy(scene(CAMERA, GROUND, lid, SUN, low), scene(STEP, GROUND, away, SUN, low))
    ground = labels.instance == 0
    cast = ground & (labels.brightness_constancy & REASON["cast"] != 0)
    by_second = ground & (labels.brightness_constancy & (1 << 17) != 0)
    assert by_second.sum() > 30
    assert (cast >= by_second).all()
    alone = constancy(scene(CAMERA, GROUND, lid, SUN), scene(STEP, GROUND, away, SUN))
    assert ((alone.brightness_constancy & (1 << 17)) != 0).sum() == 0
    first = ground & (labels.brightness_constancy & (1 << 16) != 0)
    same = first == (((alone.brightness_constancy & (1 << 16)) != 0) & ground)
    assert same[labels.brightness_constancy & 3 == 0].mean() > 0.999


def test_e6_off_the_mask_the_next_picture_is_as_bright():
    """Sound and complete: I1(x + flow) by a camera of one pixel, against I0(x)."""
    things = (STILL.replace(material=sr.Phong(diffuse=0.4, specular=0.5, shininess=20, ambient=0.0)), GROUND, SUN)
    turned = (things[0].replace(center=(0.35, 0.6, 0.3)), GROUND, SUN)
    after = scene(STEP, *turned)
    labels = constancy(scene(CAMERA, *things), after, tolerance=0.02)
    bits = labels.brightness_constancy
    for wanted in (bits == 0, (bits != 0) & (bits & 3 == 0)):
        for row, column in np.argwhere(wanted)[::151]:
            pixel = np.array([column, row]) + 0.5 + labels.flow[row, column]
            later = sr.label(after, "color", camera=through(STEP, pixel)).color[0, 0]
            change = np.abs(later - labels.color[row, column]).max()
            assert (change <= 0.02 + 1e-6) == bool(bits[row, column] == 0), (row, column, change)

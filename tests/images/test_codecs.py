"""Codecs: what comes back is what went in, within each format's precision, and bad files raise FormatError."""

from __future__ import annotations

import dataclasses
import io
import os
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from sightray.errors import FormatError, SceneError, SightrayError, UnsupportedError
from sightray.images import Image, base, check_writable, exr, hdr, load_image, suffixes, writing
from sightray.images.transfer import srgb_encode

EVERY_SUFFIX = suffixes()


def picture(channels: int = 3, width: int = 23, height: int = 17, seed: int = 0) -> np.ndarray:
    """Values over six decades with flat stretches, so that run-length coders meet runs and literals."""
    rng = np.random.default_rng(seed)
    pixels = 10.0 ** rng.uniform(-3, 3, (height, width, channels))
    pixels[3:6, 2:15] = 0.25
    pixels[7] = 0.0
    return pixels.astype(np.float32)


def unit_picture(channels: int) -> np.ndarray:
    return np.linspace(0, 1, 16 * 16 * channels, dtype=np.float32).reshape(16, 16, channels)


# --- round trips ---------------------------------------------------------------------------------------------------


def test_all_promised_suffixes_are_discovered():
    assert set(EVERY_SUFFIX) == {".exr", ".hdr", ".jpeg", ".jpg", ".npy", ".pfm", ".png"}


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("suffix", [".exr", ".npy", ".pfm"])
def test_float_formats_are_exact(tmp_path, suffix, channels):
    pixels = picture(channels)
    pixels[0, 0, 0], pixels[0, 1, 0], pixels[0, 2, 0], pixels[0, 3, 0] = np.inf, np.nan, -2.5, 1e-42
    Image(pixels).save(tmp_path / f"a{suffix}")
    kept = 3 if suffix == ".pfm" and channels == 4 else channels
    np.testing.assert_array_equal(load_image(tmp_path / f"a{suffix}").pixels, pixels[..., :kept])


def test_hdr_error_is_at_most_one_256th_of_the_largest_channel(tmp_path):
    rng = np.random.default_rng(1)
    pixels = (10.0 ** rng.uniform(-35, 37, (64, 64, 1)) * rng.uniform(0, 1, (64, 64, 3))).astype(np.float32)
    Image(pixels).save(tmp_path / "a.hdr")
    error = np.abs(load_image(tmp_path / "a.hdr").pixels.astype(float) - pixels)
    relative = (error / pixels.max(axis=2, keepdims=True)).max()
    assert 1 / 300 < relative <= 1 / 256  # the bound holds and is the right one


def test_hdr_clamps_what_rgbe_cannot_hold(tmp_path):
    Image([[[-1.0, 2.0, np.nan], [np.inf, 3e38, 1.0], [-np.inf, -1.0, 0.0], [1e-42, 0.0, 0.0]]]).save(
        tmp_path / "a.hdr"
    )
    largest = np.float32(255 * 2.0**119)
    back = load_image(tmp_path / "a.hdr").pixels
    assert back.tolist() == [[[0, 2, 0], [largest, largest, 0], [0, 0, 0], [0, 0, 0]]]


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_png_holds_the_srgb_bytes(tmp_path, channels):
    pixels = unit_picture(channels)
    Image(pixels).save(tmp_path / "a.png")
    expected = np.round(255 * srgb_encode(pixels))
    expected[..., 3:] = np.round(255 * pixels[..., 3:].astype(float))
    with PIL.Image.open(tmp_path / "a.png") as back:
        assert back.mode == {1: "L", 3: "RGB", 4: "RGBA"}[channels]
        np.testing.assert_array_equal(np.asarray(back).reshape(pixels.shape), expected)


def test_srgb_curve_at_known_points():
    # IEC 61966-2-1: mid grey 18 % is 0.46136 of the signal; the two branches meet at 0.0031308.
    np.testing.assert_allclose(srgb_encode(np.array([0, 0.0031308, 0.18, 1])), [0, 0.04045, 0.46136, 1], atol=1e-5)


def test_floor_rule_on_multiples_of_a_fifth(tmp_path):
    row = [[[i / 5] * 3 for i in range(6)] + [[0.1999] * 3, [0.9999] * 3]]
    Image(row, transfer="floor").save(tmp_path / "a.png")
    with PIL.Image.open(tmp_path / "a.png") as back:
        assert np.asarray(back)[0, :, 1].tolist() == [0, 51, 102, 153, 204, 255, 50, 254]


def test_all_256_codes_survive_load_and_save(tmp_path):
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    PIL.Image.fromarray(codes).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load_image(tmp_path / "a.png").to_bytes()[..., 0], codes)
    np.testing.assert_allclose(load_image(tmp_path / "a.png", linear=True).pixels[..., 0], codes / 255, rtol=1e-7)


def test_jpeg_is_close(tmp_path):
    y, x = np.mgrid[0:32, 0:48] / 48
    pixels = np.stack([x, y, 0.5 + 0 * x], axis=2)
    Image(pixels).save(tmp_path / "a.JPG", quality=100)
    back = load_image(tmp_path / "a.JPG")
    assert np.abs(back.to_bytes().astype(int) - Image(pixels).to_bytes()).max() <= 4
    Image(pixels).save(tmp_path / "b.jpeg", quality=5)
    assert (tmp_path / "b.jpeg").stat().st_size < (tmp_path / "a.JPG").stat().st_size


# --- PNG kinds that others write -----------------------------------------------------------------------------------


def png_bytes(samples: np.ndarray, colour: int, depth: int = 16) -> bytes:
    """A PNG made by hand; each row has another filter: none, sub, up."""
    raw, above, step = b"", None, samples.shape[2] * depth // 8
    for y, row in enumerate(samples.astype(">u2" if depth == 16 else "u1")):
        line = np.frombuffer(row.tobytes(), np.uint8)
        left = np.concatenate([np.zeros(step, np.uint8), line[:-step]])
        raw += bytes((y % 3,)) + (line - [0, left, above][y % 3] if y % 3 else line).astype(np.uint8).tobytes()
        above = line

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", samples.shape[1], samples.shape[0], depth, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")


@pytest.mark.parametrize(("colour", "channels"), [(0, 1), (2, 3), (4, 2), (6, 4)])
def test_16_bit_png_keeps_all_16_bits(tmp_path, colour, channels):
    samples = np.random.default_rng(2).integers(0, 65536, (9, 7, channels))
    (tmp_path / "a.png").write_bytes(png_bytes(samples, colour))
    back = np.round(load_image(tmp_path / "a.png", linear=True).pixels * 65535)
    np.testing.assert_array_equal(back, samples[..., [0, 0, 0, 1]] if channels == 2 else samples)


def test_png_alpha_and_16_bit_decode(tmp_path):
    samples = np.array([[[65535, 32896, 0, 32896]]])
    (tmp_path / "a.png").write_bytes(png_bytes(samples, 6))
    half = 32896 / 65535
    expected = [1, ((half + 0.055) / 1.055) ** 2.4, 0, half]  # colour is decoded, alpha is not
    np.testing.assert_allclose(load_image(tmp_path / "a.png").pixels[0, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(("mode", "channels"), [("1", 1), ("L", 1), ("P", 3), ("LA", 4), ("RGB", 3), ("RGBA", 4)])
def test_png_of_every_pillow_mode(tmp_path, mode, channels):
    source = unit_picture(4 if mode.endswith("A") else 3)
    made = PIL.Image.fromarray((source * 255).astype(np.uint8)).convert(mode)
    made.save(tmp_path / "a.png")
    back = np.round(load_image(tmp_path / "a.png", linear=True).pixels * 255)
    expected = np.asarray(made.convert({1: "L", 3: "RGB", 4: "RGBA"}[channels])).reshape(16, 16, channels)
    np.testing.assert_array_equal(back, expected)


# --- formats byte by byte ------------------------------------------------------------------------------------------


def test_pfm_by_hand(tmp_path):
    # Bottom row first; a positive scale means big-endian.
    (tmp_path / "a.pfm").write_bytes(b"Pf\n2 2\n1.0\n" + struct.pack(">4f", 3, 4, 1, 2))
    assert load_image(tmp_path / "a.pfm").pixels[..., 0].tolist() == [[1, 2], [3, 4]]
    (tmp_path / "b.pfm").write_bytes(b"PF 1 2 -0.5\r\n" + struct.pack("<6f", 4, 5, 6, 1, 2, 3))
    assert load_image(tmp_path / "b.pfm").pixels.tolist() == [[[1, 2, 3]], [[4, 5, 6]]]
    Image([[1.0, 2.0], [3.0, 4.0]]).save(tmp_path / "c.pfm")
    assert (tmp_path / "c.pfm").read_bytes() == b"Pf\n2 2\n-1.0\n" + struct.pack("<4f", 3, 4, 1, 2)


def radiance(body: bytes, size: str, header: str = "FORMAT=32-bit_rle_rgbe\n") -> bytes:
    return f"#?RADIANCE\n{header}\n{size}\n".encode() + body


def test_hdr_runs_and_flat_give_the_same(tmp_path):
    pixels = picture(width=300)
    Image(pixels).save(tmp_path / "runs.hdr")
    rgbe = hdr._to_rgbe(pixels)
    (tmp_path / "flat.hdr").write_bytes(radiance(rgbe.tobytes(), "-Y 17 +X 300"))
    runs, flat = load_image(tmp_path / "runs.hdr").pixels, load_image(tmp_path / "flat.hdr").pixels
    np.testing.assert_array_equal(runs, flat)
    np.testing.assert_allclose(flat, pixels, atol=pixels.max() / 256)

    blank = Image(np.full((64, 1000, 3), 0.5))
    blank.save(tmp_path / "blank.hdr")
    assert (tmp_path / "blank.hdr").stat().st_size < 64 * 1000 * 4 / 50  # runs are really used


@pytest.mark.parametrize("width", [1, 7, 8, 127, 128, 129, 254, 255, 256, 257])
def test_hdr_widths_at_the_edges_of_its_codes(tmp_path, width):
    pixels = np.stack([np.full((width, 3), 0.5), np.arange(3.0 * width).reshape(width, 3)]).astype(np.float32)
    Image(pixels).save(tmp_path / "a.hdr")
    assert np.all(np.abs(load_image(tmp_path / "a.hdr").pixels - pixels) <= pixels.max(axis=2, keepdims=True) / 256)


def test_hdr_by_hand(tmp_path):
    # 128 at exponent 129 is 128 * 2**(129 - 136) = 1; a line of 8 pixels: runs of 8, 8, 3 + 5 literals, 8.
    line = bytes([2, 2, 0, 8, 136, 128, 136, 64, 131, 32, 5, 1, 2, 3, 4, 5, 136, 129])
    (tmp_path / "a.hdr").write_bytes(radiance(line, "-Y 1 +X 8"))
    expected = [[1, 0.5, b / 128] for b in (32, 32, 32, 1, 2, 3, 4, 5)]
    assert load_image(tmp_path / "a.hdr").pixels[0].tolist() == expected


def test_hdr_old_runs_repeat_the_last_pixel(tmp_path):
    # 1 1 1 n repeats n times, and a second marker counts in units of 256.
    a, b = bytes([128, 0, 0, 129]), bytes([0, 128, 0, 129])
    body = a + bytes([1, 1, 1, 2]) + bytes([1, 1, 1, 1]) + b
    (tmp_path / "a.hdr").write_bytes(radiance(body, "-Y 1 +X 260"))
    pixels = load_image(tmp_path / "a.hdr").pixels[0]
    assert (pixels[:259] == [1, 0, 0]).all()
    assert pixels[259].tolist() == [0, 1, 0]


@pytest.mark.parametrize("count", [258, 259, 261, 70000])
def test_hdr_old_runs_that_do_not_fill_the_picture(tmp_path, count):
    body = bytes([128, 0, 0, 129]) + bytes([1, 1, 1, 2]) + bytes([1, 1, 1, 1])
    (tmp_path / "a.hdr").write_bytes(radiance(body, f"-Y 1 +X {count}"))
    if count == 259:
        assert load_image(tmp_path / "a.hdr").width == 259
        return
    with pytest.raises(FormatError, match="add up"):
        load_image(tmp_path / "a.hdr")


def test_hdr_scan_orders_and_exposure(tmp_path):
    red, green = bytes([128, 0, 0, 129]), bytes([0, 128, 0, 129])
    for size, first in {"-Y 1 +X 2": (0, 0), "-Y 1 -X 2": (0, 1), "-Y 2 +X 1": (0, 0), "+Y 2 +X 1": (1, 0),
                        "+X 2 -Y 1": (0, 0), "-X 2 -Y 1": (0, 1), "+X 1 +Y 2": (1, 0)}.items():  # fmt: skip
        (tmp_path / "a.hdr").write_bytes(radiance(red + green, size, "EXPOSURE=4\nEXPOSURE=0.5\n"))
        pixels = load_image(tmp_path / "a.hdr").pixels
        assert pixels[first].tolist() == [0.5, 0, 0], size
        assert pixels.sum(axis=(0, 1)).tolist() == [0.5, 0.5, 0], size


# --- EXR seen by its own library -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("channels", "names"), [(1, {"Y"}), (3, {"R", "G", "B"}), (4, {"R", "G", "B", "A"})])
def test_exr_channel_names_and_types(tmp_path, channels, names):
    pixels = picture(channels)
    Image(pixels).save(tmp_path / "a.exr")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: channel.pixels for name, channel in file.channels().items()}
    assert found.keys() == names
    for name, values in found.items():
        assert values.dtype == np.float32
        np.testing.assert_array_equal(values, pixels[..., "RGBA".index(name) if name != "Y" else 0])


def test_exr_layers(tmp_path):
    layers = {
        "": picture(3),
        "depth": picture(1)[..., 0].astype(np.float64),
        "normal": picture(3, seed=1),
        "flow": picture(2).astype(np.float16),
        "id": np.arange(17 * 23).reshape(17, 23) + 2**31,
    }
    exr.write_layers(tmp_path / "a.exr", layers, components={"normal": "XYZ"})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == set("RGB") | {
            "depth",
            "normal.X",
            "normal.Y",
            "normal.Z",
            "flow.X",
            "flow.Y",
            "id",
        }
    back = exr.read_layers(tmp_path / "a.exr")
    assert back.keys() == layers.keys()
    for name, values in layers.items():
        np.testing.assert_array_equal(np.squeeze(back[name]), values.astype(back[name].dtype))
    assert [back[name].dtype for name in ("depth", "flow", "id")] == [np.float32, np.float16, np.uint32]
    np.testing.assert_array_equal(load_image(tmp_path / "a.exr").pixels, layers[""])


@pytest.mark.parametrize(
    "layers",
    [
        {},
        {"a": np.zeros((2, 2)), "b": np.zeros((2, 3))},
        {"a": np.zeros((2, 2, 5))},
        {"a": np.array([[-1]])},
        {"a": np.array([["x"]])},
        {"": np.zeros((2, 2, 3)), "R": np.zeros((2, 2))},
    ],
)
def test_exr_layers_that_cannot_be_written(tmp_path, layers):
    with pytest.raises(SceneError):
        exr.write_layers(tmp_path / "a.exr", layers)
    assert not list(tmp_path.iterdir())


# --- files that lie ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", EVERY_SUFFIX)
def test_every_truncation_is_a_format_error(tmp_path, suffix):
    Image(picture(width=40)).save(tmp_path / f"whole{suffix}")
    whole = (tmp_path / f"whole{suffix}").read_bytes()
    cut = tmp_path / f"cut{suffix}"
    lengths = {*range(0, 40), *range(0, len(whole), max(1, len(whole) // 60)), *range(len(whole) - 20, len(whole))}
    for length in sorted(lengths):
        cut.write_bytes(whole[:length])
        with pytest.raises(FormatError) as caught:
            load_image(cut)
        assert caught.value.path == cut, length


@pytest.mark.parametrize("suffix", EVERY_SUFFIX)
def test_flipped_bytes_never_raise_anything_else(tmp_path, suffix):
    Image(picture(width=40)).save(tmp_path / f"whole{suffix}")
    whole = (tmp_path / f"whole{suffix}").read_bytes()
    rng = np.random.default_rng(3)
    bad = tmp_path / f"bad{suffix}"
    refused = 0
    for trial in range(80):
        data = bytearray(whole)
        end = min(200, len(data)) if trial % 2 else len(data)  # half of the trials hit the header
        for at in rng.integers(0, end, 3):
            data[at] = rng.integers(256)
        bad.write_bytes(data)
        try:
            load_image(bad, max_pixels=100_000)
        except (FormatError, UnsupportedError):
            refused += 1
    assert refused > 0


@pytest.mark.parametrize("suffix", EVERY_SUFFIX)
@pytest.mark.parametrize(
    "content", [b"", b"GIF89a", b"\0" * 5000, b"#?RADIANCE\n\n", b"PF\n0 0\n-1\n", bytes(range(256))]
)
def test_wrong_content_is_a_format_error(tmp_path, suffix, content):
    (tmp_path / f"a{suffix}").write_bytes(content)
    with pytest.raises(FormatError, match="a\\" + suffix):
        load_image(tmp_path / f"a{suffix}")


def lying_files() -> dict[str, bytes]:
    """Headers that promise 144 million pixels (below the limit) over next to no data."""
    npy = io.BytesIO()
    np.lib.format.write_array_header_1_0(npy, {"descr": "<f4", "fortran_order": False, "shape": (12000, 12000, 3)})
    png = bytearray(png_bytes(np.zeros((1, 1, 3)), 2, depth=8))
    png[16:24] = struct.pack(">II", 12000, 12000)
    png[29:33] = struct.pack(">I", zlib.crc32(png[12:29]))
    stream = io.BytesIO()
    PIL.Image.new("RGB", (8, 8)).save(stream, "JPEG")
    jpeg = bytearray(stream.getvalue())
    at = jpeg.index(b"\xff\xc0") + 5
    jpeg[at : at + 4] = struct.pack(">HH", 12000, 12000)
    return {
        ".pfm": b"PF\n12000 12000\n-1\n" + bytes(100),
        ".hdr": radiance(b"\x02\x02\x2e\xe0" + bytes(100), "-Y 12000 +X 12000"),
        ".npy": npy.getvalue() + bytes(100),
        ".png": bytes(png),
        ".jpg": bytes(jpeg),
    }


@pytest.mark.parametrize("suffix", lying_files())
def test_lying_header_is_refused_before_memory_is_taken(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_bytes(lying_files()[suffix])
    with pytest.raises(FormatError):
        load_image(tmp_path / f"a{suffix}")  # once before, so that imports are not what is measured
    tracemalloc.start()
    try:
        with pytest.raises(FormatError):
            load_image(tmp_path / f"a{suffix}")
        assert tracemalloc.get_traced_memory()[1] < 30_000_000
    finally:
        tracemalloc.stop()


def test_lying_exr_header_is_refused(tmp_path):
    Image(picture()).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    window = struct.pack("<4i", 0, 0, 22, 16)
    assert data.count(window) == 2
    (tmp_path / "a.exr").write_bytes(data.replace(window, struct.pack("<4i", 0, 0, 16383, 16382)))
    with pytest.raises(FormatError, match=r"truncated|EXR"):
        load_image(tmp_path / "a.exr")


@pytest.mark.parametrize("suffix", EVERY_SUFFIX)
def test_max_pixels_is_a_limit_that_can_be_raised(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    Image(picture(width=40, height=10)).save(path)
    assert load_image(path, max_pixels=400).width == 40
    with pytest.raises(FormatError, match=r"40 x 10 .*allowed: 399"):
        load_image(path, max_pixels=399)


@pytest.mark.filterwarnings("error")
def test_pillows_own_pixel_limit_does_not_leak(tmp_path, monkeypatch):
    Image(picture()).save(tmp_path / "a.png")
    Image(picture()).save(tmp_path / "a.jpg")
    monkeypatch.setattr(PIL.Image, "MAX_IMAGE_PIXELS", 10)
    assert load_image(tmp_path / "a.png").width == load_image(tmp_path / "a.jpg").width == 23


@pytest.mark.parametrize("array", [np.zeros((3, 3), np.uint8), np.zeros((3, 3, 2)), np.zeros(3), np.zeros((0, 3, 3))])
def test_npy_of_other_shapes_and_types(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FormatError):
        load_image(tmp_path / "a.npy")


def test_npy_never_unpickles(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[{}]], dtype=object), allow_pickle=True)
    with pytest.raises(FormatError):
        load_image(tmp_path / "a.npy")


# --- atomic writing and asking beforehand --------------------------------------------------------------------------


def test_failing_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    for error in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(error), writing(path) as aside:  # noqa: PT012
            assert aside.parent == path.parent
            assert aside.suffix == ".txt"
            aside.write_text("half")
            raise error
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("suffix", EVERY_SUFFIX)
def test_codec_that_fails_midway_leaves_the_old_picture(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"a{suffix}"
    Image(picture()).save(path)
    old = path.read_bytes()
    codec = base.codecs()[suffix]

    def half(target, pixels):
        codec.write(target, pixels)
        target.write_bytes(target.read_bytes()[:50])
        raise OSError("no space left")

    monkeypatch.setitem(base.codecs(), suffix, dataclasses.replace(codec, write=half))
    with pytest.raises(OSError, match="no space left"):
        Image(picture(seed=5)).save(path)
    assert path.read_bytes() == old
    assert os.listdir(tmp_path) == [path.name]


def test_writing_follows_links_and_keeps_permissions(tmp_path):
    real, link = tmp_path / "real.npy", tmp_path / "link.npy"
    Image(picture()).save(real)
    real.chmod(0o640)
    link.symlink_to(real)
    Image(picture(seed=9)).save(link)
    assert link.is_symlink()
    assert real.stat().st_mode & 0o777 == 0o640
    np.testing.assert_array_equal(load_image(real).pixels, picture(seed=9))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.pgn", r"a\.pgn: unknown image suffix '\.pgn'; did you mean '\.png'\? Allowed: \.exr"),
        ("a", "needs a suffix"),
        ("none/a.png", "none' does not exist"),
        ("file.txt/a.png", "is not a folder"),
        ("folder.png", "is a folder"),
        ("pipe.png", "not a regular file"),
        ("a" * 300 + ".png", "not a usable file name"),
        ("a\0.png", "not a usable file name"),
    ],
)
def test_check_writable_says_what_is_wrong(tmp_path, name, message):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file.txt").touch()
    os.mkfifo(tmp_path / "pipe.png")
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(SceneError, match=message):
        check_writable(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == before


def test_check_writable_in_a_folder_that_takes_no_files(tmp_path, monkeypatch):
    # Permission bits do not stop root, under whom containers run tests; so let the system call itself refuse.
    def refuse(*args, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    with pytest.raises(SceneError, match="not writable: Permission denied"):
        check_writable(tmp_path / "a.png")


def test_check_writable_touches_nothing(tmp_path):
    path = tmp_path / "a.PNG"
    path.write_text("precious")
    os.utime(path, (1, 1))
    assert check_writable(str(path)) == path
    assert path.read_text() == "precious"
    assert path.stat().st_mtime == 1
    assert os.listdir(tmp_path) == ["a.PNG"]


def test_missing_file_and_folder_are_scene_errors(tmp_path):
    (tmp_path / "b.png").mkdir()
    for name, message in {
        "a.png": "no such file",
        "b.png": "not a regular file",
        "c.gif": "unknown image suffix",
    }.items():
        with pytest.raises(SceneError, match=message):
            load_image(tmp_path / name)


# --- the class itself ----------------------------------------------------------------------------------------------


def test_image_is_a_read_only_float32_copy():
    source = np.ones((2, 3, 3))
    image = Image(source, info={"samples": 4})
    source[:] = 7
    assert image.pixels.dtype == np.float32
    assert image.pixels.max() == 1
    assert (image.width, image.height, image.channels) == (3, 2, 3)
    with pytest.raises(ValueError, match="read-only"):
        image.pixels[0] = 2
    with pytest.raises(AttributeError):
        image.transfer = "floor"  # type: ignore[misc]
    assert image.info == {"samples": 4}
    assert np.asarray(image) is image.pixels
    assert np.array(image).flags.writeable
    assert np.asarray(image, dtype=np.float64).dtype == np.float64
    assert Image(np.ones((2, 3))).pixels.shape == (2, 3, 1)


def test_float32_source_is_copied_too():
    source = np.ones((2, 3, 3), np.float32)
    image = Image(source)
    source[:] = 7
    assert image.pixels.max() == 1
    assert source.flags.writeable


@pytest.mark.parametrize("transfer", ["srgb", "floor"])
def test_strange_values_become_bytes(transfer):
    image = Image([[[np.nan, np.inf, -np.inf, 0.5], [-1.0, 2.0, 1e-30, np.nan]]], transfer=transfer)
    grey = 128 if transfer == "srgb" else 127  # the fourth channel is alpha: no curve
    assert image.to_bytes().tolist() == [[[0, 255, 0, grey], [0, 255, 0, 0]]]
    assert "4 not finite" in repr(image)


@pytest.mark.parametrize(
    ("pixels", "options", "message"),
    [
        (np.zeros((2, 2, 3), np.uint8), {}, "uint8"),
        (np.zeros((2, 2, 2)), {}, r"\(2, 2, 2\)"),
        (np.zeros((0, 2, 3)), {}, r"\(0, 2, 3\)"),
        (np.zeros((2, 2, 3), complex), {}, "complex"),
        (np.zeros((2, 2, 3)), {"transfer": "sgrb"}, "did you mean 'srgb'"),
    ],
)
def test_image_refuses(pixels, options, message):
    with pytest.raises(SceneError, match=message):
        Image(pixels, **options)


def test_unknown_and_impossible_save_options(tmp_path):
    image = Image(picture())
    with pytest.raises(SceneError, match="no option 'qualty'; did you mean 'quality'"):
        image.save(tmp_path / "a.jpg", qualty=3)
    with pytest.raises(SceneError, match="no option 'quality'; Options: none"):
        image.save(tmp_path / "a.exr", quality=3)
    for suffix, options in ((".jpg", {"quality": 0}), (".png", {"compression": 10})):
        with pytest.raises(SightrayError):
            image.save(tmp_path / f"a{suffix}", **options)
    assert not list(tmp_path.iterdir())


def test_notebook_shows_the_same_bytes():
    image = Image(unit_picture(3))
    with PIL.Image.open(io.BytesIO(image._repr_png_())) as shown:
        np.testing.assert_array_equal(np.asarray(shown), image.to_bytes())


def test_large_pictures_are_encoded_in_slabs_without_a_seam():
    column = np.linspace(0, 1, 1500, dtype=np.float32)
    image = Image(np.broadcast_to(column[:, None, None], (1500, 1000, 3)))
    np.testing.assert_array_equal(image.to_bytes()[:, 500, 1], Image(column[:, None]).to_bytes()[:, 0, 0])


def test_import_costs_no_codec_library():
    script = (
        "import sys, sightray.images as i; i.suffixes(); print([m for m in ('PIL', 'OpenEXR') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_docstring_examples():
    import doctest

    from sightray.images import atomic, image

    package = sys.modules["sightray.images"]
    for module in (package, atomic, image):
        assert doctest.testmod(module).failed == 0
    assert Path(package.__file__).name == "__init__.py"

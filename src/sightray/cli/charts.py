"""Line charts as SVG, a few side by side: what the plots of docs/performance.md are drawn with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

WIDTH, HEIGHT = 420, 330  # of a chart, in units of the SVG
LEFT, RIGHT, TOP, BOTTOM = 62, 14, 40, 46  # margins around its axes
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # told apart by colour-blind people, too (Okabe and Ito, 2008)

Point = tuple[float, float]


class Chart(NamedTuple):
    """Curves over one pair of axes; y begins at 0."""

    title: str
    x: str
    y: str
    curves: Mapping[str, Sequence[Point]]
    log: bool = False  # whether x is drawn by its logarithm
    dashed: Mapping[str, Sequence[Point]] = {}  # straight lines of the curves with these names


def steps(highest: float) -> list[float]:
    """About five round numbers from 0 to the first one above `highest`."""
    rough = highest / 5
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * k for k in (1, 2, 5, 10) if size * k >= rough)
    return [step * i for i in range(math.ceil(highest / step - 1e-9) + 1)]


def short(value: float) -> str:
    """A number as people write it on an axis: 4000000 is 4M."""
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * size:  # which three digits show as 1
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"


def label(x: float, y: float, words: str, more: str = "") -> str:
    """Words at a place."""
    safe = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x:.1f}" y="{y:.1f}" {more}>{safe}</text>'


def line(points: Sequence[Point], style: str) -> str:
    """A curve through points of the picture."""
    return f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" fill="none" {style}/>'


def placing(chart: Chart, top: float) -> Callable[[Point], Point]:
    """Where a point of the data is drawn."""
    scale: Callable[[float], float] = math.log if chart.log else float
    xs = [scale(x) for curve in chart.curves.values() for x, _ in curve]
    low, high = (min(xs), max(xs)) if chart.log else (0.0, max(xs))
    wide, tall = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def place(point: Point) -> Point:
        return LEFT + wide * (scale(point[0]) - low) / (high - low), HEIGHT - BOTTOM - tall * point[1] / top

    return place


def drawn(chart: Chart) -> list[str]:
    """The elements of a chart."""
    ticks = steps(max(y for curve in chart.curves.values() for _, y in curve))
    place = placing(chart, ticks[-1])
    parts = [label(WIDTH / 2, 20, chart.title, 'text-anchor="middle" font-weight="bold"')]
    for value in ticks:
        y = place((1.0, value))[1]
        parts.append(line([(LEFT, y), (WIDTH - RIGHT, y)], 'stroke="#dddddd"'))
        parts.append(label(LEFT - 6, y + 4, short(value), 'text-anchor="end"'))
    for x in sorted({x for curve in chart.curves.values() for x, _ in curve}):
        at = place((x, 0.0))[0]
        parts.append(line([(at, HEIGHT - BOTTOM), (at, HEIGHT - BOTTOM + 4)], 'stroke="#000000"'))
        parts.append(label(at, HEIGHT - BOTTOM + 18, short(x), 'text-anchor="middle"'))
    parts.append(line([(LEFT, TOP), (LEFT, HEIGHT - BOTTOM), (WIDTH - RIGHT, HEIGHT - BOTTOM)], 'stroke="#000000"'))
    parts.append(label((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, chart.x, 'text-anchor="middle"'))
    middle = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(label(14, middle, chart.y, f'text-anchor="middle" transform="rotate(-90 14 {middle:.1f})"'))
    for number, (name, curve) in enumerate(chart.curves.items()):
        color = COLORS[number % len(COLORS)]
        places = [place(point) for point in curve]
        parts.append(line(places, f'stroke="{color}" stroke-width="2"'))
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{color}"/>' for x, y in places]
        if name in chart.dashed:
            straight = [place(point) for point in chart.dashed[name]]
            parts.append(line(straight, f'stroke="{color}" stroke-dasharray="5 4"'))
        parts.append(label(LEFT + 8, TOP + 14 + 16 * number, name, f'fill="{color}"'))
    return parts


def svg(charts: Sequence[Chart]) -> str:
    """The text of an SVG file with charts side by side."""
    size = f'width="{WIDTH * len(charts)}" height="{HEIGHT}" viewBox="0 0 {WIDTH * len(charts)} {HEIGHT}"'
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">']
    parts.append('<rect width="100%" height="100%" fill="#ffffff"/>')
    for number, chart in enumerate(charts):
        parts += [f'<g transform="translate({WIDTH * number} 0)">', *drawn(chart), "</g>"]
    return "\n".join([*parts, "</svg>", ""])

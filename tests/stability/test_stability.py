"""Where sharing samples may fail: each way is a scene, a measure, and a bound.

Seeds are fixed. docs/stability.md lists the present values and what a broken method scores.
"""

from __future__ import annotations

import failure_scenes as scenes
import numpy as np
import pytest
from stage import IS_LONG, METHOD, PATH, SAMPLES, Stage

from dualcone.chart.measures import pulse_index

on = pytest.mark.parametrize


def told(**values: float) -> None:
    """Print what was measured: `pytest -rP` and a failure show it."""
    print("  ".join(f"{name} {value:.4g}" for name, value in values.items()))


@on("stage", [(scenes.contact, (1,))], indirect=True)
def test_contact_shadows_keep_their_light(stage: Stage) -> None:
    pictures = stage.shared()
    ring = stage.signed_error(pictures, stage.edges(0.15))
    everywhere = stage.signed_error(pictures)
    told(ring=ring, everywhere=everywhere)
    assert abs(ring) < 0.02
    assert abs(everywhere) < 0.01


@on("stage", [(scenes.sun_alone, (1,)), (scenes.bright_patch, (1,))], indirect=True)
def test_each_light_keeps_its_energy(stage: Stage) -> None:
    pictures = stage.shared(24 * SAMPLES)
    everywhere = stage.signed_error(pictures)
    shadows = stage.signed_error(pictures, stage.edges(0.15))
    told(everywhere=everywhere, shadows=shadows)
    assert abs(everywhere) < 0.02
    assert abs(shadows) < 0.05


def assert_not_worse_than_path_tracing(stage: Stage) -> None:
    """At equal samples; the chart asks about equal time."""
    ours, theirs = stage.error(METHOD), stage.error(PATH)
    told(ours=ours, path=theirs, ratio=ours / theirs)
    assert ours < 1.1 * theirs


@on(
    "stage",
    [
        (scenes.many_lamps, (1,)),
        (scenes.glossy_ramp, (3,)),
        (scenes.thicket, (1,)),
        (scenes.whip_pan, (3,)),
    ],
    indirect=True,
)
def test_no_scene_is_worse_than_path_tracing(stage: Stage) -> None:
    assert_not_worse_than_path_tracing(stage)


@on("stage", [(scenes.fan, (2, 3)), (scenes.hard_cut, (2, 3))], indirect=True)
def test_what_comes_into_view_is_not_what_was_there(stage: Stage) -> None:
    """Signed error where the picture changed: a ghost of the frame before tints it."""
    assert_not_worse_than_path_tracing(stage)
    mask = stage.uncovered()
    assert mask.any()
    tint = float(np.abs(stage.tint(stage.shared(), mask)).max())
    told(tint=tint)
    assert tint < 0.02


@on("stage", [(scenes.blurred_fan, (3,))], indirect=True)
def test_what_is_blurred_is_as_wide_and_as_bright_as_by_path_tracing(stage: Stage) -> None:
    """Where the blades pass: signed error, and how much of their contrast is left.

    The contrast is the slope of our picture over the reference's: blur that sharing adds lowers it,
    blur that it takes away raises it. Products of the reference's halves, whose noise averages out.
    """
    assert_not_worse_than_path_tracing(stage)
    edges = stage.edges(0.3)
    ours = stage.shared(4 * SAMPLES)
    tint = float(np.abs(stage.tint(ours, edges)).max())

    def centred(pictures: np.ndarray) -> np.ndarray:
        return pictures[edges] - pictures[edges].mean(axis=0)

    first, second = (centred(half) for half in stage.truth.halves)
    both = centred(ours.mean(axis=0)) * (first + second) / 2
    contrast = float(both.sum() / (first * second).sum())
    told(tint=tint, contrast=contrast)
    assert tint < 0.01
    assert contrast == pytest.approx(1.0, abs=0.02)


@on("stage", [(scenes.checker, (1,))], indirect=True)
def test_a_pattern_of_one_pixel_keeps_its_contrast(stage: Stage) -> None:
    """Energy of the gradients, from products of two seeds: their noise averages out."""
    first, second = stage.shared(4 * SAMPLES)[:2]
    halves = stage.truth.halves

    def energy(a: np.ndarray, b: np.ndarray) -> float:
        return sum(float((np.diff(a, axis=k) * np.diff(b, axis=k)).sum()) for k in (1, 2))

    ratio = energy(first, second) / energy(*halves)
    told(ratio=ratio)
    assert ratio == pytest.approx(1.0, abs=0.03)


@on("stage", [(scenes.thin_wall, (1,))], indirect=True)
def test_no_light_leaks_through_a_thin_wall(stage: Stage) -> None:
    """Light in the dark half beyond the reference's, as a share of the bright half's."""
    width = stage.truth.pictures.shape[2]
    pictures = stage.shared().mean(axis=0)
    dark, bright = slice(0, width // 2 - 4), slice(width // 2 + 4, width)
    extra = pictures[:, :, dark].mean() - stage.truth.pictures[:, :, dark].mean()
    leak = float(extra / stage.truth.pictures[:, :, bright].mean())
    told(leak=leak)
    assert abs(leak) < 0.002


@on("stage", [(scenes.moving_sun, tuple(range(3, 8)))], indirect=True)
def test_stripes_of_a_moving_sun_do_not_lag(stage: Stage) -> None:
    """The shift in time: a parabola through the errors against the frame before, at and after."""
    assert_not_worse_than_path_tracing(stage)
    pictures, truth = stage.shared(4 * SAMPLES)[0], stage.truth.pictures
    before, at, after = (
        float(((pictures[1:-1] - truth[1 + k : len(truth) - 1 + k]) ** 2).mean())
        for k in (-1, 0, 1)
    )
    lag = 0.5 * (before - after) / (before - 2 * at + after)
    told(before=before, at=at, after=after, lag=lag)
    assert at < 0.2 * min(before, after)
    assert abs(lag) < 0.05


@on("stage", [(scenes.room, tuple(range(4, 14 if IS_LONG else 11)))], indirect=True)
def test_a_still_room_does_not_pulse(stage: Stage) -> None:
    """PAPER's blocks of three frames pulse: all of the change is at their borders."""
    pictures = stage.pictures(METHOD, 4)
    changes = np.mean([stage.truth.changes(p) for p in pictures], axis=0)
    index = pulse_index(changes, 3)
    told(index=index)
    assert index < 1.25


@on("stage", [(scenes.fireflies, (1,))], indirect=True)
def test_fireflies_do_not_become_blobs(stage: Stage) -> None:
    """The 99.9th percentile of the absolute error against that of path tracing."""
    ours, theirs = (
        float(np.quantile(np.abs(stage.errors(stage.pictures(m))), 0.999)) for m in (METHOD, PATH)
    )
    told(ours=ours, path=theirs, ratio=ours / theirs)
    assert ours < 1.7 * theirs


@on("stage", [(scenes.room, (1,))], indirect=True)
def test_the_error_goes_on_falling(stage: Stage) -> None:
    """Slope of log relMSE against log samples; a bias that stays would bend it to 0."""
    few, many = (4, 256) if IS_LONG else (4, 64)
    # Two seeds scatter by a fifth here.
    low, high = (
        np.mean([stage.truth.relative_mse(stage.picture(METHOD, n, seed)) for seed in range(8)])
        for n in (few, many)
    )
    slope = float(np.log(high / low) / np.log(many / few))
    told(few=low, many=high, slope=slope)
    assert slope < -0.55
